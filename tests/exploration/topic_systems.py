"""Systems with topics in an exchange, and how near their bounds are to the slowest messages that a search finds."""

from __future__ import annotations

from pathlib import Path
from random import Random
from typing import Any

import yaml

from fusesoc_firm.exploration.worst_case import WorstTimes
from fusesoc_firm.system.derived.timing import responses_of
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import LoadedSystem
from tests.noc.adversary import worst_found

MESSAGES = (
    "std_msgs/Bool",
    "std_msgs/Float32",
    "geometry_msgs/Point",
    "geometry_msgs/Quaternion",
    "geometry_msgs/Twist",
)
FABRICS = ("crossbar", "mesh", "concentrated_mesh", "chain", "tree", "ring", "torus")


def side(message: str) -> list[dict[str, str]]:
    return [{"middleware": "ROS2", "message": message}]


def converter(name: str, mode: str, message: str, **keys: Any) -> dict[str, Any]:
    return {"name": name, "mode": mode, **side(message)[0], **keys}


def accelerator(name: str, message: str, answer: str, latency: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """A type and its instance."""
    interface = {"input": side(message), "output": side(answer)}
    type_ = {"name": f"{name}_type", "type": "VHDL", "sources": "acc.vhd", "latency": latency, "interface": interface}
    return type_, {"name": name, "type": f"{name}_type", "outgoing": [{"name": f"{name}_out"}]}


def loaded(project: dict[str, Any], types: list[Any], blocks: list[Any], folder: Path) -> LoadedSystem:
    (folder / "acc.vhd").touch()
    path = folder / "robot.yaml"
    content = {"project": {"name": "robot", "scheduler": "round_robin", **project}, "accelerators": types}
    path.write_text(yaml.safe_dump({**content, "blocks": blocks}, sort_keys=False), encoding="utf-8")
    return load_beside(path)


def random_system(chance: Random, folder: Path) -> LoadedSystem:
    """Up to eight accelerators that publish topics, and subscribe to those of accelerators before them."""
    count = chance.randint(3, 8)
    topics = [(f"topic{number}", chance.choice(MESSAGES)) for number in range(max(2, count - 2))]
    types, blocks = [], [converter("host", "subscriber", topics[0][1], outgoing=[{"name": "acc0"}])]
    for number in range(count):
        name, message = f"acc{number}", topics[0][1]
        if number:
            topic, message = topics[chance.randrange(min(number, len(topics) - 1))]
            blocks.append(converter(f"{name}_in", "subscriber", message, topic=topic, outgoing=[{"name": name}]))
        topic, answer = topics[min(number, len(topics) - 1)]
        type_, block = accelerator(name, message, answer, chance.randint(1, 40))
        types.append(type_)
        blocks += [block, converter(f"{name}_out", "publisher", answer, topic=topic)]
    project = {"fabric": chance.choice(FABRICS), "width": chance.choice((8, 16, 32, 64))}
    return loaded(project, types, blocks, folder)


def ratios(system: LoadedSystem, seed: int, runs: int, cycles: int) -> list[float]:
    """The bound of each message in the exchange over the slowest found one."""
    bounds = WorstTimes(system, responses_of(system.system)).exchange
    found = []
    for (source, sink), time in worst_found(bounds, seed, runs, cycles).items():
        bound = bounds.acceptance(source) - 1 + bounds.delivery(source, sink)
        assert time <= bound, f"seed {seed}: from {source} to {sink}, {time} > {bound}"
        found.append(bound / time)
    return found
