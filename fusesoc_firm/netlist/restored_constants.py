"""Restore in the netlist constants that GHDL 2.0 replaces with zero, where an instance's port reads them.

There, the netlist shows where the constant belongs: the instance has the place of its label, and its input reads the
zero directly. GHDL computes the constant's value (`lost_constants.py`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

from fusesoc_firm.netlist.lost_constants import may_be_lost
from fusesoc_firm.netlist.model import Instance, Module, Modules, Net
from fusesoc_firm.netlist.probe_functions import WORD
from fusesoc_firm.netlist.vhdl_source import VhdlSource

# An actual value: the name of its file, and its position in the file.
Actual = tuple[str, int]


def restore(
    modules: Modules, sources: Mapping[str, VhdlSource], values: Mapping[Actual, Collection[str]]
) -> dict[Actual, int]:
    """Restore constants in place; return 0 for constants that are now correct, and the width of the others.

    `values` has the levels of the highest bits of each constant whose other bits are equal, and of one other bit; it
    has no levels for another constant. If a constant has several values, which depend on generics or a loop, the
    netlist does not show which one belongs to an instance.
    """
    widths: dict[Actual, int] = {}
    for module in modules.values():
        gates = {net.number: gate for gate in module.instances for net in gate.outputs}
        for instance, index, actual in list(_inputs(module, modules, sources)):
            net = instance.inputs[index]
            gate = gates.get(net.number) if net else None
            if not net or not gate or actual not in values:
                continue
            widths.setdefault(actual, 0)
            if may_be_lost(gate):
                if highest := _highest(values[actual]):
                    instance.inputs[index] = _constant(module, gate, int(highest, 2), net.width)
                else:
                    widths[actual] = net.width
    return widths


def _highest(values: Collection[str]) -> str:
    """Return the highest bits, or an empty string if there are several values or levels other than 0 and 1."""
    (levels,) = values if len(values) == 1 else ("",)
    return levels[:-1] if set(levels) <= {"0", "1"} else ""


def _inputs(
    module: Module, modules: Modules, sources: Mapping[str, VhdlSource]
) -> Iterator[tuple[Instance, int, Actual]]:
    """Yield each input of an instance that a port map names: the instance, the input's index and the actual."""
    for instance in module.instances:
        file, line, column = [*instance.location.rsplit(":", 2), "", "", ""][:3]
        if instance.kind in modules and file in sources:
            names = [port.name.lower() for port in modules[instance.kind].inputs]
            for name, start in sources[file].port_map(int(line), int(column)):
                if name in names:
                    yield instance, names.index(name), (file, start)


def _constant(module: Module, zero: Instance, highest: int, width: int) -> Net:
    """Return the net of a new constant with these highest bits."""
    net = Net(module.first_unused(), width, f"{zero.name}_restored_o")
    words = ["0"] * (width // WORD - 1) + [str(highest)]
    module.instances.append(
        replace(zero, name=f"{zero.name}_restored", kind="$const_bit", parameters=words, outputs=[net])
    )
    return net
