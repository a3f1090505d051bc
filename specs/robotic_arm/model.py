"""Bit-true model of the accelerator `robotic_arm`: what rtl/arm_chain.vhd gives, to the last bit.

It works on whole numbers alone, in the hardware's order. Lengths and elements of poses are in units of 2**-FRACTION
(m), angles in units of 2**-FRACTION (rad). The tests contain the reference of the kinematics, in float64.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal, getcontext
from fractions import Fraction
from typing import NamedTuple

FRACTION = 29
ONE = 1 << FRACTION
JOINTS = 7

# Denavit and Hartenberg's parameters after Craig, of the joints and the hand: quarter turns about x, lengths in m.
TURNS = (0, -1, 1, 1, -1, 1, 1, 0)
A = (0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088, 0.0)
D = (0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0, 0.107 + 0.1034)
HAND_ANGLE = -math.pi / 4

# Numbers from LIMIT on have no fixed-point form. An element of a given pose has a result if it is from -ELEMENT_LIMIT
# to less than ELEMENT_LIMIT.
LIMIT = 16
ELEMENT_LIMIT = 4

# Guard bits of the CORDIC unit, and the bits that a square loses before it is added.
_GUARD = 6
_INNER = FRACTION + _GUARD
_SQUARE_CUT = 8
# 13/8 rad; the CORDIC unit folds angles from here on.
_FOLDED_FROM = 13 * 2**FRACTION // 8

Numbers = list[float]


class Column(NamedTuple):
    """A row of a pose: the elements of its columns x, y, z and p."""

    x: int
    y: int
    z: int
    p: int


def _arctangent(index: int, fraction: int) -> int:
    """atan(2**-index) to the nearest unit of 2**-fraction; of index 0 by Machin's formula."""

    def series(x: Fraction) -> Fraction:
        total, power, odd = Fraction(0), x, 1
        while abs(power) * 2 ** (fraction + 20) > 1:
            total += power / odd
            power *= -x * x
            odd += 2
        return total

    exact = 4 * series(Fraction(1, 5)) - series(Fraction(1, 239)) if index == 0 else series(Fraction(1, 2**index))
    return round(exact * 2**fraction)


def _shortened() -> int:
    """The length that the rotations of the CORDIC unit scale to 1, truncated."""
    getcontext().prec = 50
    length = Decimal(1)
    for index in range(80):
        length /= (1 + Decimal(4) ** -index).sqrt()
    return int(length * 2**_INNER)


_ANGLES = [_arctangent(index, _INNER) for index in range(FRACTION)]
_START = _shortened()
# pi/4 with more fraction bits is a multiple of it with fewer.
_PI, _TWO_PI, _FOUR_PI = (_arctangent(0, FRACTION + more) for more in (2, 3, 4))
_A = [round(length * ONE) for length in A]
_D = [round(length * ONE) for length in D]


def to_fixed(number: float) -> int | None:
    """`firm_float64_to_fixed`: rounded to nearest, ties away from zero; None if it is not within +-LIMIT."""
    if not math.isfinite(number):
        return None
    magnitude = math.floor(abs(Fraction(number)) * ONE + Fraction(1, 2))
    if magnitude >= LIMIT * ONE:
        return None
    return -magnitude if number < 0 else magnitude


def fold(angle: int) -> int:
    """The same angle in -pi to pi."""
    if abs(angle) > _TWO_PI + _PI:
        angle += -_FOUR_PI if angle > 0 else _FOUR_PI
    if abs(angle) > _PI:
        angle += -_TWO_PI if angle > 0 else _TWO_PI
    return angle


def sincos(angle: int) -> tuple[int, int]:
    """`firm_cordic_sincos`: cosine and sine."""
    left, cosine, sine = angle << _GUARD, _START, 0
    if not -_FOLDED_FROM <= angle < _FOLDED_FROM:
        left += -4 * _ANGLES[0] if left > 0 else 4 * _ANGLES[0]
        cosine = -cosine
    for index, step in enumerate(_ANGLES):
        if left < 0:
            cosine, sine, left = cosine + (sine >> index), sine - (cosine >> index), left + step
        else:
            cosine, sine, left = cosine - (sine >> index), sine + (cosine >> index), left - step
    return _rounded(cosine, _GUARD), _rounded(sine, _GUARD)


def _rounded(number: int, bits: int) -> int:
    return (number + (1 << (bits - 1))) >> bits


def _product(left: int, right: int) -> int:
    return _rounded(left * right, FRACTION)


def turn(row: Column, step: int, cosine: int, sine: int) -> Column:
    """A row of the pose after a step."""
    sign = TURNS[step]
    x, turned, along = (row.x, row.z, row.y) if sign else (row.x, row.y, row.z)
    along_product = _product(along, _D[step])
    by_sine, by_cosine = _product(turned, sine), _product(turned, cosine)
    if sign < 0:
        by_sine, by_cosine = -by_sine, -by_cosine
    return Column(
        x=_product(x, cosine) + by_sine,
        y=by_cosine - _product(x, sine),
        z=-sign * row.y if sign else row.z,
        p=row.p + _product(x, _A[step]) + (-along_product if sign > 0 else along_product),
    )


def _matrix(rows: Sequence[Column]) -> list[int]:
    """Sixteen elements, column by column."""
    return [*(number for column in zip(*rows, (0, 0, 0, ONE), strict=True) for number in column)]


def chain(angles: Sequence[float], given: Sequence[float]) -> tuple[list[Numbers], float]:
    """The pose of each joint, and the mean square error of the given pose of the end effector."""
    rows = [Column(ONE, 0, 0, 0), Column(0, ONE, 0, 0), Column(0, 0, ONE, 0)]
    poses: list[Numbers] = []
    is_fit = True
    for step, angle in enumerate([*angles, HAND_ANGLE]):
        fixed = to_fixed(angle)
        is_fit = is_fit and fixed is not None
        cosine, sine = sincos(fold(fixed or 0))
        rows = [turn(row, step, cosine, sine) for row in rows]
        numbers = [number / ONE for number in _matrix(rows)]
        # Only computed elements can be NaN: the last row is constant.
        poses.append(
            numbers if is_fit else [math.nan if index % 4 < 3 else number for index, number in enumerate(numbers)]
        )
    elements = [element for element in map(to_fixed, given) if element is not None]
    are_fit = all(-ELEMENT_LIMIT * ONE <= element < ELEMENT_LIMIT * ONE for element in elements)
    if not is_fit or not are_fit or len(elements) < len(given):
        return poses[:JOINTS], math.nan
    differences = [own - element for own, element in zip(_matrix(rows), elements, strict=True)]
    total = sum(difference**2 >> _SQUARE_CUT for difference in differences)
    return poses[:JOINTS], total / 2 ** (2 * FRACTION - _SQUARE_CUT + 4)


def respond(subscriber: str, message: dict[str, list[float]]) -> list[tuple[str, dict[str, object]]]:
    """The message that the system publishes for one that `subscriber` receives."""
    if subscriber != "state":
        raise ValueError(f"unknown subscriber '{subscriber}', legal: 'state'")
    answer: dict[str, object] = {}
    # As in our own message or, with capitals, in franka_msgs/FrankaState.
    fields = {name.lower(): value for name, value in message.items()}
    for suffix in ("", "_d"):
        poses, error = chain(fields[f"q{suffix}"], fields[f"o_t_ee{suffix}"])
        answer |= {f"t{joint}{suffix}": pose for joint, pose in enumerate(poses, 1)}
        answer[f"t_mse{suffix}"] = error
    return [("poses", answer)]
