"""Corrects what GHDL 2.0 synthesises wrongly, as far as a netlist and its sources show what was meant.

* A rotation by as many places as there are bits, or by more, gives zeros: it is made of two shifts.
* A comparison of a vector that our functions (`sources.py`) lengthen with a constant is as wide as the vector.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from operator import eq, ge, gt, le, lt, ne

from fusesoc_firm.netlist.model import Instance, Modules, Net
from fusesoc_firm.netlist.verilog import constant

_SIGNED, _UNSIGNED = {"$sextend"}, {"$uextend"}
# What a comparison says of numbers, and how a vector can be lengthened before.
_COMPARISONS: Mapping[str, tuple[Callable[[int, int], bool], set[str]]] = {
    "$eq": (eq, _SIGNED | _UNSIGNED),
    "$ne": (ne, _SIGNED | _UNSIGNED),
    "$ult": (lt, _UNSIGNED),
    "$ule": (le, _UNSIGNED),
    "$ugt": (gt, _UNSIGNED),
    "$uge": (ge, _UNSIGNED),
    "$slt": (lt, _SIGNED),
    "$sle": (le, _SIGNED),
    "$sgt": (gt, _SIGNED),
    "$sge": (ge, _SIGNED),
}
_SHIFTS = {("$lsl", "$lsr"): "$rol", ("$lsr", "$lsl"): "$ror"}


def correct(modules: Modules) -> None:
    """Correct a netlist in place."""
    for module in modules.values():
        drivers = {net.number: gate for gate in module.instances for net in gate.outputs}
        made: list[Instance] = []
        for gate in module.instances:
            if gate.kind == "$or":
                _correct_rotation(gate, drivers)
            elif gate.kind in _COMPARISONS:
                made += filter(None, [_correct_comparison(gate, drivers)])
        module.instances += made


def doubts(modules: Modules) -> list[str]:
    """Warnings of constants whose bits GHDL may have mixed up.

    Where one branch assigns a constant to all of a signal and another assigns parts of it, GHDL 2.0 takes the parts of
    the constant from the wrong end. The gates are those of a constant that was assigned in parts.
    """
    found: dict[str, None] = {}
    for module in modules.values():
        drivers = {net.number: gate for gate in module.instances for net in gate.outputs}
        for gate in module.instances:
            if gate.kind.startswith("$concat"):
                found |= dict.fromkeys(_mixed(gate, drivers))
    return [
        f"{place}: warning: if one branch assigns a constant to all of a signal, and another assigns parts of it, GHDL "
        "mixes up the constant's bits; assign it in the same parts"
        for place in found
    ]


def _mixed(parts: Instance, drivers: Mapping[int, Instance]) -> Iterator[str]:
    """The places of selections that have different constants for several of these parts on one side."""
    constants: dict[tuple[str, int, int], list[str]] = defaultdict(list)
    for index in range(len(parts.inputs)):
        selection = _driver(parts, index, drivers)
        if selection and selection.kind == "$mux2":
            for side in (1, 2):
                source = _driver(selection, side, drivers)
                if source and (bits := constant(source)) is not None:
                    constants[selection.location, selection.input(0).number, side].append(bits)
    for (place, _, _), found in constants.items():
        if len(found) > 1 and len(set("".join(found))) > 1:
            yield place


def _driver(gate: Instance, index: int, drivers: Mapping[int, Instance]) -> Instance | None:
    net = gate.inputs[index]
    return drivers.get(net.number) if net else None


def _correct_rotation(gate: Instance, drivers: Mapping[int, Instance]) -> None:
    """`shift(value, places) | other_shift(value, width - places)`, all of one place in the VHDL."""
    one, other = (_driver(gate, index, drivers) for index in (0, 1))
    if one and other and one.location == other.location == gate.location:
        kind = _SHIFTS.get((one.kind, other.kind))
        rest = _driver(other, 1, drivers) if kind else None
        if kind and rest and rest.kind == "$sub" and rest.location == gate.location:
            gate.kind, gate.inputs = kind, list(one.inputs)


def _correct_comparison(gate: Instance, drivers: dict[int, Instance]) -> Instance | None:
    """Of a lengthened vector and a number: a comparison of the vector, with the new constant, or what it always is."""
    for index in (0, 1):
        number, lengthened = _driver(gate, index, drivers), _driver(gate, 1 - index, drivers)
        bits = constant(number) if number else None
        if bits and lengthened and lengthened.kind in _COMPARISONS[gate.kind][1] and not set(bits) - {"0", "1"}:
            vector = lengthened.input(0)
            is_signed = lengthened.kind == "$sextend"
            value = int(bits, 2) - (int(bits[0]) << len(bits) if is_signed else 0)
            low, high = (
                (-(1 << vector.width - 1), (1 << vector.width - 1) - 1) if is_signed else (0, (1 << vector.width) - 1)
            )
            if low <= value <= high:
                name = f"{gate.name}_number"
                net = Net(max(drivers) + 1, vector.width, f"{name}_o")
                parameter = str(value % (1 << vector.width))
                drivers[net.number] = Instance(name, "$const_UB32", gate.location, [parameter], outputs=[net])
                gate.inputs = [net, vector] if index == 0 else [vector, net]
                return drivers[net.number]
            # Any number that the vector can be is on the same side of this one.
            compared = (value, 0) if index == 0 else (0, value)
            gate.parameters = [str(int(_COMPARISONS[gate.kind][0](*compared)))]
            gate.kind, gate.inputs = "$const_UB32", []
            break
    return None
