"""Topics between accelerators: within the FPGA, and by an ideal host that returns every message."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.text.render import render
from tests.hdl.ghdl import Library, core_files
from tests.system.simulated.systems import RUNTIME, generate_system
from tools.bench.tables import FAILED, MET, MISSED, Table, Tell

TITLE = "Messages of pipelines of four accelerators"
# The least quotient of the rates by the number of pipelines and the width.
BARS = {(4, 8): 70.0, (4, 64): 11.0, (16, 8): 280.0, (16, 64): 44.0}
CYCLES = 20_000
# Of the messages, this many cause one frame to the host.
_OF_A_FRAME = 256
_TOPICS = 3

_FOLDER = Path(__file__).parent
_ACCELERATORS = "pipeline.vhd"
_MESSAGE = {"middleware": "ROS2", "message": "std_msgs/UInt32"}
_COLUMNS = ("pipelines", "width", "within the FPGA", "by the host", "quotient", "bar", "result")
_NOTE = f"""
    A pipeline consists of a source of numbers, two accelerators that each hold one message until the next one takes
    it, and a sink, with a topic between each two of them. The numbers are messages of std_msgs/UInt32 in all pipelines
    together for each 1,000 cycles, counted in GHDL's simulation of {CYCLES:,} cycles. The sinks send every
    {_OF_A_FRAME}th message to the host. 'By the host' is the same system with 'deliver: host', where a host without
    any delay returns each frame to its subscriber.
    """


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [(str(count), str(width)) for count, width in BARS]}


def measure(tell: Tell) -> list[Table]:
    """Simulate all systems; `tell` hears of each."""
    rows = []
    for (count, width), bar in BARS.items():
        inner, outer = (rate_of(count, width, way) for way in ("fabric", "host"))
        result = FAILED if not inner or not outer else MET if inner / outer >= bar else MISSED
        quotient = f"{inner / outer:.1f}" if outer else ""
        rows.append((str(count), str(width), f"{inner:.0f}", f"{outer:.1f}", quotient, f">= {bar:g}", result))
        tell(" ".join(rows[-1]))
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def rate_of(pipelines: int, width: int, way: str, cycles: int = CYCLES) -> float:
    """The messages of all pipelines for each 1,000 cycles, with topics that are delivered this way."""
    with tempfile.TemporaryDirectory() as directory:
        folder = Path(directory)
        spec = folder / "pipelines.yaml"
        spec.write_text(yaml.safe_dump(_specification(pipelines, width, way), sort_keys=False), encoding="utf-8")
        (folder / _ACCELERATORS).write_bytes((_FOLDER / _ACCELERATORS).read_bytes())
        system = load_system(spec, {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}).system
        files = generate_system(spec, folder / "core")
        Library("firm", folder / "core").analyse(core_files(*RUNTIME))
        bench = folder / "core" / "relays.vhd"
        context = {"entity": system.entity, "width": width, "cycles": cycles, "relayed": list(_relayed(system))}
        bench.write_text(render("relays.vhd", context, _FOLDER), encoding="utf-8")
        work = Library("work", folder / "core")
        work.analyse([*files, bench])
        result = work.run("relays", {})
    found = re.search(r"frames: (\d+), returned: (\d+)", result.output)
    if not found:
        return 0
    messages = int(found[2]) / _TOPICS if int(found[2]) else _OF_A_FRAME * int(found[1])
    return 1000 * messages / cycles


def _relayed(system: DerivedSystem) -> Iterator[dict[str, int]]:
    """Yield the ids of the publisher and the subscriber of each topic that the host returns."""
    ids = {item.name: item.id for item in system.subscribers}
    for publisher in system.publishers:
        if publisher.name in ids:
            yield {"publisher": publisher.id, "subscriber": ids[publisher.name]}


def _specification(pipelines: int, width: int, way: str) -> dict[str, Any]:
    types = [
        {"name": name, "type": "VHDL", "sources": _ACCELERATORS, "interface": _interface(name)}
        for name in ("source", "stage", "sink")
    ]
    # A system has a subscriber.
    blocks: list[dict[str, Any]] = [
        {"name": "unused", **_MESSAGE, "mode": "subscriber", "outgoing": [{"name": "unused_out"}]},
        {"name": "unused_out", **_MESSAGE, "mode": "publisher"},
    ]
    for number in range(pipelines):
        for place, type_ in enumerate(("source", "stage", "stage", "sink")):
            name, before, after = f"p{number}_{place}", f"p{number}_t{place}", f"p{number}_t{place + 1}"
            if place:
                ways = [{"name": name}]
                blocks.append(
                    {"name": f"{before}_in", **_MESSAGE, "mode": "subscriber", "topic": before, "outgoing": ways}
                )
            blocks.append({"name": name, "type": type_, "outgoing": [{"name": after}]})
            delivered = {"deliver": way} if place < _TOPICS else {}
            blocks.append({"name": after, **_MESSAGE, "mode": "publisher", "topic": after, **delivered})
    project = {"name": "pipelines", "width": width, "scheduler": "round_robin"}
    return {"project": project, "accelerators": types, "blocks": blocks}


def _interface(name: str) -> dict[str, Any]:
    return {"output": [_MESSAGE]} if name == "source" else {"input": [_MESSAGE], "output": [_MESSAGE]}
