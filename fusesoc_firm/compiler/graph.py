"""The graph of a compiled function: nodes with one result each, created once (common subexpressions are one node).

| operation | operands | result |
|---|---|---|
| constant | - | `payload`, the number |
| input | - | the bits of a port that `payload` names |
| state, carried, final | - | a register: of a state, of a value between the elements of a loop, and after the loop |
| add, subtract, multiply, divide, square_root | numbers of the result's kind | correctly rounded; saturated, if fixed |
| multiply_add, atan2, exp, log | floats of the result's kind | that of the operator's model |
| sincos | a float | a pair: its sine and its cosine, those of the operator's model |
| divmod | two integers | a pair: the quotient, rounded down, and the remainder; both 0 by zero |
| sine, cosine, quotient, remainder | the pair | one of its numbers |
| to_float, to_integer, resize | a number of another kind | the nearest number; towards zero, if `payload` tells so |
| less, at_most, equal | two numbers of one kind, or integers | a truth value |
| negate, absolute, copy_sign | floats | by bits |
| choose | condition, number if true, number if false | the number |
| mixed | for each kind that the number may have, a condition and a number | the number whose condition holds |
| and, or, xor, invert | integers or truth values | by bits |
| shift_left, shift_right | an integer; `payload` bits | the integer |
| wrap | an integer | the same, in another width |
| saturate | an integer | the nearest fixed-point number |
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fusesoc_firm.compiler.fixed import Format
from fusesoc_firm.compiler.kinds import BOOL, INT, MIXED, Kind, bits_of, kind_of, number_of, units_of

LEAVES = ("constant", "input", "state", "carried", "final")
"""The operations without operands."""


@dataclass(frozen=True)
class Place:
    """A line of the source, counted from 1, and its text."""

    line: int
    text: str


@dataclass(eq=False)
class Node:
    """A value: the result of an operation; `low` and `high` are the limits of an integer.

    The phase of a value is the time at which it is computed: 2n before loop n over a stream, 2n + 1 for each of the
    loop's elements. It is the latest phase of the operands. The name is that of the first variable with the value.
    """

    number: int
    operation: str
    operands: tuple[Node, ...]
    kind: Kind
    payload: Any = None
    low: int = 0
    high: int = 0
    place: Place | None = None
    phase: int = 0
    name: str = ""

    @property
    def bits(self) -> int:
        """The width in hardware; a weak integer has the width that its range needs."""
        if self.kind != INT:
            return self.kind.bits
        return max((self.low if self.low >= 0 else ~self.low).bit_length(), self.high.bit_length()) + 1

    @property
    def is_signed(self) -> bool:
        """Whether an integer is in two's complement."""
        return self.kind.is_signed

    @property
    def is_constant(self) -> bool:
        """Whether the value is known."""
        return self.operation == "constant"

    @property
    def alternatives(self) -> list[tuple[Node, Node]]:
        """The condition and the number of each kind that a mixed number may have; others have none."""
        is_mixed = self.kind == MIXED
        return [*zip(self.operands[::2], self.operands[1::2], strict=True)] if is_mixed else []

    @property
    def kinds(self) -> list[Kind]:
        """The kinds that the number may have."""
        return [item.kind for _, item in self.alternatives] or [self.kind]

    @property
    def code(self) -> int:
        """The bits of a constant."""
        return bits_of(self.kind, self.payload, self.bits)

    def __str__(self) -> str:
        parts = [f"n{item.number}" for item in self.operands]
        parts += [str(self.payload)] if self.payload is not None else []
        return f"n{self.number} = {self.operation}({', '.join(parts)}) : {self.kind} {self.bits}"


_FOLDED: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": np.divide,
    "square_root": np.sqrt,
    "less": operator.lt,
    "at_most": operator.le,
    "equal": operator.eq,
    "negate": operator.neg,
    "absolute": abs,
    # The sign of NaN is positive.
    "copy_sign": lambda value, sign: np.copysign(value, 1.0 if np.isnan(sign) else sign),
    "choose": lambda condition, one, other: one if condition else other,
    "and": operator.and_,
    "or": operator.or_,
    "xor": operator.xor,
}
_COMMUTATIVE = ("add", "multiply", "equal", "and", "or", "xor")


@dataclass
class Graph:
    """All nodes of a function in the order of their creation, so operands precede their users.

    With a `format`, the function computes with fixed-point numbers in place of floats.
    """

    format: Format | None = None
    nodes: list[Node] = field(default_factory=list)
    place: Place | None = None
    _known: dict[Any, Node] = field(default_factory=dict)

    def constant(self, value: Any) -> Node:
        """Return a constant."""
        kind = kind_of(value)
        low = high = 0 if kind.is_float else units_of(value)
        # Zeros of both signs and NaN are constants of their own.
        key = ("constant", kind, low, bits_of(kind, value, 64))
        return self._node(key, Node(len(self.nodes), "constant", (), kind, value, low, high))

    def leaf(
        self, operation: str, kind: Kind, payload: Any, limits: tuple[int, int] | None = None, phase: int = 0
    ) -> Node:
        """Return an input, a state, or a value of a loop."""
        low, high = limits or ((0, 0) if kind.is_float else kind.limits)
        made = Node(len(self.nodes), operation, (), kind, payload, low, high, phase=phase)
        return self._node((operation, payload, kind, low, high), made)

    def node(
        self,
        operation: str,
        operands: Iterable[Node],
        kind: Kind,
        payload: Any = None,
        limits: tuple[int, int] | None = None,
    ) -> Node:
        """Return the result of an operation, computed here if all operands are constants."""
        operands = tuple(operands)
        if operation in _FOLDED and all(item.is_constant for item in operands):
            with np.errstate(all="ignore"):
                value = _FOLDED[operation](*(item.payload for item in operands))
            return self.constant(number_of(kind, value))
        if operation in _COMMUTATIVE:
            operands = tuple(sorted(operands, key=lambda item: item.number))
        low, high = limits or ((0, 0) if kind.is_float else kind.limits)
        if kind != INT and not kind.is_float:
            low, high = _within(kind, low, high)
        key = (operation, *(item.number for item in operands), kind, payload)
        return self._node(key, Node(len(self.nodes), operation, operands, kind, payload, low, high))

    def true(self) -> Node:
        """Return the constant True."""
        return self.constant(True)

    def both(self, one: Node, other: Node) -> Node:
        """Return the conjunction of two truth values."""
        for item, rest in ((one, other), (other, one)):
            if item.is_constant:
                return rest if item.payload else item
        return one if one is other else self.node("and", (one, other), BOOL, limits=(0, 1))

    def either(self, one: Node, other: Node) -> Node:
        """Return the disjunction of two truth values."""
        for item, rest in ((one, other), (other, one)):
            if item.is_constant:
                return item if item.payload else rest
        return one if one is other else self.node("or", (one, other), BOOL, limits=(0, 1))

    def opposite(self, condition: Node) -> Node:
        """Return the negation of a truth value."""
        if condition.is_constant:
            return self.constant(not condition.payload)
        if condition.operation == "invert":
            return condition.operands[0]
        return self.node("invert", (condition,), BOOL, limits=(0, 1))

    def choose(self, condition: Node, one: Node, other: Node) -> Node:
        """Return `one` if the condition holds, else `other`; both have the same kind."""
        if condition.is_constant:
            return one if condition.payload else other
        if one is other:
            return one
        if condition.operation == "invert":
            return self.choose(condition.operands[0], other, one)
        if condition is one or condition is other:
            return self.either(one, other) if condition is one else self.both(one, other)
        if one.kind == BOOL and one.is_constant and other.is_constant:
            return condition if one.payload else self.opposite(condition)
        if one.kind == BOOL and (one.is_constant or other.is_constant):
            if one.is_constant:
                return self.either(condition, other) if one.payload else self.both(self.opposite(condition), other)
            return self.either(self.opposite(condition), one) if other.payload else self.both(condition, one)
        limits = min(one.low, other.low), max(one.high, other.high)
        return self.node("choose", (condition, one, other), one.kind, limits=limits)

    def _node(self, key: Any, made: Node) -> Node:
        """Return the node with a key, which is `made` if there is none yet."""
        if key not in self._known:
            made.phase = max((item.phase for item in made.operands), default=made.phase)
            made.place = self.place
            self._known[key] = made
            self.nodes.append(made)
        return self._known[key]


def _within(kind: Kind, low: int, high: int) -> tuple[int, int]:
    """Return the limits of an integer that wraps."""
    least, most = kind.limits
    return (low, high) if least <= low and high <= most else (least, most)


def printed(graph: Graph) -> str:
    """Return all nodes as text, a line each."""
    return "\n".join(f"{item}{f'  # line {item.place.line}' if item.place else ''}" for item in graph.nodes)
