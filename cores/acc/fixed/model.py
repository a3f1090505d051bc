"""Models of the operations of robot:acc:firm_fixed, by exact arithmetic with one rounding.

A number is an integer in units of 2**-fraction, as in the hardware.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class Format:
    """Bits and fraction bits of a number in two's complement."""

    width: int = 32
    fraction: int = 16

    def exact(self, number: int) -> Fraction:
        """Return the value of a number."""
        return Fraction(number, 2**self.fraction)

    def fitted(self, exact: Fraction) -> tuple[int, bool]:
        """Return the nearest number, the even one of two, and whether it is out of range and thus saturated."""
        low, high = -(2 ** (self.width - 1)), 2 ** (self.width - 1) - 1
        units = round(exact * 2**self.fraction)
        return min(max(units, low), high), not low <= units <= high

    def quotient(self, a: Fraction, b: Fraction) -> tuple[int, bool, bool]:
        """Return a / b, whether it is out of range, and whether it is undefined; a / 0 has the sign of a."""
        if b:
            return *self.fitted(a / b), False
        if a:
            return (2 ** (self.width - 1) - 1 if a > 0 else -(2 ** (self.width - 1))), True, False
        return 0, False, True
