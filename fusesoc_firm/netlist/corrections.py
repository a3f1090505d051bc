"""Correct those errors in GHDL 2.0's synthesis for which the netlist and the sources show the intended logic.

* A rotation by at least the vector's width results in zeros, because GHDL builds rotations from two shifts.
* If our functions (`sources.py`) extend a vector to compare it with a constant, the comparison is narrowed to the
  vector's width.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from itertools import count
from operator import eq, ge, gt, le, lt, ne

from fusesoc_firm.netlist.model import Instance, Modules, Net
from fusesoc_firm.netlist.verilog import constant

_SIGNED, _UNSIGNED = {"$sextend"}, {"$uextend"}
# The operator of each comparison, and the gates that may extend the vector before the comparison.
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
        numbers = count(module.first_unused())
        made: list[Instance] = []
        for gate in module.instances:
            if gate.kind == "$or":
                _correct_rotation(gate, drivers)
            elif gate.kind in _COMPARISONS:
                made += filter(None, [_correct_comparison(gate, drivers, numbers)])
        module.instances += made


def lost_latches(modules: Modules) -> list[str]:
    """Return a sentence for each signal that is X because a branch does not assign it; GHDL 2.0 reports only ports.

    An X that the VHDL assigns is another gate.
    """
    found = []
    for module in modules.values():
        unknown = {net.number for gate in module.instances if gate.kind == "$const_X" for net in gate.outputs}
        for gate in module.instances:
            if gate.kind == "$signal" and (net := gate.inputs[0]) and net.number in unknown:
                found.append(
                    f"{gate.location}: error: latch inferred for '{gate.name}': some branch does not assign it"
                )
    return found


def doubts(modules: Modules) -> list[str]:
    """Return warnings about constants whose bits GHDL may have read in the wrong order.

    If one branch assigns a constant to a whole signal and another branch assigns parts of the signal, GHDL 2.0 counts
    the constant's parts from the wrong end. The resulting gates cannot be distinguished from the gates for a constant
    that is assigned in parts.
    """
    found: dict[str, None] = {}
    for module in modules.values():
        drivers = {net.number: gate for gate in module.instances for net in gate.outputs}
        for gate in module.instances:
            if gate.kind.startswith("$concat"):
                found |= dict.fromkeys(_mixed(gate, drivers))
    return [
        f"{place}: warning: if one branch assigns a constant to a whole signal and another assigns parts of the "
        "signal, GHDL mixes up the constant's bits; assign the constant in the same parts"
        for place in found
    ]


def _mixed(parts: Instance, drivers: Mapping[int, Instance]) -> Iterator[str]:
    """Yield the places of selections in which several of these parts have different constants at the same input."""
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
    """Convert `shift(value, places) | other_shift(value, width - places)` from one place in the VHDL to a rotation."""
    one, other = (_driver(gate, index, drivers) for index in (0, 1))
    if one and other and one.location == other.location == gate.location:
        kind = _SHIFTS.get((one.kind, other.kind))
        rest = _driver(other, 1, drivers) if kind else None
        if kind and rest and rest.kind == "$sub" and rest.location == gate.location:
            gate.kind, gate.inputs = kind, list(one.inputs)


def _correct_comparison(gate: Instance, drivers: Mapping[int, Instance], numbers: Iterator[int]) -> Instance | None:
    """Compare the vector before its extension with a new constant, which is returned, or make the result constant.

    `numbers` are the numbers of new nets.
    """
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
                net = Net(next(numbers), vector.width, f"{name}_o")
                gate.inputs = [net, vector] if index == 0 else [vector, net]
                parameter = str(value % (1 << vector.width))
                return Instance(name, "$const_UB32", gate.location, [parameter], outputs=[net])
            # The number is greater than, or less than, all values of the vector.
            compared = (value, 0) if index == 0 else (0, value)
            gate.parameters = [str(int(_COMPARISONS[gate.kind][0](*compared)))]
            gate.kind, gate.inputs = "$const_UB32", []
            break
    return None
