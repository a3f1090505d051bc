"""Models of the operations of robot:acc:firm_float, by exact arithmetic with one rounding.

The results of `add`, `subtract`, `multiply`, `divide`, `square_root` and `resize` are those of NumPy's float64 and
float32. The models also serve other sizes, operations that NumPy does not have, and flags.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache


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


def sine_and_cosine(angle: float, size: Format = FLOAT64) -> tuple[float, float]:
    """Return sine and cosine of an angle in rad, as `firm_float_sincos`: within a unit of the last place."""
    if not math.isfinite(angle):
        return math.nan, math.nan
    last = (size.mantissa_bits + 3) // 2
    if not angle or _exponent(abs(Fraction(angle))) < -last:
        return angle, 1.0
    quadrant, z, first = _quarter_turns(abs(angle), size)
    sine, cosine = _turned(z, first, size)
    # The magnitude of a negative sine is one less.
    unit = Fraction(1, 2 ** (size.mantissa_bits // 2 * 2 + 8))
    y = (sine if sine >= 0 else sine + 1) * unit / 2**first
    x = cosine * unit
    for _ in range(quadrant):
        y, x = x, -y
    return math.copysign(1.0, angle) * size.rounded(y), size.rounded(x)


def sin(angle: float, size: Format = FLOAT64) -> float:
    """Return the sine of an angle in rad, as `firm_float_sincos`."""
    return sine_and_cosine(angle, size)[0]


def cos(angle: float, size: Format = FLOAT64) -> float:
    """Return the cosine of an angle in rad, as `firm_float_sincos`."""
    return sine_and_cosine(angle, size)[1]


def _quarter_turns(angle: float, size: Format) -> tuple[int, int, int]:
    """Return the nearest multiple of a quarter turn, modulo 4, and the distance from it: its units, and an exponent s.

    A unit is 2**-s of the last place.
    """
    fraction, low = size.mantissa_bits // 2 * 2 + 8, size.mantissa_bits + 3
    half = _exponent(Fraction(angle)) // 2
    mantissa = int(Fraction(angle) / Fraction(4) ** half * 2**size.mantissa_bits)
    index = max(half - (size.mantissa_bits + 1) // 2, 1)
    # The last digit has the weight 4**-place in the mantissa's place.
    place = index - half
    z = tail = carry = quadrant = 0
    is_complete = False
    while not is_complete:
        first = 2 * place - fraction - 3
        is_complete = first >= 1 and z >> (fraction - 4) not in (0, -1)
        if place == 5:
            quadrant = ((z + 16) >> 5) % 4
            z = (z + 16) % 32 - 16
        z = 4 * (z + carry) + (tail >> (low - 2))
        # Before the quadrant is known, only its bits and those below matter.
        z = z % 2**7 if place < 5 else z
        product = 4 * tail % 2**low + mantissa * _digits_of_two_over_pi()[index]
        carry, tail = product >> low, product % 2**low
        index, place = index + 1, place + 1
    return quadrant, z, first


def _turned(z: int, first: int, size: Format) -> tuple[int, int]:
    """Return sine and cosine of an angle of z quarter turns, all times 2**first; they have units of the last place."""
    fraction, last = size.mantissa_bits // 2 * 2 + 8, (size.mantissa_bits + 3) // 2
    signs = []
    for index in range(first, last + 1):
        signs.append(1 if z >= 0 else -1)
        z = 2 * (z - signs[-1] * _scaled(_turn(index), fraction))
    sine = z
    for distance, sign in _terms(min(first, 31) if first <= last else 31):
        if distance <= fraction - 2 - len(signs):
            sine += sign * (z >> distance)
    cosine = _scaled(_inverse_gain(first), fraction) if first <= last else 2**fraction
    for index in range(last, first - 1, -1):
        sign = signs.pop()
        sine, cosine = (sine >> 1) + sign * cosine, cosine - sign * (sine >> (2 * index + 1))
    return sine, cosine


def atan2(y: float, x: float, size: Format = FLOAT64) -> float:
    """Return the angle of the vector (x, y) in rad, as `firm_float_atan2`: within a unit of the last place."""
    if math.isnan(y) or math.isnan(x):
        return math.nan
    is_steep, is_left = abs(x) < abs(y), math.copysign(1.0, x) < 0
    digits = size.mantissa_bits + 5
    half_pi = round(PI / 2 * 2**digits)
    offset = half_pi if is_steep else 2 * half_pi if is_left else 0
    angle, scale = _flat_angle(*sorted((abs(y), abs(x))), size, adds=offset > 0)
    units = offset + (angle if is_steep == is_left else -angle)
    return math.copysign(size.rounded(Fraction(units, 2**digits) * Fraction(2) ** scale), y)


def _flat_angle(y: float, x: float, size: Format, *, adds: bool) -> tuple[int, int]:
    """Return the angle of a vector with 0 <= y <= x: its units, and the exponent of 2**digits units.

    If it is added to another angle, this exponent is 0.
    """
    digits = size.mantissa_bits + 5
    last = digits // 2
    least = 0 if adds else size.smallest_exponent - 1
    if math.isinf(y):
        y = x = 1.0
    elif not y or math.isinf(x):
        return 1, least
    (short, short_exponent), (long, long_exponent) = (_inner(number, size) for number in (y, x))
    distance = long_exponent - short_exponent
    scale = max(-distance, least)
    zeros = min(scale + distance, digits)
    units = differences = 0
    for index in range(distance, distance + digits - zeros):
        sign = 1 if short >= 0 else -1
        difference = 2 ** (digits + last - index) - _arctangent(index, digits + last) if index <= last else 0
        tilted = (short if short >= 0 else ~short) >> 2 * index
        short, long = 2 * (short - sign * long), long + tilted
        differences += sign * difference
        units = 2 * units + (short >= 0)
    return 2 * units + 1 - (differences << (0 if adds else distance) >> last), scale


def exp(number: float, size: Format = FLOAT64) -> float:
    """Return the exponential function of a number, as `firm_float_exp`: within a unit of the last place."""
    fraction = size.mantissa_bits + 8
    if math.isnan(number):
        return math.nan
    if math.isinf(number) or abs(number) >= 2.0 ** (size.exponent_bits - 1):
        return math.inf if number > 0 else 0.0
    magnitude = math.floor(Fraction(abs(number)) * 2**fraction)
    rest = magnitude if math.copysign(1.0, number) > 0 else ~magnitude
    rest += _logarithm(0, fraction + size.exponent_bits)
    power = -(2**size.exponent_bits)
    for place in range(size.exponent_bits, -1, -1):
        if rest >= _logarithm(0, fraction + place):
            rest -= _logarithm(0, fraction + place)
            power += 2**place
    factors = []
    for index in range(1, fraction // 2 + 1):
        if rest >= _logarithm(index, fraction):
            rest -= _logarithm(index, fraction)
            factors.append(index)
    product = 2**fraction + rest
    for index in reversed(factors):
        product += product >> index
    # A subnormal result is truncated before it is rounded.
    lowered = max(size.smallest_exponent - power, 0)
    return size.rounded(Fraction(product >> lowered, 2**fraction) * Fraction(2) ** (power + lowered))


def log(number: float, size: Format = FLOAT64) -> float:
    """Return the natural logarithm, as `firm_float_log`: within a unit of the last place."""
    if math.isnan(number) or number < 0:
        return math.nan
    if not number or math.isinf(number):
        return math.inf if number else -math.inf
    mantissa, power = _inner(number, size)
    unit = 2 ** (size.mantissa_bits + 7)
    # From 23/16, about the root of 2, the mantissa is halved.
    is_below = mantissa * 16 >= unit // 4 * 23
    mantissa, power = (2 * mantissa, power + 1) if is_below else (4 * mantissa, power)
    if mantissa == unit and not power:
        return 0.0
    digits = size.mantissa_bits + 5
    last = digits // 2
    product, lack, index = min(mantissa, unit), 2 * abs(mantissa - unit), 1
    while not power and 2 * lack < unit:
        lack, index = 2 * lack, index + 1
    start = index
    units, differences = _logarithm_of_quotient(product, lack, start, size)
    twos = abs(power) * _logarithm(0, digits + last + 1)
    is_opposed = power != 0 and (power < 0) != is_below
    if is_opposed:
        differences, units = -differences, -units
    total = ((twos - (differences << start)) >> last) + units
    is_negative = power < 0 if power else is_below
    exact = Fraction(total, 2**digits) * Fraction(1, 2**start)
    return size.rounded(-exact if is_negative else exact)


def _logarithm_of_quotient(product: int, lack: int, start: int, size: Format) -> tuple[int, int]:
    """Return the digits of ln(1 + lack / 2**start / product), and the differences to be subtracted."""
    digits = size.mantissa_bits + 5
    last = digits // 2
    units = differences = 0
    is_bent = False
    for index in range(start, start + digits):
        if index > last and not is_bent:
            product += lack >> (index + 1)
            is_bent = True
        is_taken = lack >= product
        if is_taken:
            lack -= product
            if index <= last:
                product += product >> index
                differences += 2 ** (digits + last - index) - _logarithm(index, digits + last)
        lack *= 2
        units = 2 * units + is_taken
    return 2 * units + 1, differences


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


def _inner(number: float, size: Format) -> tuple[int, int]:
    """Return mantissa and exponent of a positive number; the mantissa has five bits more."""
    exponent = _exponent(Fraction(number))
    return int(Fraction(number) / Fraction(2) ** exponent * 2 ** (size.mantissa_bits + 5)), exponent


# Constants of sine and cosine are rounded to these fraction bits first, as in `firm_float_turn_table`.
_WORD = 96
_PI_DIGITS = 576


@cache
def _pi(fraction: int) -> int:
    """Return pi in units of 2**-fraction, rounded down."""
    # Machin's formula, with 32 bits more for the errors of all terms.
    unit = 2 ** (fraction + 32)
    angles = [sum((-1) ** k * (unit // x ** (2 * k + 1)) // (2 * k + 1) for k in range(fraction)) for x in (5, 239)]
    return 4 * (4 * angles[0] - angles[1]) >> 32


@cache
def _digits_of_two_over_pi() -> tuple[int, ...]:
    """Return the digits of 2/pi to the base 4, from -1 to 2; the digit k has the weight 4**-k."""
    fraction = 2 * _PI_DIGITS
    rest = 2 ** (2 * fraction + 1 + 32) // _pi(fraction + 32)
    digits = []
    for _ in range(_PI_DIGITS):
        digits.append((rest + 1) % 4 - 1)
        rest = (rest - digits[-1]) // 4
    return (rest, *reversed(digits), *[0] * _PI_DIGITS)


@cache
def _turn(index: int) -> int:
    """Return 2**index * atan(2**-index) in quarter turns, in words' units."""
    return round(_arctangent(index, 2 * _WORD + index) / PI * 2 / Fraction(2) ** _WORD)


@cache
def _squared_gain(index: int) -> Fraction:
    """Return the product of 1 + 4**-i over all i >= index, with an error below 2**-240."""
    unit = 2**250
    product = unit
    for i in range(index, 125):
        product += product // 4**i
    return Fraction(product, unit)


@cache
def _inverse_gain(index: int) -> int:
    """Return the inverse of the gain of all rotations from an angle on, in words' units."""
    return round(Fraction(math.isqrt(round(2**400 / _squared_gain(index))), 2 ** (200 - _WORD)))


@cache
def _terms(index: int) -> tuple[tuple[int, int], ...]:
    """Return pi/2 times the inverse of the gain, less 1, as shifts and signs: the digits of the non-adjacent form."""
    root = math.isqrt(round(2**400 / _squared_gain(index)))
    number = round(Fraction(root, 2**200) * PI / 2 * 2**_WORD) - 2**_WORD
    digits = ((_WORD + 1 - place, (3 * number >> place & 1) - (number >> place & 1)) for place in range(_WORD, 0, -1))
    return tuple((distance, sign) for distance, sign in digits if sign)


def _scaled(word: int, fraction: int) -> int:
    """Return a word as the nearest number of units of 2**-fraction."""
    return (word + 2 ** (_WORD - fraction - 1)) >> (_WORD - fraction)


@cache
def _arctangent(index: int, fraction: int) -> int:
    """Return atan(2**-index) in units of 2**-fraction."""
    if not index:
        return round(PI / 4 * 2**fraction)
    terms = (Fraction((-1) ** k, (2 * k + 1) << index * (2 * k + 1)) for k in range(100))
    return round(sum(terms) * 2**fraction)


@cache
def _logarithm(index: int, fraction: int) -> int:
    """Return ln(1 + 2**-index) in units of 2**-fraction."""
    # ln(1 + x) = 2 * artanh(x / (2 + x))
    ratio = Fraction(1, 2 ** (index + 1) + 1)
    return round(sum(2 * ratio ** (2 * k + 1) / (2 * k + 1) for k in range(70)) * 2**fraction)


def _exponent(magnitude: Fraction) -> int:
    """Return floor(log2(magnitude))."""
    guess = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
    return guess if magnitude >= Fraction(2) ** guess else guess - 1
