"""Derived System -> template configuration: constraints on clocks and on the paths between clocks.

Each crossing, each synchroniser of a pin and each reset has its own constraints, which name its registers.
docs/how-to/use-several-clocks.md lists them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from fusesoc_firm.system.boards.board import Board, board_entity
from fusesoc_firm.system.boards.processor import PROCESSORS
from fusesoc_firm.system.derived.model import BlockParameter, Clock, DerivedSystem
from fusesoc_firm.system.hardware.crossings import Crossing, Scope, all_crossings, port_of, word
from fusesoc_firm.system.hardware.names import Names, reset_label, resets, synchronised_pins
from fusesoc_firm.text.render import Context

CHECKS_TEMPLATE = "board/checks.tcl"


def clocks_configuration(system: DerivedSystem, board: Board, clock: Fraction, separator: str) -> Context:
    """Return the configuration, with the processor's names for its clocks; `clock` is the frequency of clk in Hz.

    `separator` is the tool's separator between the names of instances and registers.
    """
    names = Names(system)
    clocks = _clocks(system, board, clock)
    found = _Constraints(system, names, separator, {port: (name, 1 / frequency) for name, port, frequency in clocks})
    return {
        "description": str(board.description),
        "clocks": [{"name": name, "port": port, "period": period(frequency)} for name, port, frequency in clocks],
        "crossings": [
            *(found.crossing(item) for item in all_crossings(system) if item.is_clocked),
            *(found.parameter(item) for item in system.parameters if system.clock_of(item.block)),
        ],
        "pins": [
            {"first": separator.join((names.label(block.block, pin.name, "sync"), "first_r"))}
            for block, pin in synchronised_pins(system)
        ],
        "resets": [{"instance": reset_label(reset)} for reset in resets(system)],
    }


def checks_configuration(system: DerivedSystem, board: Board, clock: Fraction) -> Context:
    """Return the configuration of the checks of a routed design in Vivado; `clock` is the frequency of clk in Hz.

    Fields are not among the registers, since an accelerator may use none of them, or have no register for them.
    """
    found = clocks_configuration(system, board, clock, "/")
    paths = [path for crossing in found["crossings"] for path in (*crossing["levels"], *crossing["pointers"])]
    registers = [path[end] for path in paths for end in ("source", "sink")]
    registers += [pin["first"] for pin in found["pins"]]
    registers += [f"{reset['instance']}/first_r" for reset in found["resets"]]
    common = {"board": board.name, "design": board_entity(system, board), "description": found["description"]}
    return {**common, "registers": registers, "clocks": found["clocks"]}


def _clocks(system: DerivedSystem, board: Board, clock: Fraction) -> list[tuple[str, str, Fraction]]:
    """Return name, port and frequency of each clock."""
    clocks = [("clk", clock), *((item.port, item.frequency) for item in system.clocks)]
    if not board.processor:
        return [(port, port, frequency) for port, frequency in clocks]
    name = PROCESSORS[str(board.processor)].timing_clock
    return [(name.format(number), port, frequency) for number, (port, frequency) in enumerate(clocks)]


@dataclass(frozen=True)
class _Constraints:
    """The constraints on crossings; `clocks` maps the port of each clock to its name and its cycle in seconds."""

    system: DerivedSystem
    names: Names
    separator: str
    clocks: Mapping[str, tuple[str, Fraction]]

    def crossing(self, crossing: Crossing) -> Context:
        """Return the constraints on a crossing between two clocks.

        `levels` and `pointers` are paths into synchronisers. `held` are registers and RAM with values that are stable
        during a read. `fields` are source blocks that hold the fields of their messages themselves.
        """
        scopes = crossing.scopes
        streams = [(scope, stream) for scope in scopes for stream in scope.streams]
        return {
            "ends": f"{crossing.source.block} to {crossing.sink.block}, {crossing.clocks}",
            "levels": [path for scope in scopes for path in self._levels(crossing, scope)],
            "pointers": [path for scope, stream in streams for path in self._pointers(crossing, stream)],
            "held": [*self._held(crossing, streams)],
            "fields": [*self._fields(crossing)] if crossing.frame.is_fixed_size else [],
        }

    def parameter(self, item: BlockParameter) -> Context:
        """Return the constraints on the words of a parameter, which cross to the clock of its block and back."""
        clock = self.system.clock_of(item.block)
        levels, held = [], []
        for way, source, sink in (("there", None, clock), ("back", clock, None)):
            label = self._register(self.names.label(item.block, item.parameter.name, way), "u_message")
            levels.append(self._path(label, "request_r", "u_request", self._cycle(sink)))
            levels.append(self._path(label, "answer_r", "u_return", self._cycle(source)))
            held.append({"source": self._register(label, "fields_r"), "period": _nanoseconds(self._cycle(sink))})
        ends = f"the parameter {item.name}, clk and {port_of(clock)}"
        return {"ends": ends, "levels": levels, "pointers": [], "held": held, "fields": []}

    def _levels(self, crossing: Crossing, scope: Scope) -> Iterator[Context]:
        label = self.names.crossing_label(crossing, word(scope.handshake.part, "crossing"))
        yield self._path(label, "request_r", "u_request", self._cycle(crossing.sink_clock))
        yield self._path(label, "answer_r", "u_return", self._cycle(crossing.source_clock))

    def _pointers(self, crossing: Crossing, stream: str) -> Iterator[Context]:
        label = self._stream_label(crossing, stream)
        source, sink = self._cycle(crossing.source_clock), self._cycle(crossing.sink_clock)
        skew = {"skew": _nanoseconds(min(source, sink))}
        yield self._path(label, "write_gray_r", "u_write_seen", sink) | skew
        yield self._path(label, "read_gray_r", "u_read_seen", source) | skew

    def _held(self, crossing: Crossing, streams: list[tuple[Scope, str]]) -> Iterator[Context]:
        cycle = _nanoseconds(self._cycle(crossing.sink_clock))
        if not crossing.frame.is_fixed_size:
            for scope in crossing.scopes:
                label = self.names.crossing_label(crossing, word(scope.handshake.part, "crossing"))
                yield {"source": self._register(label, "fields_r"), "period": cycle}
        for _, stream in streams:
            yield {"source": self._register(self._stream_label(crossing, stream), "memory"), "period": cycle}

    def _fields(self, crossing: Crossing) -> Iterator[Context]:
        """Yield the blocks whose registers may hold the fields, since accelerators may wire fields through."""
        name, cycle = self.clocks[port_of(crossing.sink_clock)]
        for block in self._origins(crossing.source.block):
            if self.system.clock_of(block) != crossing.sink_clock:
                yield {"source": self.names.label(block), "sink": name, "period": _nanoseconds(cycle)}

    def _origins(self, block: str) -> list[str]:
        """Return a block and all its predecessors."""
        found = {block: None}
        for sink in (open_ := [block]):
            before = [
                item.source.block for item in self.system.connections if sink in {end.block for end in item.sinks}
            ]
            open_ += [source for source in before if source not in found]
            found |= dict.fromkeys(before)
        return list(found)

    def _path(self, label: str, register: str, synchroniser: str, cycle: Fraction) -> Context:
        """Return a path from a register of a crossing into one of its synchronisers."""
        return {
            "source": self._register(label, register),
            "sink": self._register(label, synchroniser, "first_r"),
            "period": _nanoseconds(cycle),
        }

    def _register(self, *parts: str) -> str:
        return self.separator.join(parts)

    def _stream_label(self, crossing: Crossing, stream: str) -> str:
        return self.names.crossing_label(crossing, word(f"{stream}_axis", "crossing"))

    def _cycle(self, clock: Clock | None) -> Fraction:
        return self.clocks[port_of(clock)][1]


def period(frequency: Fraction) -> str:
    """Return the period in ns for a frequency in Hz, with three decimal places."""
    return _nanoseconds(1 / frequency)


def _nanoseconds(seconds: Fraction) -> str:
    return f"{float(10**9 * seconds):.3f}"
