"""A node in fabric as a program (`rtps_world.vhd`), to which events are sent."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.fabric.control import Sizes, main_of
from fusesoc_firm.fabric.node import Node
from fusesoc_firm.fabric.packets import programs_of
from tests.cores.announcements import ROOM, SAMPLE, WAITING, Event, Kind, Results, a_node, sent
from tests.fabric.memories import generics, memories
from tests.hdl.ghdl import core_files
from tests.hdl.verilator import compiled
from tests.hdl.verilog import netlist
from tests.recall import Conversation
from tests.shared import made_once

HERE = Path(__file__).parent
HARDWARE = ("axis/package", "axis/axis", "net/mac", "net/builder", "net/rtps")


def program(node: Node, sizes: Sizes, assembled: int, sample: int, waiting: int) -> Path:
    """The program, which is compiled once; without Verilator, the test is skipped."""
    if not shutil.which("verilator"):
        pytest.skip("verilator is not installed")
    name = f"rtps_world_{len(node.endpoints)}_{sizes.sources}_{sizes.sinks}_{assembled}_{sample}_{waiting}"
    return made_once(name, partial(_build, node, sizes, assembled, sample, waiting)) / "model" / "Vrtps_world"


def _build(node: Node, sizes: Sizes, assembled: int, sample: int, waiting: int, folder: Path) -> Path:
    """GHDL's netlist of the hardware, translated by Verilator."""
    files = [*memories(node, "rtps_world", folder, sizes), HERE / "rtps_world.vhd"]
    given = {**generics(node, sizes), "ASSEMBLED": assembled, "SAMPLE": sample, "BYTES": waiting}
    given["PROGRAM_BITS"] = programs_of(node).address_bits
    verilog = netlist("rtps_world", folder, files, core_files(*HARDWARE), (), **given)
    bench = (HERE / "rtps_world.cpp").read_text(encoding="ascii")
    return compiled(verilog.read_text(encoding="utf-8"), "rtps_world", bench, folder, [HERE])


class World:
    """A node that runs, of whose host's cycles so many of 100 take nothing."""

    def __init__(
        self,
        stall: int = 0,
        node: Node | None = None,
        sizes: Sizes = ROOM,
        assembled: int = 0,
        sample: int = SAMPLE,
        waiting: int = WAITING,
    ) -> None:
        own = node or a_node()
        words = [str(program(own, sizes, assembled, sample, waiting)), str(main_of(own)), str(stall)]
        self._program = Conversation(words, "done\n")
        self.pulses: Counter[str] = Counter()
        self.entries = [0, 0, 0]  # peers, and their writers and readers that match
        self.cycles = 0  # of the last event, until the node had nothing to do
        self.latency = 0  # cycles of the last event, from a frame's end to the first byte of a packet; 0 without both

    def __enter__(self) -> World:
        self._program.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        self._program.__exit__(*raised)

    def do(self, event: Event) -> Results:
        """What an event causes, if the node had nothing to do before."""
        self.latency = 0
        found = Results()
        for row in self._program.ask(event.row):
            kind, *texts = row.split()
            numbers = [int(text) for text in texts]
            if kind == "entries":
                self.entries = numbers
            elif kind == "cycles":
                (self.cycles,) = numbers
            elif kind == "latency":
                (self.latency,) = numbers
            elif kind == "frame":
                found.frames.append(bytes(numbers))
            elif kind == "sent":
                found.sent.append(sent(bytes(numbers)))
            else:
                self.pulses[kind] += 1
        return found

    def all(self, events: Sequence[Event]) -> Results:
        """What events cause."""
        found = Results()
        for event in [*events, Event(Kind.TICKS, count=0)]:
            some = self.do(event)
            found.frames += some.frames
            found.sent += some.sent
        found.refused = self.pulses["refused"]
        found.lossy, found.skipped = self.pulses["lost"], self.pulses["parted"]
        return found
