"""Models of the operations of robot:acc:firm_float, by exact arithmetic with one rounding.

The results of `add`, `subtract`, `multiply`, `divide`, `square_root` and `resize` are those of NumPy's float64 and
float32. The models also serve other sizes, operations that NumPy does not have, and flags.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class Format:
    """The size of a floating-point number, at most that of float64, so that a Python float has all its numbers."""

    exponent_bits: int = 11
    mantissa_bits: int = 52

    @property
    def smallest_exponent(self) -> int:
        """The exponent of the smallest normal number, and of all subnormal ones."""
        return 2 - 2 ** (self.exponent_bits - 1)

    def rounded(self, exact: Fraction) -> float:
        """Return the nearest number, the even one of two; infinity beyond the largest number."""
        if not exact:
            return 0.0
        exponent = _exponent(abs(exact))
        unit = Fraction(2) ** (max(exponent, self.smallest_exponent) - self.mantissa_bits)
        nearest = round(exact / unit) * unit
        if abs(nearest) >= Fraction(2) ** (2 ** (self.exponent_bits - 1)):
            return math.inf if exact > 0 else -math.inf
        return float(nearest) if exact > 0 else -float(-nearest)


FLOAT64 = Format(11, 52)
FLOAT32 = Format(8, 23)


def multiply_add(a: float, b: float, c: float, size: Format = FLOAT64) -> float:
    """Return a * b + c with one rounding."""
    product = a * b if not (math.isfinite(a) and math.isfinite(b)) else math.copysign(0.0, a) * math.copysign(1.0, b)
    if not all(map(math.isfinite, (a, b, c))):
        return product + c
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    if exact:
        return size.rounded(exact)
    # Only a sum of two negative zeros is a negative zero.
    return product + c if not Fraction(a) * Fraction(b) else 0.0


def clamp(number: float, low: float, high: float) -> float:
    """Return the number, but at least `low` and then at most `high`; NaN if one of them is NaN; -0 is below +0."""
    if math.isnan(number) or math.isnan(low) or math.isnan(high):
        return math.nan
    return min(max(number, low, key=_order), high, key=_order)


def from_fixed(number: int, fraction: int = 0, size: Format = FLOAT64) -> float:
    """Return the number of units of 2**-fraction, rounded to nearest, ties to even."""
    return size.rounded(Fraction(number, 2**fraction))


def to_fixed(
    number: float, width: int = 32, fraction: int = 0, *, is_signed: bool = True, truncates: bool = False
) -> tuple[int, bool, bool]:
    """Return a number in units of 2**-fraction, whether it was out of range, and whether it is NaN."""
    low, high = (-(2 ** (width - 1)), 2 ** (width - 1) - 1) if is_signed else (0, 2**width - 1)
    if math.isnan(number):
        return 0, False, True
    if math.isinf(number):
        return (high if number > 0 else low), True, False
    to_whole: Callable[[Fraction], int] = math.trunc if truncates else round
    units = to_whole(Fraction(number) * 2**fraction)
    return min(max(units, low), high), not low <= units <= high, False


def _order(number: float) -> tuple[float, float]:
    return number, math.copysign(1.0, number)


def _exponent(magnitude: Fraction) -> int:
    """Return floor(log2(magnitude))."""
    guess = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
    return guess if magnitude >= Fraction(2) ** guess else guess - 1
