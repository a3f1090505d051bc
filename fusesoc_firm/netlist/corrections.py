"""Corrects what GHDL 2.0 synthesises wrongly, as far as a netlist and its sources show what was meant.

* A rotation by as many places as there are bits, or by more, gives zeros: it is made of two shifts.
* A comparison with a number that the vector cannot hold is one with that number's lowest bits.
* `integer - signed` is `signed - integer`.
* `resize` of a signed number to fewer bits drops the sign, which numeric_std keeps.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from operator import eq, ge, gt, le, lt, ne

from fusesoc_firm.netlist.model import Instance, Modules
from fusesoc_firm.netlist.verilog import constant

_COMPARISONS: Mapping[str, Callable[[int, int], bool]] = {
    "$eq": eq,
    "$ne": ne,
    "$ult": lt,
    "$ule": le,
    "$ugt": gt,
    "$uge": ge,
    "$slt": lt,
    "$sle": le,
    "$sgt": gt,
    "$sge": ge,
}
_SHIFTS = {("$lsl", "$lsr"): "$rol", ("$lsr", "$lsl"): "$ror"}


def places_of(modules: Modules, kind: str) -> set[str]:
    """The places in the VHDL, `file:line:column`, of the gates of a kind."""
    return {gate.location for module in modules.values() for gate in module.instances if gate.kind == kind} - {""}


def correct(modules: Modules, swapped: Collection[str], resized: Collection[str]) -> None:
    """Correct a netlist in place.

    `swapped` are the places of each `integer - signed`, `resized` those of the calls of `resize`.
    """
    for module in modules.values():
        drivers = {net.number: gate for gate in module.instances for net in gate.outputs}
        for gate in module.instances:
            if gate.kind == "$or":
                _correct_rotation(gate, drivers)
            elif gate.kind in _COMPARISONS:
                _correct_comparison(gate, drivers)
            elif gate.kind == "$sub" and gate.location in swapped:
                gate.inputs.reverse()
            elif gate.kind == "$strunc" and gate.location in resized:
                gate.kind = "$sresize"


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


def _correct_comparison(gate: Instance, drivers: Mapping[int, Instance]) -> None:
    """A number that the other side cannot be decides at once."""
    for index in (0, 1):
        number, other = _driver(gate, index, drivers), gate.inputs[1 - index]
        if number and other and other.width and (value := _number(number)) is not None:
            is_signed = number.kind == "$const_SB32"
            low, high = (
                (-(1 << other.width - 1), (1 << other.width - 1) - 1) if is_signed else (0, (1 << other.width) - 1)
            )
            if not low <= value <= high:
                # Any number that the other side can be is on the same side of this one.
                compared = (value, 0) if index == 0 else (0, value)
                gate.parameters = [str(int(_COMPARISONS[gate.kind](*compared)))]
                gate.kind, gate.inputs = "$const_UB32", []
                return


def _number(gate: Instance) -> int | None:
    """The number that GHDL made a constant of, which may have more bits than that."""
    match gate.kind:
        case "$const_UB32":
            return gate.numbers[0]
        case "$const_SB32":
            return gate.numbers[0] - (gate.numbers[0] >> 31 << 32)
        case _:
            return None
