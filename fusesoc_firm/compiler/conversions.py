"""Numbers of one kind as numbers of another one, and the kind of a name that has several."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain

from fusesoc_firm.compiler.graph import Graph, Node
from fusesoc_firm.compiler.kinds import BOOL, FLOAT, INT, MIXED, Kind, number_of


class UnmergeableError(Exception):
    """Two paths leave values that no hardware can hold in one place."""


@dataclass(frozen=True)
class Range:
    """The kind of a number that changes again and again, and the limits of an integer."""

    kind: Kind
    limits: tuple[int, int]


def converted(graph: Graph, value: Node, kind: Kind) -> Node:
    """Return a number converted to another kind, as an operation with this kind converts its operands."""
    if value.kind == kind:
        return value
    if value.kind == MIXED:
        return of_each(graph, value, lambda item: converted(graph, item, kind))
    if value.is_constant:
        return graph.constant(number_of(kind, value.payload))
    if kind.is_float:
        if value.kind.is_float:
            return _resized(graph, value, kind)
        return graph.node("to_float", (value,), kind)
    if kind.format:
        return _fixed(graph, value, kind)
    limits = (value.low, value.high)
    return graph.node("wrap", (value,), kind, limits=limits)


def _resized(graph: Graph, value: Node, kind: Kind) -> Node:
    """Return a float of another kind; Python's float has the bits of a float64."""
    return graph.node("rename" if value.kind.bits == kind.bits else "resize", (value,), kind)


def _fixed(graph: Graph, value: Node, kind: Kind) -> Node:
    """Return a float or an integer as a fixed-point number."""
    if value.kind.is_float:
        return graph.node("to_integer", (value,), kind, "nearest")
    return saturated(graph, shifted(graph, integer_of(graph, value), kind.fraction), kind)


def integer_of(graph: Graph, value: Node) -> Node:
    """Return an integer, a truth value or the units of a fixed-point number as an integer of Python."""
    if value.kind == MIXED:
        return of_each(graph, value, lambda item: integer_of(graph, item))
    if value.is_constant:
        return graph.constant(value.low)
    if value.kind == INT:
        return value
    return graph.node("wrap", (value,), INT, limits=(value.low, value.high))


def shifted(graph: Graph, value: Node, count: int) -> Node:
    """Return an integer of Python times 2**count."""
    if value.is_constant or not count:
        return graph.constant(value.low << count) if value.is_constant else value
    return graph.node("shift_left", (value,), INT, count, (value.low << count, value.high << count))


def saturated(graph: Graph, units: Node, kind: Kind) -> Node:
    """Return the fixed-point number with some units, or the nearest one."""
    if units.is_constant:
        assert kind.format
        return graph.constant(kind.format.of_units(units.low))
    least, most = kind.limits
    limits = min(max(units.low, least), most), min(max(units.high, least), most)
    operation = "wrap" if limits == (units.low, units.high) else "saturate"
    return graph.node(operation, (units,), kind, limits=limits)


def chosen(graph: Graph, condition: Node, one: Node, other: Node) -> Node:
    """Return the number that two paths leave in one place: a mixed one, if no kind has the numbers of both."""
    if condition.is_constant:
        return one if condition.payload else other
    try:
        kind = _common_kind(one, other)
    except UnmergeableError:
        return _mixed(graph, condition, one, other)
    return graph.choose(condition, converted(graph, one, kind), converted(graph, other, kind))


def _mixed(graph: Graph, condition: Node, one: Node, other: Node) -> Node:
    """Return the number that one of two paths leaves, with a condition for each kind that it may have."""
    pair = [
        {item.kind: (when, item) for when, item in value.alternatives or [(graph.true(), value)]}
        for value in (one, other)
    ]
    found: dict[Kind, tuple[Node, Node]] = {}
    for kind in sorted({*pair[0], *pair[1]}, key=str):
        conditions = [side[kind][0] if kind in side else graph.constant(value=False) for side in pair]
        numbers = [side[kind][1] for side in pair if kind in side]
        number = graph.choose(condition, *numbers) if len(numbers) > 1 else numbers[0]
        found[kind] = graph.choose(condition, *conditions), number
    return graph.node("mixed", chain(*found.values()), MIXED, limits=(0, 0))


def of_each(graph: Graph, value: Node, operation: Callable[[Node], Node]) -> Node:
    """Return the result of an operation on each of the numbers that a mixed one may be."""
    *others, (_, last) = value.alternatives
    result = operation(last)
    for when, item in reversed(others):
        result = chosen(graph, when, operation(item), result)
    return result


def _common_kind(*values: Node) -> Kind:
    """Return the kind of a place that has several numbers: a number of Python adopts a type of NumPy.

    Raise `UnmergeableError` if the numbers are not the same in this kind, or have two types of NumPy: operations on
    them have the type of each number in Python.
    """
    items = [item for value in values for _, item in value.alternatives or [(value, value)]]
    kinds = dict.fromkeys(item.kind for item in items)
    strong = [kind for kind in kinds if not kind.is_weak]
    if len(strong) > 1 or (BOOL in kinds and len(kinds) > 1):
        raise UnmergeableError(" and ".join(f"a {kind}" for kind in kinds))
    kind = strong[0] if strong else FLOAT if FLOAT in kinds else INT
    for item in items:
        _check_exact(item, kind)
    return kind


def _check_exact(value: Node, kind: Kind) -> None:
    """Raise `UnmergeableError` if a number of Python is not the same number in a type of NumPy."""
    if not value.kind.is_weak or value.kind == kind or kind.is_weak or kind.format:
        return
    if value.is_constant:
        # Compared as numbers of Python, since NumPy would convert the other one first.
        same = number_of(kind, value.payload).item()
        if same == value.payload or math.isnan(same):
            return
        raise UnmergeableError(f"{value.payload}, which is not an exact {kind}, and a {kind}")
    if value.kind.is_float or kind.is_float:
        if kind.bits == FLOAT.bits:
            return
    elif kind.limits[0] <= value.low and value.high <= kind.limits[1]:
        return
    raise UnmergeableError(f"a {value.kind} of Python and a {kind}")


def widened(graph: Graph, first: Node, after: Node, known: Range | None) -> Range:
    """Return the range of a number that is `first`, and is replaced by `after` again and again.

    `known` is what was expected. Raise `UnmergeableError` if there is no common kind.
    """
    kind = _common_kind(first, after)
    first, after = converted(graph, first, kind), converted(graph, after, kind)
    if kind.is_float:
        return Range(kind, (0, 0))
    if kind.format:
        return Range(kind, kind.limits)
    limits = min(first.low, after.low), max(first.high, after.high)
    # A number that grows beyond expectation may grow each time.
    return Range(kind, kind.limits if known and limits != known.limits else limits)
