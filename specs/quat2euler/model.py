"""Bit-true model of the accelerator `quat2euler`: what rtl/quat2euler.vhd sends, to the last bit.

Every function models one stage of the hardware in whole numbers alone, so the model shares neither rounding
nor libm with the `math` it is tested against. Angles and lengths are in units of 2**-FRACTION (rad, or the
largest of x, y, z, w scaled into 1/2 to 1).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

FRACTION = 60
ITERATIONS = 35

_MANTISSA_BITS = 52
_EXPONENT_MASK = 0x7FF
_MANTISSA_MASK = (1 << _MANTISSA_BITS) - 1
_EXPONENT_BIAS = 1023


def _arctangents() -> tuple[int, ...]:
    """round(atan(2**-i) * 2**FRACTION) for every rotation, from atan x = x - x**3/3 + ..., with 64 bits to spare."""

    def series(numerator: int, denominator: int, fraction: int) -> int:
        power = (numerator << fraction) // denominator
        total, odd = 0, 1
        while power:
            total += power // odd if odd % 4 == 1 else -(power // odd)
            power = power * numerator**2 // denominator**2
            odd += 2
        return total

    spare = 64
    wide = FRACTION + spare
    machin = 4 * series(1, 5, wide) - series(1, 239, wide)
    exact = [machin] + [series(1, 2**i, wide) for i in range(1, ITERATIONS)]
    return tuple((angle + (1 << (spare - 1))) >> spare for angle in exact)


ARCTANGENTS = _arctangents()
HALF_PI = 2 * ARCTANGENTS[0]
PI = 4 * ARCTANGENTS[0]
TWO_PI = 8 * ARCTANGENTS[0]


class Block(NamedTuple):
    """Numbers with a common exponent, and whether one was not finite or all were zero or denormal."""

    numbers: tuple[int, ...]
    undefined: bool
    zero: bool


def to_block(numbers: Sequence[float]) -> Block:
    """`firm_float64_to_block`: align to the largest exponent, round to nearest, ties away from zero."""
    bits = [struct.unpack("<Q", struct.pack("<d", number))[0] for number in numbers]
    exponents = [word >> _MANTISSA_BITS & _EXPONENT_MASK for word in bits]
    largest = max(exponents)
    aligned = []
    for word, exponent in zip(bits, exponents, strict=True):
        normal = exponent > 0
        mantissa = (word & _MANTISSA_MASK) | normal << _MANTISSA_BITS
        # One bit more than the result has, for rounding.
        shifted = mantissa << (FRACTION - _MANTISSA_BITS) >> max(largest - max(exponent, 1), 0)
        magnitude = (shifted + 1) >> 1
        aligned.append(-magnitude if word >> 63 else magnitude)
    if largest == 0:
        aligned = [0] * len(aligned)
    return Block(tuple(aligned), undefined=largest == _EXPONENT_MASK, zero=largest == 0)


def vectoring(x: int, y: int) -> tuple[int, int]:
    """`firm_cordic_vectoring`: the length of (x, y) times CORDIC's gain, and atan2(y, x)."""
    mirrored = (x < 0) != (y < 0)
    magnitude, scaled, angle = abs(x), abs(y), 0
    if x < 0:
        angle = -PI if y < 0 else PI
    elif x == 0:
        magnitude, scaled, angle = abs(y), 0, HALF_PI * ((y > 0) - (y < 0))
    exact = False
    for i, step in enumerate(ARCTANGENTS):
        below = scaled < 0
        exact = exact or scaled == 0
        if not exact:
            angle += step if below == mirrored else -step
        distance = ~scaled if below else scaled
        scaled = 2 * (scaled + magnitude if below else scaled - magnitude)
        magnitude += distance >> (2 * i)
    return magnitude, angle


def wrap(angle: int) -> int:
    """The same angle in (-pi, pi]."""
    if angle > PI:
        return angle - TWO_PI
    return angle + TWO_PI if angle <= -PI else angle


def to_float(fixed: int) -> float:
    """`firm_fixed_to_float64`: Python, too, rounds an int to the nearest float, ties to even; zero is +0."""
    return fixed / (1 << FRACTION)


def quaternion_to_euler(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Roll, pitch and yaw in rad; NaN if an argument is not finite, zeros if none is normal."""
    block = to_block((x, y, z, w))
    if block.undefined:
        return float("nan"), float("nan"), float("nan")
    if block.zero:
        return 0.0, 0.0, 0.0
    fixed_x, fixed_y, fixed_z, fixed_w = block.numbers
    length_qr, alpha = vectoring(fixed_w - fixed_y, fixed_x + fixed_z)
    length_ps, beta = vectoring(fixed_w + fixed_y, fixed_z - fixed_x)
    _, half_pitch = vectoring(length_qr, length_ps)
    return to_float(wrap(alpha - beta)), to_float(2 * half_pitch - HALF_PI), to_float(wrap(alpha + beta))


def respond(subscriber: str, message: dict[str, object]) -> list[tuple[str, dict[str, object]]]:
    """The messages that the system publishes when `subscriber` receives `message`."""
    if subscriber != "QuaternionToEuler_sub":
        raise ValueError(f"unknown subscriber '{subscriber}', legal: 'QuaternionToEuler_sub'")
    components = []
    for field in ("x", "y", "z", "w"):
        value = message[field]
        if not isinstance(value, float | int):
            raise TypeError(f"field '{field}' is {value!r}, not a number")
        components.append(float(value))
    roll, pitch, yaw = quaternion_to_euler(*components)
    return [("QuaternionToEuler_pub", {"x": roll, "y": pitch, "z": yaw})]
