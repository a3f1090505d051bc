"""Modules in Verilog as Yosys elaborates them, in the form in which loops are found: bits and their dependencies.

A gate of such a module says only on which bits each of its output bits depends, not how. Modules that Yosys does not
know, such as entities in VHDL, count as registered.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fusesoc_firm.netlist.model import Instance, Module, Net, Port
from fusesoc_firm.tools.yosys import Yosys, source_place

# Yosys writes one gate for each bit of a bitwise operation, and vectors for arithmetic.
_SCRIPT = "hierarchy -top {}; proc; flatten; simplemap"
_REGISTER = re.compile(r"\$_?(a|al|s)?d?ff", re.IGNORECASE)
_RIPPLING = frozenset({"$add", "$sub", "$neg", "$mul", "$alu"})
# A gate without a function: each output depends on all inputs.
_ANY, _REGISTERED = "$any", "$dff"


def elaborate(yosys: Yosys, reading: str, top: str) -> Module | None:
    """Return the module `top` of the files that the command `reading` reads, or None if Yosys cannot elaborate it."""
    found = yosys.modules(f"{reading}; {_SCRIPT.format(top)}").get(top)
    return _Elaborated(found).module(top) if found else None


@dataclass
class _Elaborated:
    """A module in Yosys' JSON, in which a bit is a number, or a constant as a text."""

    content: Mapping[str, Any]
    _numbers: dict[int, int] = field(default_factory=dict)
    _count: int = 0

    def module(self, name: str) -> Module:
        """Return the module, with one net for each port and one for each bit."""
        result = Module(name, is_defined=True)
        ports = {port: item for port, item in self.content["ports"].items() if item["direction"] != "inout"}
        arguments: list[Net] = []
        results: list[Net] = []
        for port, item in ports.items():
            whole = self._new(len(item["bits"]))
            if item["direction"] == "input":
                result.inputs.append(Port(port, whole.width))
                arguments.append(whole)
                result.instances += [
                    Instance("", "$extract", parameters=[f"offset={number}"], inputs=[whole], outputs=[self._net(bit)])
                    for number, bit in enumerate(item["bits"])
                ]
            else:
                result.outputs.append(Port(port, whole.width))
                results.append(whole)
                bits: list[Net | None] = [self._net(bit) for bit in reversed(item["bits"])]
                result.instances.append(Instance("", "$concat", inputs=bits, outputs=[whole]))
        result.arguments, result.results = arguments, results
        result.instances += [gate for cell in self.content["cells"].items() for gate in self._gates(*cell)]
        # Constants, registers, and outputs of unknown modules.
        driven = {net.number for gate in result.instances for net in gate.outputs} | {net.number for net in arguments}
        others = [Net(number, 1) for number in range(1, self._count + 1) if number not in driven]
        result.instances += [Instance("", _REGISTERED, outputs=[net]) for net in others]
        return result

    def _gates(self, name: str, cell: Mapping[str, Any]) -> Iterator[Instance]:
        """Yield a gate for each output bit of a cell; a module that Yosys does not know has none."""
        directions: Mapping[str, str] = cell.get("port_directions", {})
        if not cell["type"].startswith("$") or _is_clocked(cell):
            return
        place = source_place(cell["attributes"])
        location = ":".join(map(str, place)) if place else ""
        sides: dict[str, list[Sequence[int | str]]] = {"input": [], "output": []}
        for port, bits in cell["connections"].items():
            sides[directions[port]].append(bits)
        for bits in sides["output"]:
            for number, bit in enumerate(bits):
                end = number + 1 if cell["type"] in _RIPPLING else None
                inputs: list[Net | None] = [self._net(item) for vector in sides["input"] for item in vector[:end]]
                yield Instance(name, _ANY, location, inputs=inputs, outputs=[self._net(bit)])

    def _new(self, width: int) -> Net:
        self._count += 1
        return Net(self._count, width)

    def _net(self, bit: int | str) -> Net:
        """Return the net of a bit; a constant has a net of its own."""
        if isinstance(bit, str):
            return self._new(1)
        if bit not in self._numbers:
            self._numbers[bit] = self._new(1).number
        return Net(self._numbers[bit], 1)


def _is_clocked(cell: Mapping[str, Any]) -> bool:
    """Whether a cell's outputs change only at a clock edge; a memory's port for reading may be without a clock."""
    clocks = str(cell["parameters"].get("CLK_ENABLE", cell["parameters"].get("RD_CLK_ENABLE", "0")))
    return bool(_REGISTER.match(cell["type"])) or ("mem" in cell["type"] and "1" in clocks)
