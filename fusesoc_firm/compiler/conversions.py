"""Numbers of one kind as numbers of another one, and the kind of a name that has several."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass

from fusesoc_firm.compiler.graph import Graph, Node
from fusesoc_firm.compiler.kinds import BOOL, FLOAT, INT, Kind, number_of, result_kind


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
    if value.is_constant:
        return graph.constant(number_of(kind, value.payload))
    if kind.is_float:
        if value.kind.is_float:
            return _resized(graph, value, kind)
        return graph.node("to_float", (value,), kind)
    if kind == BOOL:
        raise UnmergeableError(f"a {value.kind} and a truth value")
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


def common_kind(one: Kind, other: Kind) -> Kind:
    """Return the kind of a name that has one kind on one path, and another one on another path.

    Raise `UnmergeableError` for two types of NumPy: operations on the name would have the type of its path in Python.
    """
    if one != other and not (one.is_weak or other.is_weak):
        raise UnmergeableError(f"a {one} and a {other}")
    return kind_of_both(one, other)


def kind_of_both(one: Kind, other: Kind) -> Kind:
    """Return the kind that holds the numbers of two kinds, as that of an operation on both."""
    if one == other:
        return one
    if BOOL in (one, other):
        raise UnmergeableError(f"a {one} and a {other}")
    return result_kind(operator.add, one, other)


def merged(graph: Graph, value: Node, kind: Kind) -> Node:
    """Return the number that one path leaves, in the kind that a name has after both.

    Raise `UnmergeableError` if this changes it: Python keeps its own floats and integers as they are.
    """
    check_exact(value, kind)
    return converted(graph, value, kind)


def check_exact(value: Node, kind: Kind) -> None:
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


def widened(first: Node, after: Node, known: Range | None) -> Range:
    """Return the range of a number that is `first`, and is replaced by `after` again and again.

    `known` is what was expected. Raise `UnmergeableError` if there is no common kind.
    """
    kind = common_kind(first.kind, after.kind)
    for value in (first, after):
        check_exact(value, kind)
    if kind.is_float:
        return Range(kind, (0, 0))
    if kind.format:
        return Range(kind, kind.limits)
    limits = min(first.low, after.low), max(first.high, after.high)
    # A number that grows beyond expectation may grow each time.
    return Range(kind, kind.limits if known and limits != known.limits else limits)
