"""Fixed-point numbers: the values that the entities of `robot:acc:firm_fixed` compute, as numbers of Python.

The model of that core rounds each exact result. The other operand of an operation, an integer or a float, is converted
first.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from fusesoc_firm.compiler.models import core_model

MOST_BITS = 48
"""The most bits of a number: a float64 holds each of them."""
_TEXT = re.compile(r"fixed\( *([0-9]{1,3}) *, *([0-9]{1,3}) *\)")
# Functions such as a square root are computed with floats, which hold all numbers of at most these bits.
_SINGLE_BITS = 24


@dataclass(frozen=True)
class Format:
    """The bits of a number in two's complement, and those of its fraction."""

    width: int
    fraction: int

    @property
    def limits(self) -> tuple[int, int]:
        """The smallest and the largest number, in units of 2**-fraction."""
        return -(1 << self.width - 1), (1 << self.width - 1) - 1

    @property
    def float_bits(self) -> int:
        """The bits of the floats with which functions are computed."""
        return 32 if self.width <= _SINGLE_BITS else 64

    def holds(self, value: Any) -> bool:
        """Whether a number is not out of range; infinities are the smallest and largest numbers."""
        return not math.isfinite(value) or not self.model.fitted(_exact(value))[1]

    @cached_property
    def model(self) -> Any:
        """The model of the operators for these numbers, which rounds and saturates."""
        return core_model("fixed").Format(self.width, self.fraction)

    def number(self, value: Any) -> FixedNumber:
        """Return the number nearest to another one; NaN is 0."""
        if isinstance(value, FixedNumber):
            return value
        if isinstance(value, float | np.floating) and not math.isfinite(value):
            return FixedNumber(self, 0 if math.isnan(value) else self.limits[int(value > 0)])
        return self.nearest(_exact(value))

    def nearest(self, exact: Fraction) -> FixedNumber:
        """Return the number nearest to a value."""
        return FixedNumber(self, self.model.fitted(exact)[0])

    def of_units(self, units: int) -> FixedNumber:
        """Return the number nearest to some units of 2**-fraction."""
        return self.nearest(Fraction(units, 1 << self.fraction))

    def __str__(self) -> str:
        return f"fixed({self.width}, {self.fraction})"


def _exact(value: Any) -> Fraction:
    """Return a finite number of Python or NumPy."""
    return Fraction(int(value) if isinstance(value, int | np.integer | np.bool_) else float(value))


def format_of(text: str) -> Format | None:
    """Return the format that a text such as `fixed(16, 8)` names, or None for another text, or one out of range."""
    found = _TEXT.fullmatch(text)
    if found is None:
        return None
    width, fraction = map(int, found.groups())
    return Format(width, fraction) if 2 <= width <= MOST_BITS and fraction < width else None


@dataclass(frozen=True, eq=False)
class FixedNumber:
    """A number of `units` times 2**-fraction."""

    format: Format
    units: int

    # NumPy's numbers leave the operation to this class.
    __array_ufunc__ = None

    @property
    def exact(self) -> Fraction:
        """The value of the number."""
        return Fraction(self.units, 1 << self.format.fraction)

    def _exact(self, other: Any) -> Fraction:
        return self.format.number(other).exact

    def __add__(self, other: Any) -> FixedNumber:
        return self.format.nearest(self.exact + self._exact(other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> FixedNumber:
        return self.format.nearest(self.exact - self._exact(other))

    def __rsub__(self, other: Any) -> FixedNumber:
        return self.format.number(other) - self

    def __mul__(self, other: Any) -> FixedNumber:
        return self.format.nearest(self.exact * self._exact(other))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> FixedNumber:
        return FixedNumber(self.format, self.format.model.quotient(self.exact, self._exact(other))[0])

    def __rtruediv__(self, other: Any) -> FixedNumber:
        return self.format.number(other) / self

    def __neg__(self) -> FixedNumber:
        return self.format.nearest(-self.exact)

    def __pos__(self) -> FixedNumber:
        return self

    def __abs__(self) -> FixedNumber:
        return self.format.nearest(abs(self.exact))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, FixedNumber | int | float | np.number | np.bool_):
            return NotImplemented
        return self.exact == self._exact(other)

    def __lt__(self, other: Any) -> bool:
        return self.exact < self._exact(other)

    def __le__(self, other: Any) -> bool:
        return self.exact <= self._exact(other)

    def __gt__(self, other: Any) -> bool:
        return self.exact > self._exact(other)

    def __ge__(self, other: Any) -> bool:
        return self.exact >= self._exact(other)

    def __hash__(self) -> int:
        return hash(self.exact)

    def __bool__(self) -> bool:
        return self.units != 0

    def __float__(self) -> float:
        return math.ldexp(self.units, -self.format.fraction)

    def __trunc__(self) -> int:
        return math.trunc(self.exact)

    __int__ = __trunc__

    def __floor__(self) -> int:
        return math.floor(self.exact)

    def __ceil__(self) -> int:
        return math.ceil(self.exact)

    def __round__(self) -> int:
        return round(self.exact)

    def real(self) -> np.floating[Any]:
        """Return the number as the float with which functions are computed."""
        return np.float32(self) if self.format.float_bits == 32 else np.float64(self)

    def __str__(self) -> str:
        return str(float(self))
