"""Which paths of a netlist lead from one clock to another, and which of them no synchroniser stands in.

A control signal may pass in one way only: from a register or a pin, with no logic behind it, into a register that
nothing reads but another one of the same clock. Data that hold while they are looked at may pass otherwise: what a RAM
gives, and registers that a test names. A reset may clear a register asynchronously.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.recall import ran_or_recalled

_FF = re.compile(r"\$_(S?DFFE?|DFFSR|A?DFFE?)\w*_")
_ASYNCHRONOUS = re.compile(r"\$_DFFE?_[PN]{2}[01]\w*_")
_MEMORY = re.compile(r"\$mem.*")
_SCRIPT = (
    "read_verilog netlist.v; hierarchy -top {top}; proc; flatten; opt; memory -nomap; techmap; opt; write_json out.json"
)


# All names of a bit: instances and a signal, with dots between them.
Names = frozenset[str]


@dataclass(frozen=True)
class Crossed:
    """The names of both ends of a path, and the side of the register at its end."""

    source: Names
    sink: Names
    side: str


@dataclass(frozen=True)
class Domains:
    """The clocks of a netlist: the side of each clock's port, and of every other port.

    `held` are the last parts of the names of registers whose values hold while another side looks at them.
    """

    clocks: Mapping[str, str]
    side_of: Callable[[str], str]
    held: tuple[str, ...] = ()


def unsynchronised(verilog: str, top: str, folder: Path, domains: Domains) -> list[str]:
    """Return the faults, one per line."""
    return sorted(set(_netlist(verilog, top, folder, domains).faults()))


def crossing_paths(verilog: str, top: str, folder: Path, domains: Domains) -> set[Crossed]:
    """Return all paths into registers from another side but those out of RAM."""
    return set(_netlist(verilog, top, folder, domains).paths())


def _netlist(verilog: str, top: str, folder: Path, domains: Domains) -> _Netlist:
    (folder / "netlist.v").write_text(verilog, encoding="utf-8")
    done = ran_or_recalled(["yosys", "-q", "-p", _SCRIPT.format(top=top)], folder)
    assert done.exit_code == 0, done.output
    module = json.loads((folder / "out.json").read_text(encoding="utf-8"))["modules"][top]
    return _Netlist(module, domains)


@dataclass(frozen=True)
class _Input:
    """An input of a register but its clock, by bits; `output` is the register's."""

    pin: str
    bit: int
    output: int


class _Netlist:
    """The bits of a flat netlist of gates: the driver, the readers and the clock of each."""

    def __init__(self, module: dict[str, Any], domains: Domains) -> None:
        self.domains = domains
        self.ports = {name: port for name, port in module["ports"].items() if name not in domains.clocks}
        self.names: dict[int, list[str]] = defaultdict(list)
        for name, net in module["netnames"].items():
            for bit in net["bits"]:
                self.names[bit].append(name)
        self.sides: dict[int, str] = {}  # of registers' outputs and of inputs
        self.inputs: list[_Input] = []
        self.drivers: dict[int, list[int]] = {}  # of gates, by output
        self.registers: set[int] = set()
        self.pins: set[int] = set()  # of inputs of the whole
        self.memories: set[int] = set()
        self.before: dict[int, frozenset[str]] = {}  # the sides of all origins
        self.readers: dict[int, list[str]] = defaultdict(list)
        clocks = {module["ports"][port]["bits"][0]: side for port, side in domains.clocks.items()}
        for cell in module["cells"].values():
            if cell["type"] != "$scopeinfo":
                self._add(cell, clocks)
        for name, port in self.ports.items():
            for bit in port["bits"]:
                if port["direction"] == "input":
                    self.pins.add(bit)
                    self.sides[bit] = domains.side_of(name)
                else:
                    self.readers[bit].append("a port")

    def _add(self, cell: dict[str, Any], clocks: dict[int, str]) -> None:
        pins, kind = cell["connections"], cell["type"]
        outputs = [pin for pin in pins if cell["port_directions"][pin] == "output"]
        read = [(pin, bit) for pin in pins if pin not in (*outputs, "C") for bit in pins[pin]]
        for pin, bit in read:
            self.readers[bit].append(f"{kind} {pin}")
        if _FF.fullmatch(kind):
            (output,) = pins["Q"]
            self.registers.add(output)
            self.sides[output] = clocks[pins["C"][0]]
            is_cleared = bool(_ASYNCHRONOUS.fullmatch(kind))
            self.inputs += [_Input(pin, bit, output) for pin, bit in read if not (is_cleared and pin == "R")]
        elif _MEMORY.fullmatch(kind):
            self.memories |= {bit for pin in outputs for bit in pins[pin]}
        else:
            assert kind.startswith("$_"), f"the cell {kind} is not known"
            self.drivers |= {bit: [other for _, other in read] for pin in outputs for bit in pins[pin]}

    def faults(self) -> Iterator[str]:
        for item in self.inputs:
            for origin in self._foreign(item.bit, self.sides[item.output]):
                is_direct = origin == item.bit and item.pin == "D" and origin in self.registers | self.pins
                if not (is_direct and self._is_first(item.output)):
                    yield f"{self._name(origin)} into {self._name(item.output)}"
        for name, port in self.ports.items():
            if port["direction"] == "output":
                for bit in port["bits"]:
                    for origin in self._foreign(bit, self.domains.side_of(name)):
                        yield f"{self._name(origin)} to {name}"

    def paths(self) -> Iterator[Crossed]:
        for item in self.inputs:
            for origin in self._foreign(item.bit, self.sides[item.output]):
                source, sink = (frozenset(self.names[bit]) for bit in (origin, item.output))
                yield Crossed(source, sink, self.sides[item.output])

    def _is_first(self, output: int) -> bool:
        """Return whether a register is read by exactly one other, without logic in between."""
        readers = self.readers[output]
        return len(readers) == 1 and bool(_FF.fullmatch(readers[0].removesuffix(" D")))

    def _foreign(self, bit: int, side: str) -> Iterator[int]:
        """What a bit depends on within a cycle that is of another side and may change at any time."""
        if self._sides_before(bit) <= {side}:
            return
        for origin in self._origins(bit):
            is_held = any(name.split(".")[-1] in self.domains.held for name in self.names[origin])
            if self.sides.get(origin, side) != side and not is_held:
                yield origin

    def _sides_before(self, bit: int) -> frozenset[str]:
        """The sides of all origins of a bit; each gate is looked at once, since most bits have one side."""
        open_ = [bit]
        while open_:
            here = open_[-1]
            before = (
                [] if here in self.memories else [item for item in self.drivers.get(here, []) if isinstance(item, int)]
            )
            new = [item for item in before if item not in self.before]
            if here not in self.before and new:
                # Also ends a loop.
                self.before[here] = frozenset()
                open_ += new
                continue
            open_.pop()
            own = {self.sides[here]} if not before and here in self.sides else set()
            self.before[here] = frozenset(own.union(*(self.before[item] for item in before)))
        return self.before[bit]

    def _origins(self, bit: int) -> set[int]:
        found: set[int] = set()
        open_, seen = [bit], {bit}
        while open_:
            here = open_.pop()
            if here in self.memories:
                continue
            if here not in self.drivers:
                found.add(here)
                continue
            new = {other for other in self.drivers[here] if isinstance(other, int)} - seen
            seen |= new
            open_ += new
        return found

    def _name(self, bit: int) -> str:
        return min(self.names[bit], key=len)
