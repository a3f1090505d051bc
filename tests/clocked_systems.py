"""Random systems that can be simulated: three clocks, groups of schedulers, services, queues and widths of 32 to 256.

Messages pass through chains of accelerators, each at a random clock and width, to one or two publishers, which send
what came in. Sources of accelerators are those that the product writes, which copy their messages.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import Stimuli, kinds
from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.system.scaffold.skeleton import missing_sources
from fusesoc_firm.system.system_core import load_system
from tests.system.systems import LIBRARIES

# Of fixed size, with strings, and with arrays of structures.
_MESSAGES = (
    "geometry_msgs/Point",
    "geometry_msgs/PoseStamped",
    "sensor_msgs/Joy",
    "sensor_msgs/LaserScan",
    "geometry_msgs/PolygonStamped",
    "diagnostic_msgs/DiagnosticArray",
    "own_msgs/Wide",
)
_OWN = {
    "msg/Wide.msg": "wstring name\nuint16[] numbers\n",
    "srv/Echo.srv": "float64 value\nstring text\n---\nfloat64 value\n",
}
_FIXED = "geometry_msgs/Point"
_WIDTHS = (32, 64, 128, 256)
_LONGEST = 2048
_MODEL = """\
SINKS = {sinks!r}


def respond(subscriber, message):
    answer = {{"value": message["value"]}} if subscriber == "echo_request" else message
    return [(publisher, answer) for publisher in SINKS[subscriber]]
"""


@dataclass(frozen=True)
class ClockedSystem:
    """The files of a system, all in one folder, and the blocks of its publishers by those of its subscribers."""

    spec: Path
    stimuli: Path
    model: Path
    sinks: dict[str, list[str]]


def clocked_system(chance: random.Random, folder: Path, chains: int, messages: int = 12) -> ClockedSystem:
    """Write a random system of `chains` chains and a service into `folder`, with stimuli of `messages` messages."""
    maker = _Maker(chance, chains)
    for path, text in _OWN.items():
        place = folder / "definitions" / "own_msgs" / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text, encoding="ascii")
    found = ClockedSystem(folder / "spec.yaml", folder / "stimuli.yaml", folder / "model.py", maker.sinks)
    found.spec.write_text(yaml.safe_dump(maker.specification(), sort_keys=False, width=1000), encoding="utf-8")
    library = MessageLibrary(ROS2, [folder / "definitions"])
    sent = list(maker.stimuli(library, messages))
    found.stimuli.write_text(yaml.safe_dump(sent, allow_unicode=True, width=1000), encoding="utf-8")
    found.model.write_text(_MODEL.format(sinks=maker.sinks), encoding="utf-8")
    system = load_system(found.spec, LIBRARIES, needs_sources=False).system
    for source, skeleton in missing_sources(system, folder).items():
        source.write_text(skeleton, encoding="utf-8")
    return found


class _Maker:
    def __init__(self, chance: random.Random, chains: int) -> None:
        self.chance = chance
        self.clocks = ["slow", "cam"]
        self.blocks: list[dict[str, Any]] = []
        self.accelerators: list[dict[str, Any]] = []
        self.publishers: list[str] = []
        self.messages: dict[str, str] = {}
        self.sinks: dict[str, list[str]] = {}
        for number in range(chains):
            self._chain(f"way{number}", chance.choice(_MESSAGES))
        self._service("echo")

    def _chain(self, name: str, message: str) -> None:
        """A subscriber, accelerators and publishers of a message."""
        side = {"middleware": "ROS2", "message": message}
        is_fixed = message == _FIXED
        output = {**side, **({} if is_fixed else {"length": "given"})}
        # The first chain and the service have accelerators, for both further clocks.
        steps = [f"{name}_step{number}" for number in range(self.chance.randint(not self.blocks, 2))]
        ends = [f"{name}_end{number}" for number in range(self.chance.randint(1, 2))]
        limit = {} if is_fixed else {"maxLength": _LONGEST}
        self.blocks.append(
            {"name": f"{name}_in", **side, "mode": "subscriber", **limit, **self._queue(), **_outgoing(steps, ends)}
        )
        for place, step in enumerate(steps):
            self._accelerator(step, {"input": [side], "output": [output]}, **_outgoing(steps[place + 1 :], ends))
        # Publishers that share streams store them.
        limits = [] if is_fixed else ["buffer"] if len(ends) > 1 else ["buffer", "maxLength"]
        for end in ends:
            self.blocks.append({"name": end, **side, "mode": "publisher", **self._times(limits)})
        self.publishers += ends
        self.messages[f"{name}_in"] = message
        self.sinks[f"{name}_in"] = ends

    def _service(self, name: str) -> None:
        """A service whose accelerator answers with a field of the request."""
        service = {"middleware": "ROS2", "service": "own_msgs/Echo"}
        self.blocks.append({"name": name, **service, "mode": "server", "outgoing": [{"name": f"{name}_answer"}]})
        sides = {
            "input": [{"middleware": "ROS2", "message": "own_msgs/Echo_Request"}],
            "output": [{"middleware": "ROS2", "message": "own_msgs/Echo_Response"}],
        }
        self._accelerator(f"{name}_answer", sides, outgoing=[{"name": name}])
        self.publishers.append(f"{name}_response")
        self.messages[f"{name}_request"] = "own_msgs/Echo_Request"
        self.sinks[f"{name}_request"] = [f"{name}_response"]

    def _accelerator(self, name: str, interface: dict[str, Any], **keys: Any) -> None:
        type_ = {"name": f"{name}_type", "type": "VHDL", "sources": f"{name}_type.vhd", "interface": interface}
        self.accelerators.append({**type_, "width": self.chance.choice((8, *_WIDTHS, 512))})
        # Each clock has an accelerator.
        clock = self.clocks.pop() if self.clocks else self.chance.choice(["cam", "slow", None])
        self.blocks.append({"name": name, "type": type_["name"], **({"clock": clock} if clock else {}), **keys})

    def _queue(self) -> dict[str, Any]:
        return {"queue": self.chance.randint(1, 3)} if self.chance.random() < 0.5 else {}

    def _times(self, limits: list[str]) -> dict[str, Any]:
        """The times of a publisher, and one of the keys `limits` for its longest payload."""
        times = {"period": f"{self.chance.randint(5, 50)} us", "deadline": f"{self.chance.randint(20, 400)} us"}
        return {**times, **({self.chance.choice(limits): _LONGEST} if limits else {})}

    def _groups(self) -> Iterator[dict[str, Any]]:
        """Consecutive publishers; those of the service, which have no times, are in the last group."""
        policies = sorted(POLICIES)
        timeless = [name for name in policies if not POLICIES[name].has_deadlines]
        cut = self.chance.randint(1, len(self.publishers) - 1)
        yield {"scheduler": self.chance.choice(policies), "publishers": self.publishers[:cut]}
        yield {"scheduler": self.chance.choice(timeless), "publishers": self.publishers[cut:]}

    def specification(self) -> dict[str, Any]:
        timeless = [name for name, policy in sorted(POLICIES.items()) if not policy.has_deadlines]
        frequencies = [
            f"{self.chance.choice((7.3, 24, 74.25, 93, 150, 212.5))} MHz",
            f"{self.chance.randint(9, 40)} MHz",
        ]
        project = {
            "name": "clocked",
            "width": self.chance.choice(_WIDTHS),
            "clock": "100 MHz",
            "clocks": [{"name": "cam", "frequency": frequencies[0]}, {"name": "slow", "frequency": frequencies[1]}],
            "scheduler": self.chance.choice(timeless),
            "groups": list(self._groups()),
        }
        return {"project": project, "paths": "definitions", "accelerators": self.accelerators, "blocks": self.blocks}

    def stimuli(self, library: MessageLibrary, count: int) -> Iterator[dict[str, Any]]:
        """Messages to all subscribers in turn, from empty to typical ones."""
        names = list(self.messages)
        for number, kind in enumerate(kinds(count)):
            block = names[number % len(names)] if number < len(names) else self.chance.choice(names)
            name = parse_name(self.messages[block])
            drawn = Stimuli(library.closure(name), ROS2, self.chance, longest=9).message(name, kind)
            yield {block: _plain(drawn)}


def _outgoing(steps: list[str], ends: list[str]) -> dict[str, Any]:
    return {"outgoing": [{"name": name} for name in (steps[:1] or ends)]}


def _plain(value: Any) -> Any:
    """A value without types that YAML has in another form."""
    match value:
        case dict():
            return {name: _plain(item) for name, item in value.items()}
        case list() | bytes():
            return [_plain(item) for item in value]
    return value
