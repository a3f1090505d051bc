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


PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459")
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


def sine_and_cosine(angle: float) -> tuple[Fraction, Fraction]:
    """Return sine and cosine of an angle in rad, with an error below 1e-36."""
    turns = round(Fraction(angle) / (2 * PI))
    # To 2**-160, so that the powers remain short.
    rest = Fraction(round((Fraction(angle) - turns * 2 * PI) * 2**160), 2**160)
    term, sums = Fraction(1), [Fraction(1), Fraction(0)]
    for k in range(1, 60):
        term = Fraction(round(term * rest / k * 2**160), 2**160)
        sums[k % 2] += term if k % 4 < 2 else -term
    return sums[1], sums[0]


@dataclass
class LowPass:
    """A low-pass filter of first order, which starts with its first sample."""

    size: Format = FLOAT64
    filtered: float | None = None

    def step(self, number: float, weight: float, *, restarts: bool = False) -> float:
        """Return the result of the next sample."""
        before = number if restarts or self.filtered is None else self.filtered
        difference = multiply_add(1.0, number, -before, self.size)
        self.filtered = multiply_add(weight, difference, before, self.size)
        return self.filtered


@dataclass
class Pid:
    """A PID controller; its integral keeps its value while it would drive the output beyond a limit."""

    size: Format = FLOAT64
    integral: float = 0.0
    before: float | None = None

    def step(
        self,
        setpoint: float,
        measured: float,
        gains: tuple[float, float, float],
        limits: tuple[float, float],
        *,
        restarts: bool = False,
    ) -> float:
        """Return the output for one sample; `gains` are kp, ki and kd, `limits` the lowest and the highest output."""
        kp, ki, kd = gains
        low, high = limits
        if restarts or self.before is None:
            self.integral, self.before = 0.0, measured
        error = multiply_add(1.0, setpoint, -measured, self.size)
        increased = multiply_add(ki, error, self.integral, self.size)
        slowing = multiply_add(1.0, self.before, -measured, self.size)
        output = multiply_add(kd, slowing, multiply_add(kp, error, increased, self.size), self.size)
        drives_up = _is_above(output, high) and _is_above(increased, self.integral)
        drives_down = _is_above(low, output) and _is_above(self.integral, increased)
        if not (drives_up or drives_down):
            self.integral = increased
        self.before = measured
        return clamp(output, low, high)


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


def _is_above(number: float, other: float) -> bool:
    """Compare two numbers; NaN is above all others, and -0 below +0."""
    if math.isnan(number) or math.isnan(other):
        return not math.isnan(other)
    return _order(number) > _order(other)


def _exponent(magnitude: Fraction) -> int:
    """Return floor(log2(magnitude))."""
    guess = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
    return guess if magnitude >= Fraction(2) ** guess else guess - 1
