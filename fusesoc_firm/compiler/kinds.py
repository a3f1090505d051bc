"""The types of numbers in a compiled function: those of NumPy, and Python's own.

Python's own numbers have no type of their own in an operation with a NumPy number: they adopt the other operand's type
(NEP 50). NumPy itself is asked for the type of each result, so no rule of promotion is repeated here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusesoc_firm.compiler.fixed import FixedNumber, Format, format_of


@dataclass(frozen=True)
class Kind:
    """A type of numbers with `bits` bits; `is_weak` marks Python's own int and float.

    The bits of a weak integer depend on the range of its values; `bits` is their limit. A fixed-point number has a
    `format`, and is an integer in hardware.
    """

    name: str
    bits: int
    is_float: bool = False
    is_signed: bool = True
    is_weak: bool = False
    format: Format | None = None

    @property
    def is_real(self) -> bool:
        """Whether numbers have fractions."""
        return self.is_float or self.format is not None

    @property
    def fraction(self) -> int:
        """The bits of the fraction of a fixed-point number, and 0 of an integer."""
        return self.format.fraction if self.format else 0

    @property
    def mantissa_bits(self) -> int:
        """The bits of the fraction of a floating-point number, without the leading one."""
        return 52 if self.bits == 64 else 23

    @property
    def exponent_bits(self) -> int:
        """The bits of the exponent of a floating-point number."""
        return self.bits - self.mantissa_bits - 1

    @property
    def limits(self) -> tuple[int, int]:
        """The smallest and the largest integer."""
        if self.is_signed:
            return -(1 << (self.bits - 1)), (1 << (self.bits - 1)) - 1
        return 0, (1 << self.bits) - 1

    def __str__(self) -> str:
        return {"pyint": "int", "pyfloat": "float"}.get(self.name, self.name)


BOOL = Kind("bool", 1, is_signed=False)
INT = Kind("pyint", 64, is_weak=True)
FLOAT = Kind("pyfloat", 64, is_float=True, is_weak=True)
FLOAT32 = Kind("float32", 32, is_float=True)
FLOAT64 = Kind("float64", 64, is_float=True)
INTEGERS = {
    f"{sign}int{bits}": Kind(f"{sign}int{bits}", bits, is_signed=not sign)
    for sign in ("", "u")
    for bits in (8, 16, 32, 64)
}
KINDS = {kind.name: kind for kind in (BOOL, FLOAT32, FLOAT64, *INTEGERS.values())}

MIXED = Kind("mixed", 64)
"""The kind of a number that has different types on different paths; it is converted before it is hardware."""


def fixed_kind(format_: Format) -> Kind:
    """Return the kind of fixed-point numbers."""
    return Kind(str(format_), format_.width, format=format_)


def kind_named(text: str) -> Kind | None:
    """Return the kind with a name, such as float32 or fixed(16, 8), or None for another text."""
    format_ = format_of(text)
    return fixed_kind(format_) if format_ else KINDS.get(text)


def pair_of(kind: Kind) -> Kind:
    """Return the kind of two numbers that one operator computes; no variable has it."""
    return Kind(f"{kind}_pair", 2 * kind.bits, kind.is_float)


def integer_pair(bits: int) -> Kind:
    """Return the kind of two integers of at least `bits` bits: one operator computes all that are not wider."""
    width = next(item for item in (16, 32, 64, 65) if bits <= item)
    return pair_of(Kind(f"int{width}", width))


def is_number(value: object) -> bool:
    """Whether a value is a number or a truth value that hardware can hold."""
    return isinstance(value, bool | int | float | np.bool_ | np.integer | np.floating | FixedNumber)


def kind_of(value: object) -> Kind:
    """Return the kind of a number."""
    if isinstance(value, bool | np.bool_):
        return BOOL
    if isinstance(value, FixedNumber):
        return fixed_kind(value.format)
    # A float64 of NumPy is also a float of Python.
    if isinstance(value, np.generic):
        return KINDS[value.dtype.name]
    return INT if isinstance(value, int) else FLOAT


def number_of(kind: Kind, value: Any) -> Any:
    """Return a value converted to a kind, as NumPy converts it."""
    match kind:
        case Kind(name="bool"):
            return bool(value)
        case Kind(name="pyint"):
            return int(value)
        case Kind(name="pyfloat"):
            return float(value)
        case Kind(format=Format() as format_):
            return format_.number(value)
        case Kind(is_float=True):
            with np.errstate(over="ignore"):
                return getattr(np, kind.name)(value)
    # The integers of hardware wrap.
    return getattr(np, kind.name)((int(value) - kind.limits[0]) % (1 << kind.bits) + kind.limits[0])


def result_kind(operation: Callable[..., Any], *kinds: Kind) -> Kind:
    """Return the kind of an operation's result."""
    with np.errstate(all="ignore"):
        return kind_of(operation(*(number_of(kind, 1) for kind in kinds)))


def whole_number(value: Any, rounding: Callable[[Any], int] = math.trunc) -> int:
    """Return a float or a fixed-point number as an integer of 64 bits: the nearest one beyond them, and 0 for NaN."""
    least, most = INT.limits
    if isinstance(value, float | np.floating) and not math.isfinite(value):
        return 0 if math.isnan(value) else most if value > 0 else least
    return min(max(rounding(value), least), most)


def floor_number(value: Any) -> int:
    """Return the largest integer that is not above a float, from its integer of 64 bits."""
    whole = whole_number(value)
    return whole - bool(value < whole)


def units_of(value: Any) -> int:
    """Return the integer that hardware has for an integer, a truth value or a fixed-point number."""
    return value.units if isinstance(value, FixedNumber) else int(value)


def bits_of(kind: Kind, value: Any, width: int) -> int:
    """Return the bits of a number in hardware, as an unsigned integer; `width` is the width of an integer."""
    if not kind.is_float:
        return units_of(value) % (1 << width)
    kept = np.float32(value) if kind.bits == 32 else np.float64(value)
    # The only NaN of hardware is the positive quiet NaN.
    if math.isnan(kept):
        return ((1 << (kind.exponent_bits + 1)) - 1) << (kind.mantissa_bits - 1)
    return int(kept.view(np.uint32 if kind.bits == 32 else np.uint64))
