"""Which paths of a netlist lead from one clock to another, and which of them no synchroniser stands in.

Between the two clocks of a crossing, `s_clk` and `m_clk`, a control signal may pass in one way only: from a register,
with no logic behind it, into a register that nothing reads but another one of the same clock. Data that hold while
they are looked at may pass otherwise: what a RAM gives, and the outputs that a test names.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from tests import yowasp

_FF = re.compile(r"\$_(S?DFFE?|DFFSR|A?DFFE?)\w*_")
_MEMORY = re.compile(r"\$mem.*")
_CLOCKS = {"s_clk": "s", "m_clk": "m"}
_SCRIPT = (
    "read_verilog netlist.v; hierarchy -top {top}; proc; flatten; opt; memory -nomap; techmap; opt; write_json out.json"
)


def unsynchronised(verilog: str, top: str, folder: Path, data: Iterable[str] = ()) -> list[str]:
    """What is wrong, a line each; `data` are outputs that may come from the other clock's registers."""
    (folder / "netlist.v").write_text(verilog, encoding="utf-8")
    yosys = yowasp.Yosys()
    yosys.prepare()
    done = yosys.run(["-q", "-p", _SCRIPT.format(top=top)], folder)
    assert done.returncode == 0, done.stderr
    module = json.loads((folder / "out.json").read_text(encoding="utf-8"))["modules"][top]
    return sorted(set(_Netlist(module).faults(set(data))))


class _Netlist:
    """The bits of a flat netlist of gates: who drives each, who reads it, and of which clock it is."""

    def __init__(self, module: dict[str, Any]) -> None:
        self.ports = module["ports"]
        self.names = {bit: name for name, net in module["netnames"].items() for bit in net["bits"]}
        clocks = {self.ports[port]["bits"][0]: side for port, side in _CLOCKS.items()}
        self.registers: dict[int, str] = {}  # by output, the side
        self.inputs: list[tuple[str, str, int, int]] = []  # of registers: side, pin, bit, output
        self.drivers: dict[int, list[int]] = {}  # of gates, by output
        self.memories: set[int] = set()
        self.readers: dict[int, list[str]] = defaultdict(list)
        for cell in module["cells"].values():
            if cell["type"] != "$scopeinfo":
                self._add(cell, clocks)
        for name, port in self.ports.items():
            if port["direction"] == "output":
                for bit in port["bits"]:
                    self.readers[bit].append(f"port {name}")

    def _add(self, cell: dict[str, Any], clocks: dict[int, str]) -> None:
        pins = cell["connections"]
        outputs = [pin for pin in pins if cell["port_directions"][pin] == "output"]
        read = [bit for pin in pins if pin not in (*outputs, "C") for bit in pins[pin]]
        if _FF.fullmatch(cell["type"]):
            (output,) = pins["Q"]
            side = clocks[pins["C"][0]]
            self.registers[output] = side
            self.inputs += [(side, pin, bit, output) for pin in pins if pin not in ("C", "Q") for bit in pins[pin]]
        elif _MEMORY.fullmatch(cell["type"]):
            self.memories |= {bit for pin in outputs for bit in pins[pin]}
        else:
            assert cell["type"].startswith("$_"), f"the cell {cell['type']} is not known"
            self.drivers |= {bit: read for pin in outputs for bit in pins[pin]}
        for pin, bits in pins.items():
            if pin not in outputs:
                for bit in bits:
                    self.readers[bit].append(f"{cell['type']} {pin}")

    def faults(self, data: set[str]) -> Iterator[str]:
        inputs = {
            bit: name[0] for name, port in self.ports.items() if port["direction"] == "input" for bit in port["bits"]
        }
        sides = {**inputs, **self.registers}
        for side, pin, bit, output in self.inputs:
            for origin in self._origins(bit):
                if sides.get(origin, side) == side:
                    continue
                is_synchroniser = origin == bit and pin == "D" and origin in self.registers and self._is_first(output)
                if not is_synchroniser:
                    yield f"{self.names[origin]} into {self.names[output]}"
        for name, port in self.ports.items():
            if port["direction"] == "output" and name not in data:
                for bit in port["bits"]:
                    yield from (
                        f"{self.names[origin]} to {name}"
                        for origin in self._origins(bit)
                        if sides.get(origin, name[0]) != name[0]
                    )

    def _is_first(self, output: int) -> bool:
        """Whether a register is read by one other, and that as it is."""
        readers = self.readers[output]
        return len(readers) == 1 and readers[0].endswith(" D") and readers[0].startswith("$_")

    def _origins(self, bit: int) -> set[int]:
        """The registers and inputs that a bit depends on within a cycle."""
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
