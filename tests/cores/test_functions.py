"""Elementary functions of robot:acc:firm_float: in simulation, the bits of their models; these against exact values.

The judge of the errors is NumPy's longdouble, which has 11 bits more than float64 where the tests run on x86.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cores.floats import BITS, MODEL, SIZES, TYPES, Numbers, analysed, check, operate, size_of
from tests.hdl.ghdl import CORES, Library

# Of results, of which each takes about 70 cycles; and of arguments of the models alone.
RESULTS = [100, pytest.param(10_000, marks=pytest.mark.thorough)]
ARGUMENTS = [1000, pytest.param(100_000, marks=pytest.mark.thorough)]
needs_longdouble = pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="longdouble is float64 here")

# The stated error in units of the last place.
ERROR = 1.0
TABLE = CORES / "acc" / "float" / "rtl" / "firm_float_log_table.vhd"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return analysed(tmp_path_factory.mktemp("functions"))


def vectors(numbers: Numbers, count: int) -> list[list[int]]:
    """Every pair of special numbers, pairs of all exponents and of near ones, and those beside the diagonals."""
    rows = numbers.several(count // 2, 2)
    numbers.random.shuffle(rows)
    while len(rows) < count:
        angle = numbers.random.uniform(-math.pi, math.pi)
        length = 2.0 ** numbers.random.uniform(-20, 20)
        pair = TYPES[numbers.name](length * math.sin(angle)), TYPES[numbers.name](length * math.cos(angle))
        rows.append([int(number.view(BITS[numbers.name])) for number in pair])
    return rows[:count]


def exponents(numbers: Numbers, count: int) -> list[list[int]]:
    """Every special number, those of all sizes, and those whose exponentials are finite or subnormal."""
    rows = numbers.several(count // 3, 1)
    numbers.random.shuffle(rows)
    limit = 2.0 ** (numbers.exponent_bits - 1) * math.log(2)
    while len(rows) < count:
        number = numbers.random.choice((1.0, 40.0, limit * 1.1)) * numbers.random.uniform(-1, 1)
        rows.append([int(TYPES[numbers.name](number).view(BITS[numbers.name]))])
    return rows[:count]


def near_one(numbers: Numbers, count: int) -> list[list[int]]:
    """Every special number, those of all sizes, those beside 1 and beside the bound of mantissas."""
    rows = numbers.several(count // 3, 1)
    numbers.random.shuffle(rows)
    while len(rows) < count:
        beside = numbers.random.choice((-1, 1)) * 2.0 ** numbers.random.uniform(-numbers.mantissa_bits - 1, 0)
        number = numbers.random.choice((1 + beside, 23 / 16 + beside / 1000, numbers.random.uniform(0.3, 3)))
        rows.append([int(TYPES[numbers.name](number).view(BITS[numbers.name]))])
    return rows[:count]


@dataclass(frozen=True)
class Function:
    """A function: how its operands are drawn, its exact values, and what becomes of its model's arguments."""

    draw: Callable[[Numbers, int], list[list[int]]]
    exact: Callable[..., Any]

    def of_model(self, operation: str, numbers: Numbers, rows: list[list[int]]) -> Any:
        """The results of the model."""
        model, size = getattr(MODEL, operation), MODEL.Format(*SIZES[numbers.name])
        return np.array([model(*map(float, numbers.values(row)), size) for row in rows], dtype=TYPES[numbers.name])


FUNCTIONS = {
    "atan2": Function(vectors, np.arctan2),
    "exp": Function(exponents, np.exp),
    "log": Function(near_one, np.log),
}


@pytest.mark.one_in(2)
@pytest.mark.parametrize("count", RESULTS)
@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("operation", FUNCTIONS)
def test_results_are_those_of_the_model(
    library: Library, tmp_path: Path, operation: str, name: str, count: int
) -> None:
    numbers, function = Numbers(name), FUNCTIONS[operation]
    rows = function.draw(numbers, count)
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION=operation, **size_of(numbers))
    check(numbers, rows, found, function.of_model(operation, numbers, rows))


@needs_longdouble
@pytest.mark.parametrize("count", ARGUMENTS)
@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("operation", FUNCTIONS)
def test_results_are_within_the_stated_error(operation: str, name: str, count: int) -> None:
    numbers, function = Numbers(name), FUNCTIONS[operation]
    rows = function.draw(numbers, count)
    found = function.of_model(operation, numbers, rows)
    columns = (numbers.values(column).astype(np.longdouble) for column in zip(*rows, strict=True))
    with np.errstate(all="ignore"):
        exact = function.exact(*columns)
        nearest = exact.astype(TYPES[name])
    np.testing.assert_array_equal(np.isnan(found), np.isnan(nearest))
    beyond = np.isinf(nearest)
    np.testing.assert_array_equal(found[beyond], nearest[beyond])
    finite = np.isfinite(nearest)
    np.testing.assert_array_equal(np.signbit(found[finite]), np.signbit(nearest[finite]))
    units = np.abs(found[finite] - exact[finite]) / np.spacing(np.abs(nearest[finite])).astype(np.longdouble)
    print(f"{operation}, {name}: {units.max():.3f} units")
    assert units.max() <= ERROR


@needs_longdouble
@pytest.mark.parametrize("count", ARGUMENTS)
@pytest.mark.parametrize("name", SIZES)
def test_arcs_by_angles_are_within_two_units(name: str, count: int) -> None:
    """The expressions of docs/reference/functions.md."""
    numbers, size, kind = Numbers(name), MODEL.Format(*SIZES[name]), TYPES[name]
    arguments = []
    for _ in range(count):
        small = 2.0 ** numbers.random.uniform(-25, 0)
        arguments.append(numbers.random.choice((small, 1 - small, small - 1, numbers.random.uniform(-1, 1))))
    x = np.array(arguments, dtype=kind)
    root = np.sqrt((kind(1) - x) * (kind(1) + x))
    for y, across, exact in ((x, root, np.arcsin), (root, x, np.arccos)):
        pairs = zip(map(float, y), map(float, across), strict=True)
        found = np.array([MODEL.atan2(*pair, size) for pair in pairs], dtype=kind)
        wanted = exact(x.astype(np.longdouble))
        units = np.abs(found - wanted) / np.spacing(np.abs(wanted).astype(kind)).astype(np.longdouble)
        assert units.max() <= 2


def test_angles_of_axes_and_diagonals_are_those_of_math() -> None:
    for y in (0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, 5e-324, 1e308):
        for x in (0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, 5e-324, -1e308):
            found, expected = MODEL.atan2(y, x), math.atan2(y, x)
            assert (found, math.copysign(1, found)) == (expected, math.copysign(1, expected)), (y, x)


def test_logarithms_of_the_table() -> None:
    with localcontext(prec=60):
        exact = [(1 + Decimal(2) ** -index).ln() * 2**96 for index in range(33)]
        expected = [f"{int(logarithm.to_integral_value()):024x}" for logarithm in exact]
    assert re.findall(r'x"([0-9a-f]{24})"', TABLE.read_text(encoding="utf-8")) == expected
