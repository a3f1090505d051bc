"""Operators and functions of Python on numbers, as operations of the graph.

Every result has the bits that Python and NumPy compute for the same types. Identities are used only if they are exact:
a division by a power of two is a product, but `a + b + c` keeps its order.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from fusesoc_firm.compiler.conversions import (
    chosen,
    converted,
    integer_of,
    of_each,
    saturated,
    shifted,
)
from fusesoc_firm.compiler.fixed import FixedNumber, Format
from fusesoc_firm.compiler.graph import Graph, Node
from fusesoc_firm.compiler.kinds import (
    BOOL,
    FLOAT,
    FLOAT32,
    FLOAT64,
    INT,
    INTEGERS,
    MIXED,
    Kind,
    fixed_kind,
    floor_number,
    integer_pair,
    number_of,
    pair_of,
    result_kind,
    whole_number,
)
from fusesoc_firm.compiler.models import modelled

_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
_NAMES = {ast.Add: "add", ast.Sub: "subtract", ast.Mult: "multiply", ast.Div: "divide"}
_BITWISE = {ast.BitAnd: "and", ast.BitOr: "or", ast.BitXor: "xor"}
# The largest constant exponent; each further one is a product more.
_MOST_POWER = 16
# The most bits of an integer in hardware.
_MOST_BITS = 64


class RefusalError(Exception):
    """An operation that is not hardware, without its place; `hint` is the remedy."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


@dataclass(frozen=True)
class Arithmetic:
    """The operations on numbers of a graph; each method returns its result, and may raise `RefusalError`."""

    graph: Graph

    def binary(self, kind: type[ast.operator], one: Node, other: Node) -> Node:
        """Return `one <operator> other`."""
        if kind not in _OPERATORS:
            raise RefusalError("'@' is not hardware", "write the sums of products, in loops over 'range'")
        if MIXED in (one.kind, other.kind):
            return self._of_mixed(partial(self.binary, kind), one, other, self._kinds(_OPERATORS[kind], one, other))
        if kind is ast.Pow:
            return self._power(one, other)
        if one.is_constant and other.is_constant:
            return self._folded(kind, one, other)
        if kind in (ast.LShift, ast.RShift):
            return self._shift(kind, one, other)
        if kind in _BITWISE:
            return self._bitwise(_BITWISE[kind], one, other, self._result(_OPERATORS[kind], one, other))
        if BOOL in (one.kind, other.kind) and (one.kind == other.kind or kind in (ast.FloorDiv, ast.Mod)):
            raise RefusalError("a truth value is not a number here", "convert it with int()")
        result = self._result(_OPERATORS[kind], one, other)
        if kind in (ast.FloorDiv, ast.Mod):
            return self._quotient(kind, one, other, result)
        if self.graph.format and result.is_float and not one.kind.is_float and not other.kind.is_float:
            raise RefusalError("a quotient of integers is not a fixed-point number", "convert one of them with float()")
        compute = self._fixed if result.format else self._float if result.is_float else self._integer
        return compute(_NAMES[kind], self._to(one, result), self._to(other, result), result)

    def each(self, operation: Callable[..., Node], *operands: Node) -> Node:
        """Return the result of an operation for each kind of its operands; that of the path is chosen."""
        mixed = next((item for item in operands if item.kind == MIXED), None)
        if mixed is None:
            return operation(*operands)

        def of_one(alternative: Node) -> Node:
            return self.each(operation, *(alternative if item is mixed else item for item in operands))

        return of_each(self.graph, mixed, of_one)

    def _of_mixed(self, operation: Callable[[Node, Node], Node], one: Node, other: Node, kinds: set[Kind]) -> Node:
        """Return the result of an operation that computes in one of `kinds`, as the path decides.

        If there is only one, the operation is computed once. Truth values may be refused.
        """
        if len(kinds) > 1 or self.graph.format or BOOL in (*one.kinds, *other.kinds):
            return self.each(operation, one, other)
        convert = partial(self._to, kind=min(kinds, key=str))
        return operation(self.each(convert, one), self.each(convert, other))

    def _kinds(self, operation: Callable[..., Any], *operands: Node) -> set[Kind]:
        """Return the kinds that a result may have, as NumPy has it."""
        return {self._result_kind(operation, kinds) for kinds in product(*(item.kinds for item in operands))}

    def _folded(self, kind: type[ast.operator], one: Node, other: Node) -> Node:
        try:
            with np.errstate(all="ignore"):
                value = _OPERATORS[kind](one.payload, other.payload)
        except (ArithmeticError, TypeError, ValueError, KeyError) as error:
            raise RefusalError(f"the constant cannot be computed: {error}") from None
        if isinstance(value, int) and value.bit_length() >= _MOST_BITS and not isinstance(value, bool):
            raise RefusalError(f"{value} has more than {_MOST_BITS} bits", "use a float")
        if isinstance(value, complex):
            raise RefusalError("a complex number is not hardware", "use two floats")
        return self.literal(value)

    def _result(self, operation: Callable[..., Any], *operands: Node) -> Kind:
        """Return the kind of a result, as NumPy has it."""
        return self._result_kind(operation, [item.kind for item in operands])

    def _result_kind(self, operation: Callable[..., Any], kinds: Sequence[Kind]) -> Kind:
        try:
            return result_kind(operation, *kinds)
        except TypeError:
            names = " and ".join(f"a {kind}" for kind in kinds)
            raise RefusalError(f"there is no such operation on {names}", "convert with int() or float()") from None

    def _to(self, value: Node, kind: Kind) -> Node:
        """Return an operand in the kind of its operation."""
        if value.is_constant and kind.format and not value.kind.format and not kind.format.holds(value.payload):
            raise RefusalError(*_out_of_range(value.payload, kind.format))
        if value.is_constant and value.kind == INT and kind in INTEGERS.values():
            low, high = kind.limits
            if not low <= value.payload <= high:
                raise RefusalError(
                    f"{value.payload} is out of the range of {kind}, {low} to {high}", "NumPy refuses it, too"
                )
        if value.kind == BOOL and not value.is_constant and kind != BOOL:
            return converted(self.graph, integer_of(self.graph, value), kind)
        return converted(self.graph, value, kind)

    def to(self, value: Node, kind: Kind) -> Node:
        """Return a number in another kind, as `numpy.KIND(value)` converts it."""
        if kind == BOOL:
            return self.truth(value)
        if value.kind.is_real and not kind.is_real:
            return self._to(self.truncated(value), kind)
        return self._to(value, kind)

    def literal(self, value: Any) -> Node:
        """Return a number of the source: if the function computes with fixed-point numbers, a float is one."""
        format_ = self.graph.format
        if format_ is None or not isinstance(value, float | np.floating):
            return self.graph.constant(value)
        if not format_.holds(value):
            raise RefusalError(*_out_of_range(value, format_))
        return self.graph.constant(format_.number(value))

    def own(self, value: Node) -> Node:
        """Return the result of a function as a number of the source: if it computes with those, a fixed-point one."""
        if self.graph.format is None or not value.kind.is_float:
            return value
        return self._to(value, fixed_kind(self.graph.format))

    def real_to(self, value: Node, kind: Kind) -> Node:
        """Return a number in a kind of floats, or as the fixed-point number that takes their place."""
        return self.to(value, fixed_kind(self.graph.format) if self.graph.format else kind)

    def _float(self, name: str, one: Node, other: Node, kind: Kind) -> Node:
        if name == "subtract":
            # The sum with the negated number has the same bits.
            return self._float("add", one, self.negative(other), kind)
        if name == "divide" and other.is_constant and (inverse := _exact_inverse(kind, other.payload)) is not None:
            name, other = "multiply", self.graph.constant(inverse)
        if name == "multiply":
            for item, rest in ((one, other), (other, one)):
                if item.is_constant and abs(item.payload) == 1:
                    return rest if item.payload == 1 else self.negative(rest)
        return self.graph.node(name, (one, other), kind)

    def _fixed(self, name: str, one: Node, other: Node, kind: Kind) -> Node:
        """Return the sum, the difference, the product or the quotient of fixed-point numbers."""
        if name in ("add", "subtract"):
            units = self._integer(name, integer_of(self.graph, one), integer_of(self.graph, other), INT)
            return saturated(self.graph, units, kind)
        if name == "divide" and other.is_constant and (inverse := _exact_fixed_inverse(other.payload)) is not None:
            name, other = "multiply", self.graph.constant(inverse)
        for item, rest in ((one, other), (other, one)) if name == "multiply" else ():
            if item.is_constant and abs(item.low) == 1 << kind.fraction:
                return rest if item.low > 0 else self.negative(rest)
            places = _power_of_two(item.low) if item.is_constant else None
            if places is not None and places >= kind.fraction:
                return saturated(
                    self.graph, shifted(self.graph, integer_of(self.graph, rest), places - kind.fraction), kind
                )
        return self.graph.node(name, (one, other), kind)

    def _integer(self, name: str, one: Node, other: Node, kind: Kind) -> Node:
        corners = [_EXACT[name](a, b) for a in (one.low, one.high) for b in (other.low, other.high)]
        low, high = min(corners), max(corners)
        if kind == INT:
            low, high = self._limited(low, high)
        if name == "multiply":
            for item, rest in ((one, other), (other, one)):
                if item.is_constant and (shift := _power_of_two(int(item.payload))) is not None:
                    return self.graph.node("shift_left", (rest,), kind, shift, (low, high)) if shift else rest
        if name == "add" and one.is_constant and one.payload == 0:
            return other
        if name in ("add", "subtract") and other.is_constant and other.payload == 0:
            return one
        return self.graph.node(name, (one, other), kind, limits=(low, high))

    def _limited(self, low: int, high: int) -> tuple[int, int]:
        """Return the limits of an integer of Python, which wraps beyond 64 bits in hardware."""
        return (low, high) if INT.limits[0] <= low and high <= INT.limits[1] else INT.limits

    def _bitwise(self, name: str, one: Node, other: Node, kind: Kind) -> Node:
        if kind.is_float:
            raise RefusalError("there are no bit operations on floats", "convert with int()")
        if kind == BOOL:
            whole = {"and": self.graph.both, "or": self.graph.either}.get(name)
            return whole(one, other) if whole else self.graph.node(name, (one, other), BOOL, limits=(0, 1))
        one, other = self._to(one, kind), self._to(other, kind)
        limits = None
        if kind == INT:
            bits = max(one.bits, other.bits) - 1
            has_sign = one.low < 0 or other.low < 0
            limits = (-(1 << bits) if has_sign else 0, (1 << bits) - 1)
        return self.graph.node(name, (one, other), kind, limits=limits)

    def _shift(self, kind: type[ast.operator], one: Node, other: Node) -> Node:
        if not other.is_constant:
            raise RefusalError("the number of bits of a shift must be a constant", "use a loop over 'range' with 'if'")
        result, count = self._result(_OPERATORS[kind], one, other), int(other.payload)
        if result.is_real or result == BOOL or count < 0:
            raise RefusalError("only integers are shifted, by 0 bits or more", "convert with int()")
        value = self._to(one, result)
        if kind is ast.LShift:
            low, high = value.low << count, value.high << count
            limits = self._limited(low, high) if result == INT else (low, high)
            return self.graph.node("shift_left", (value,), result, count, limits) if count else value
        return self.graph.node("shift_right", (value,), result, count, (value.low >> count, value.high >> count))

    def _quotient(self, kind: type[ast.operator], one: Node, other: Node, result: Kind) -> Node:
        """Return the quotient, rounded down, or the remainder of integers."""
        if result.is_float:
            form = "math.floor(a / b)" if kind is ast.FloorDiv else "a - math.floor(a / b) * b"
            raise RefusalError("'//' and '%' of floats are not hardware", f"write {form}")
        if other.is_constant and not other.payload:
            raise RefusalError("a division by zero", "divide by another number")
        shift = _power_of_two(int(other.payload)) if other.is_constant else None
        if shift is None:
            return self._divided(kind, self._to(one, result), self._to(other, result), result)
        value = self._to(one, result)
        if kind is ast.FloorDiv:
            limits = value.low >> shift, value.high >> shift
            return self.graph.node("shift_right", (value,), result, shift, limits)
        mask = self._to(self.graph.constant((1 << shift) - 1), result)
        return self.graph.node("and", (value, mask), result, limits=(0, (1 << shift) - 1))

    def _divided(self, kind: type[ast.operator], one: Node, other: Node, result: Kind) -> Node:
        """Return one of the results of the operator that divides; both are 0 by zero."""
        pair = integer_pair(max(item.bits + (not item.is_signed) for item in (one, other)))
        both = self.graph.node("divmod", (one, other), pair)
        most = (1 << pair.bits // 2 - 1) - 1
        if kind is ast.FloorDiv:
            found = self.graph.node("quotient", (both,), INT, limits=(~most, most))
            largest = max(abs(one.low), abs(one.high))
            limits = 0 if one.low >= 0 and other.low >= 0 else -largest, largest
        else:
            found = self.graph.node("remainder", (both,), INT, limits=(~most, most))
            limits = min(other.low + 1, 0), max(other.high - 1, 0)
        return self.graph.node("wrap", (found,), result, limits=self._limited(*limits))

    def _power(self, one: Node, other: Node) -> Node:
        """Return a power with a constant exponent: products from the left, a square root, a quotient."""
        if not other.is_constant:
            raise RefusalError("the exponent of '**' must be a constant", "write the product, or math.sqrt")
        exponent = float(other.payload) if other.kind.is_real else other.payload
        if exponent == 0.5:
            return self.own(self.square_root(one))
        if one.is_constant and exponent != int(exponent):
            return self._folded(ast.Pow, one, other)
        if exponent != int(exponent) or abs(exponent) > (_MOST_BITS if one.is_constant else _MOST_POWER):
            raise RefusalError(
                f"'** {exponent}' is not hardware", f"legal exponents: -{_MOST_POWER} to {_MOST_POWER}, and 0.5"
            )
        if exponent < 0:
            if self.graph.format and not one.kind.is_real:
                raise RefusalError("a quotient of integers is not a fixed-point number", "convert it with float()")
            inverse = self._power(one, self.graph.constant(-int(exponent)))
            return self.binary(ast.Div, self.literal(1.0), inverse)
        # As for the product with a float exponent.
        base = one if isinstance(exponent, int) else self._to(one, self._result(operator.mul, one, other))
        result = base if exponent else self._to(self.graph.constant(1), base.kind)
        for _ in range(int(exponent) - 1):
            result = self.binary(ast.Mult, result, base)
        return result

    def negative(self, value: Node) -> Node:
        """Return `-value`."""
        if value.kind == BOOL:
            raise RefusalError("a truth value has no negative", "use 'not', or convert it with int()")
        if not value.kind.is_float:
            zero = self._to(self.graph.constant(0), value.kind)
            subtract = self._fixed if value.kind.format else self._integer
            return subtract("subtract", zero, value, value.kind)
        if value.operation == "negate":
            return value.operands[0]
        return self.graph.node("negate", (value,), value.kind)

    def inverted(self, value: Node) -> Node:
        """Return `~value`."""
        if value.kind == BOOL or value.kind.is_real:
            raise RefusalError(f"'~' of a {value.kind} is not hardware", "use 'not' for truth values")
        if value.is_constant:
            return self.graph.constant(~value.payload)
        return self.graph.node("invert", (value,), value.kind, limits=(~value.high, ~value.low))

    def compare(self, kind: type[ast.cmpop], one: Node, other: Node) -> Node:
        """Return the truth value of a comparison."""
        if MIXED in (one.kind, other.kind):
            return self._of_mixed(partial(self.compare, kind), one, other, self._compared_kinds(one, other))
        match kind:
            case ast.Gt:
                return self._less(other, one)
            case ast.Lt:
                return self._less(one, other)
            case ast.LtE:
                return self._not_above(one, other)
            case ast.GtE:
                return self._not_above(other, one)
            case ast.Eq:
                return self._equal(one, other)
            case ast.NotEq:
                return self.graph.opposite(self._equal(one, other))
        raise RefusalError(
            f"'{ {ast.In: 'in', ast.NotIn: 'not in'}.get(kind, 'is') }' is not hardware", "compare with '=='"
        )

    def _compared_kinds(self, one: Node, other: Node) -> set[Kind]:
        """Return the kinds in which mixed numbers are compared: integers are compared by their values."""
        is_real = any(kind.is_real for kind in (*one.kinds, *other.kinds))
        return self._kinds(operator.add, one, other) if is_real else {INT}

    def _less(self, one: Node, other: Node) -> Node:
        pair = self._comparable(one, other)
        if not pair[0].kind.is_float and (pair[0].high < pair[1].low or pair[0].low >= pair[1].high):
            return self.graph.constant(pair[0].high < pair[1].low)
        return self.graph.node("less", pair, BOOL, limits=(0, 1))

    def _equal(self, one: Node, other: Node) -> Node:
        pair = self._comparable(one, other)
        if not pair[0].kind.is_float and (pair[0].high < pair[1].low or pair[1].high < pair[0].low):
            return self.graph.constant(value=False)
        return self.graph.node("equal", pair, BOOL, limits=(0, 1))

    def _not_above(self, one: Node, other: Node) -> Node:
        if one.kind.is_float or other.kind.is_float:
            # Not the opposite of a comparison: neither holds for NaN.
            return self.graph.node("at_most", self._comparable(one, other), BOOL, limits=(0, 1))
        return self.graph.opposite(self._less(other, one))

    def _comparable(self, one: Node, other: Node) -> tuple[Node, Node]:
        """Return the operands of a comparison; integers are compared by their values, whatever their kinds."""
        if one.kind.is_float or other.kind.is_float:
            kind = self._result(operator.add, one, other)
            return self._to(one, kind), self._to(other, kind)
        if one.kind.format or other.kind.format:
            kind = one.kind if one.kind.format else other.kind
            return self._to(one, kind), self._to(other, kind)
        one, other = (integer_of(self.graph, item) if item.kind == BOOL else item for item in (one, other))
        return one, other

    def truth(self, value: Node) -> Node:
        """Return `bool(value)`."""
        if value.kind == BOOL:
            return value
        zero = self.graph.constant(number_of(value.kind, 0))
        return self.graph.opposite(self._equal(value, zero))

    def choose(self, condition: Node, one: Node, other: Node) -> Node:
        """Return one of two numbers."""
        return chosen(self.graph, condition, one, other)

    def largest(self, one: Node, other: Node) -> Node:
        """Return Python's `max(one, other)`: the first operand unless the other one is greater."""
        return self.choose(self.compare(ast.Lt, one, other), other, one)

    def smallest(self, one: Node, other: Node) -> Node:
        """Return Python's `min(one, other)`: the first operand unless the other one is less."""
        return self.choose(self.compare(ast.Lt, other, one), other, one)

    def absolute(self, value: Node) -> Node:
        """Return `abs(value)`."""
        if value.kind.is_float:
            return self.graph.node("absolute", (value,), value.kind)
        if value.kind == BOOL or value.low >= 0:
            return value
        return self.choose(self._less(value, self.graph.constant(0)), self.negative(value), value)

    def real(self, value: Node) -> Node:
        """Return the operand of a function of `math`: a float32 remains one, every other number is a float64.

        A fixed-point number becomes a float that holds it.
        """
        if value.kind in (FLOAT32, FLOAT64, FLOAT):
            return value
        if value.kind.format:
            return self._to(value, FLOAT32 if value.kind.format.float_bits == 32 else FLOAT64)
        return self._to(value, FLOAT)

    def of_numpy(self, value: Node) -> Node:
        """Return the operand of a function of NumPy: a float32 remains one, every other number is NumPy's float64."""
        return value if value.kind == FLOAT32 else self._to(self.real(value), FLOAT64)

    def square_root(self, value: Node) -> Node:
        """Return the square root; NaN for negative numbers, as in NumPy."""
        operand = self.real(value)
        return self.graph.node("square_root", (operand,), operand.kind)

    def copied_sign(self, value: Node, sign: Node) -> Node:
        """Return `math.copysign(value, sign)`."""
        one, other = self.real(value), self.real(sign)
        kind = self._result(operator.add, one, other)
        return self.graph.node("copy_sign", (self._to(one, kind), self._to(other, kind)), kind)

    def function(self, name: str, *values: Node) -> Node:
        """Return a function that has a model, such as `atan2`."""
        operands = [self.real(value) for value in values]
        kind = operands[0].kind
        for item in operands[1:]:
            kind = result_kind(operator.add, kind, item.kind)
        operands = [self._to(item, kind) for item in operands]
        if all(item.is_constant for item in operands):
            return self.graph.constant(number_of(kind, modelled(name, kind.bits, *(item.payload for item in operands))))
        return self.graph.node(name, operands, kind)

    def sine(self, value: Node) -> Node:
        """Return `math.sin(value)`."""
        return self._of_angle("sin", "sine", value)

    def cosine(self, value: Node) -> Node:
        """Return `math.cos(value)`."""
        return self._of_angle("cos", "cosine", value)

    def tangent(self, value: Node) -> Node:
        """Return `math.tan(value)`, as the quotient of sine and cosine."""
        return self.binary(ast.Div, self.sine(value), self.cosine(value))

    def _of_angle(self, name: str, part: str, value: Node) -> Node:
        """Return one of the results of the operator for both."""
        angle = self.real(value)
        if angle.is_constant:
            return self.graph.constant(number_of(angle.kind, modelled(name, angle.kind.bits, angle.payload)))
        both = self.graph.node("sincos", (angle,), pair_of(angle.kind))
        return self.graph.node(part, (both,), angle.kind)

    def angle(self, value: Node) -> Node:
        """Return `math.atan(value)`."""
        return self.function("atan2", value, self.graph.constant(1.0))

    def arc_sine(self, value: Node) -> Node:
        """Return `math.asin(value)`, as the angle of a vector."""
        number = self.real(value)
        return self.function("atan2", number, self._other_leg(number))

    def arc_cosine(self, value: Node) -> Node:
        """Return `math.acos(value)`, as the angle of a vector."""
        number = self.real(value)
        return self.function("atan2", self._other_leg(number), number)

    def _other_leg(self, value: Node) -> Node:
        """Return the square root of (1 - value) * (1 + value)."""
        one = self.graph.constant(1.0)
        product = self.binary(ast.Mult, self.binary(ast.Sub, one, value), self.binary(ast.Add, one, value))
        return self.square_root(product)

    def truncated(self, value: Node) -> Node:
        """Return `int(value)`; beyond 64 bits, hardware has the nearest integer of 64 bits, and 0 for NaN."""
        if value.kind.format:
            magnitude = self._whole_part(self.absolute(integer_of(self.graph, value)), value.kind.fraction)
            return self.choose(self._less(value, self.graph.constant(0)), self.negative(magnitude), magnitude)
        if not value.kind.is_float:
            return self._to(value, INT)
        return self._to_integer(value, "truncate", math.trunc)

    def _whole_part(self, units: Node, places: int) -> Node:
        """Return units divided by 2**places, rounded down."""
        if units.is_constant or not places:
            return self.graph.constant(units.low >> places) if units.is_constant else units
        return self.graph.node("shift_right", (units,), INT, places, (units.low >> places, units.high >> places))

    def rounded(self, value: Node) -> Node:
        """Return `round(value)`, ties to even."""
        if value.kind.format:
            return self._nearest(integer_of(self.graph, value), value.kind.fraction)
        if not value.kind.is_float:
            return value
        return self._to_integer(value, "nearest", round)

    def _nearest(self, units: Node, places: int) -> Node:
        """Return units divided by 2**places, rounded to nearest, ties to even."""
        if not places:
            return units
        # A bit less than a half is added, and the lowest bit of the quotient.
        odd = self.binary(ast.BitAnd, self._whole_part(units, places), self.graph.constant(1))
        half = self.binary(ast.Add, odd, self.graph.constant((1 << places - 1) - 1))
        return self._whole_part(self.binary(ast.Add, units, half), places)

    def floor(self, value: Node) -> Node:
        """Return `math.floor(value)`."""
        if value.kind.format:
            return self._whole_part(integer_of(self.graph, value), value.kind.fraction)
        if not value.kind.is_float:
            return self._to(value, INT)
        if value.is_constant:
            return self.graph.constant(floor_number(value.payload))
        whole = self.truncated(value)
        is_above = self._less(value, self.graph.node("to_float", (whole,), value.kind))
        return self._integer("subtract", whole, self._to(is_above, INT), INT)

    def ceiling(self, value: Node) -> Node:
        """Return `math.ceil(value)`."""
        if value.kind.format:
            return self.negative(self._whole_part(self.negative(integer_of(self.graph, value)), value.kind.fraction))
        return self.negative(self.floor(self.negative(value)))

    def _to_integer(self, value: Node, rounding: str, folded: Callable[[Any], int]) -> Node:
        if value.is_constant:
            return self.graph.constant(whole_number(value.payload, folded))
        return self.graph.node("to_integer", (value,), INT, rounding, INT.limits)

    def is_nan(self, value: Node) -> Node:
        """Return `math.isnan(value)`."""
        return (
            self.graph.opposite(self._equal(value, value)) if value.kind.is_float else self.graph.constant(value=False)
        )

    def is_finite(self, value: Node) -> Node:
        """Return `math.isfinite(value)`."""
        if not value.kind.is_float:
            return self.graph.true()
        return self._less(self.absolute(value), self.graph.constant(number_of(value.kind, math.inf)))

    def is_infinite(self, value: Node) -> Node:
        """Return `math.isinf(value)`."""
        if not value.kind.is_float:
            return self.graph.constant(value=False)
        return self._equal(self.absolute(value), self.graph.constant(number_of(value.kind, math.inf)))

    def length(self, *values: Node) -> Node:
        """Return `math.hypot(x, y)` as the square root of the sum of squares."""
        squares = [self.binary(ast.Mult, item, item) for item in map(self.real, values)]
        total = squares[0]
        for item in squares[1:]:
            total = self.binary(ast.Add, total, item)
        return self.square_root(total)


_EXACT: Mapping[str, Callable[[int, int], int]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
}


def _power_of_two(value: int) -> int | None:
    """Return the exponent of a positive power of two."""
    return value.bit_length() - 1 if value > 0 and value & (value - 1) == 0 else None


def _out_of_range(value: Any, format_: Format) -> tuple[str, str]:
    """Return the message and the remedy for a number that fixed-point numbers do not hold."""
    least, most = (FixedNumber(format_, units) for units in format_.limits)
    return f"{value} is out of the range of {format_}, {least} to {most}", "use more bits, or fewer of them as fraction"


def _exact_fixed_inverse(value: FixedNumber) -> FixedNumber | None:
    """Return the inverse of a power of two, if it is such a number, too."""
    places = _power_of_two(abs(value.units))
    if places is None or not 0 <= 2 * value.format.fraction - places < value.format.width - 1:
        return None
    inverse = FixedNumber(value.format, 1 << 2 * value.format.fraction - places)
    return inverse if value.units > 0 else -inverse


def _exact_inverse(kind: Kind, value: Any) -> Any:
    """Return the inverse of a power of two, if both are normal numbers, else None."""
    mantissa, exponent = math.frexp(float(value))
    least = 2 - (1 << (kind.exponent_bits - 1))
    if abs(mantissa) != 0.5 or not least + 2 < exponent < -least - 1:
        return None
    return number_of(kind, 1.0 / float(value))
