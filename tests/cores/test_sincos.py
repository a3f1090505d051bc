"""Sine and cosine of robot:acc:firm_float: in simulation, the bits of their model; the model against exact integers.

The arguments include those of each exponent that are nearest to a multiple of a quarter turn.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.cores.floats import BITS, MODEL, SIZES, TYPES, Numbers, analysed, check, operate, size_of
from tests.hdl.ghdl import CORES, Library

# Of results, of which each takes about 100 cycles; and of arguments of the model alone.
RESULTS = [100, pytest.param(10_000, marks=pytest.mark.thorough)]
ARGUMENTS = [1000, pytest.param(100_000, marks=pytest.mark.thorough)]
# The stated errors in units of the last place: of sine and cosine, and of the quotient of both.
ERROR = 1.0
TANGENT_ERROR = 2.0
TABLE = CORES / "acc" / "float" / "rtl" / "firm_float_turn_table.vhd"
# Fraction bits of pi, which multiples up to 2**1024 need, and of sine and cosine.
PI_BITS = 1500
PRECISION = 300


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return analysed(tmp_path_factory.mktemp("sincos"))


@cache
def pi() -> Fraction:
    """Pi by the mean of Gauss and Legendre, another way than the model's."""
    bits = PI_BITS + 50
    one = 1 << bits
    a, b, t, p = one, math.isqrt(one * one // 2), one // 4, 1
    for _ in range(12):
        mean = (a + b) // 2
        t -= p * (a - mean) ** 2 >> bits
        a, b, p = mean, math.isqrt(a * b), 2 * p
    return Fraction((a + b) ** 2 // (4 * t), one)


def exact(angle: float) -> tuple[Fraction, Fraction]:
    """Sine and cosine, with a relative error below 2**-200."""
    x = Fraction(angle)
    if abs(x) < Fraction(1, 2**60):
        return x - x**3 / 6, 1 - x**2 / 2
    turns = round(2 * x / pi())
    unit = 1 << PRECISION
    rest = round((x - turns * pi() / 2) * unit)
    sums, term, k = [unit, 0], unit, 1
    while term:
        term = (term * rest >> PRECISION) // k
        term += term < 0
        sums[k % 2] += term if k % 4 < 2 else -term
        k += 1
    cosine, sine = (Fraction(item, unit) for item in sums)
    return [(sine, cosine), (cosine, -sine), (-sine, -cosine), (-cosine, sine)][turns % 4]


def units(found: float, wanted: Fraction, name: str) -> float:
    """The error of a number in units of the last place of the exact one."""
    exponent = math.frexp(abs(wanted))[1] - 1
    mantissa_bits = SIZES[name][1]
    last = max(exponent, MODEL.Format(*SIZES[name]).smallest_exponent) - mantissa_bits
    return float(abs(Fraction(found) - wanted) / Fraction(2) ** last)


def hard(name: str) -> Iterator[float]:
    """For each exponent, an angle that is very close to a multiple of a quarter turn: a convergent of the quotient."""
    exponent_bits, mantissa_bits = SIZES[name]
    most = 2 ** (mantissa_bits + 1)
    for exponent in range(-mantissa_bits, 2 ** (exponent_bits - 1) - mantissa_bits):
        turns = 2 * Fraction(2) ** exponent / pi()
        rest, before, mantissa = turns, 0, 1
        while rest % 1 and before + int(1 / (rest % 1)) * mantissa < most:
            rest = 1 / (rest % 1)
            before, mantissa = mantissa, before + int(rest) * mantissa
        yield math.ldexp(mantissa * (most // 2 // mantissa or 1), exponent)


def angles(numbers: Numbers, count: int) -> list[list[int]]:
    """Numbers of all kinds; angles of a few turns, of many, small ones, and the nearest ones to quarter turns."""
    name, draw = numbers.name, numbers.random
    rows = numbers.several(count // 3, 1)
    draw.shuffle(rows)
    few = list(hard(name))
    while len(rows) < count:
        turns = draw.choice((draw.uniform(-4, 4), draw.uniform(-1000, 1000), draw.randint(-1000, 1000)))
        small = 2.0 ** draw.uniform(-numbers.mantissa_bits, 3)
        angle = draw.choice((draw.uniform(-4, 4), turns * math.pi / 2, small, -small, draw.choice(few)))
        rows.append([int(TYPES[name](angle).view(BITS[name]))])
    return rows[:count]


@pytest.mark.one_in(2)
@pytest.mark.parametrize("count", RESULTS)
@pytest.mark.parametrize("name", SIZES)
def test_results_are_those_of_the_model(library: Library, tmp_path: Path, name: str, count: int) -> None:
    numbers = Numbers(name)
    rows = angles(numbers, count)
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION="sincos", **size_of(numbers))
    size = MODEL.Format(*SIZES[name])
    expected = [MODEL.sine_and_cosine(float(numbers.values(row)[0]), size) for row in rows]
    mask = (1 << numbers.width) - 1
    for column, place in ((0, numbers.width), (1, 0)):
        wanted = np.array([pair[column] for pair in expected], dtype=TYPES[name])
        check(numbers, rows, [bits >> place & mask for bits in found], wanted)


@pytest.mark.parametrize("count", ARGUMENTS)
@pytest.mark.parametrize("name", SIZES)
def test_results_are_within_the_stated_error(name: str, count: int) -> None:
    numbers, size = Numbers(name), MODEL.Format(*SIZES[name])
    largest = {"sine": 0.0, "cosine": 0.0, "tangent": 0.0}
    for row in angles(numbers, count):
        angle = float(numbers.values(row)[0])
        sine, cosine = MODEL.sine_and_cosine(angle, size)
        if not math.isfinite(angle):
            assert math.isnan(sine)
            assert math.isnan(cosine)
            continue
        wanted = exact(angle)
        tangent = float(np.divide(TYPES[name](sine), TYPES[name](cosine)))
        found = (sine, wanted[0]), (cosine, wanted[1]), (tangent, wanted[0] / wanted[1])
        for label, (result, right) in zip(largest, found, strict=True):
            if right:
                largest[label] = max(largest[label], units(result, right, name))
    print(name, ", ".join(f"{label} {error:.3f}" for label, error in largest.items()), "units")
    assert largest["sine"] <= ERROR
    assert largest["cosine"] <= ERROR
    assert largest["tangent"] <= TANGENT_ERROR


@pytest.mark.parametrize("name", SIZES)
def test_results_beside_quarter_turns_are_within_the_stated_error(name: str) -> None:
    size = MODEL.Format(*SIZES[name])
    nearest = 1.0
    for angle in hard(name):
        found, wanted = MODEL.sine_and_cosine(angle, size), exact(angle)
        nearest = min(nearest, *map(abs, map(float, wanted)))
        for result, right in zip(found, wanted, strict=True):
            assert units(result, right, name) <= ERROR, angle
    # The arguments are as hard as they can be.
    assert nearest < 2.0 ** (-60 if name == "float64" else -29)


@pytest.mark.parametrize("name", SIZES)
def test_small_angles_are_their_own_sines(name: str) -> None:
    numbers = Numbers(name)
    least = float(numbers.values([1])[0])
    for angle in (0.0, least, least * 3, 2.0**-126, 2.0**-40):
        for signed in (angle, -angle):
            sine, cosine = MODEL.sine_and_cosine(signed, MODEL.Format(*SIZES[name]))
            assert (sine, math.copysign(1, sine), cosine) == (signed, math.copysign(1, signed), 1.0)


def test_constants_of_the_table() -> None:
    words = [int(word, 16) for word in re.findall(r'x"([0-9a-f]{24})"', TABLE.read_text(encoding="utf-8"))]
    turns, gains, rads, digits = words[:31], words[31:47], words[47:63], words[63:]
    unit = 1 << 96
    for index, word in enumerate(turns, 1):
        angle = sum(Fraction((-1) ** k, (2 * k + 1) * 2 ** (index * (2 * k + 1))) for k in range(150))
        assert word == round(2 * angle / pi() * 2**index * unit)
    for number, (gain, rad) in enumerate(zip(gains, rads, strict=True)):
        squared = Fraction(1)
        for index in range(2 * number + 1, 110):
            squared = Fraction(round(squared * (1 + Fraction(1, 4**index)) * 2**250), 2**250)
        inverse = Fraction(math.isqrt(round(2**500 / squared)), 2**250)
        assert gain == round(inverse * unit)
        assert rad == round((inverse * pi() / 2 - 1) * unit)
    assert sum(word << 96 * (11 - place) for place, word in enumerate(digits)) == int(2 / pi() * 2**1152)
