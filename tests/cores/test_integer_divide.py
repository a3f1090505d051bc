"""Integers are divided as Python divides them, and by zero as NumPy does."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from tests.cores import operations
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

SEED = seeded(20261201)
BENCH = "firm_integer_divide_tb"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    found = Library("firm", tmp_path_factory.mktemp("divide"))
    found.analyse(core_files(*operations.CORES_OF_BENCHES))
    found.analyse(core_files("acc/python/python")[1:])
    found.analyse(core_files("acc/python/python", fileset="tb"))
    return found


def pairs(width: int, count: int) -> list[tuple[int, int]]:
    """All pairs of the ends of the range and of numbers beside zero, and numbers of any size."""
    generator = random.Random(f"{SEED} {width}")
    least, most = -(1 << width - 1), (1 << width - 1) - 1
    ends = (least, least + 1, -2, -1, 0, 1, most - 1, most)
    found = [(a, b) for a in ends for b in ends if least <= min(a, b) and max(a, b) <= most]
    while len(found) < count:
        one, other = (generator.randint(least, most) >> generator.randrange(width) for _ in range(2))
        found.append((one, other))
    return found


def bits(a: int, b: int, width: int) -> int:
    quotient, remainder = divmod(a, b) if b else (0, 0)
    mask = (1 << width) - 1
    return (quotient & mask) << width | (remainder & mask)


@pytest.mark.parametrize(("width", "count"), [(4, 400), (16, 300), (32, 200), (64, 150), (65, 100)])
def test_quotients_and_remainders_are_those_of_python(library: Library, tmp_path: Path, width: int, count: int) -> None:
    rows = pairs(width, count)
    found, _ = operations.operate(library, BENCH, tmp_path, [width], rows, SEED=SEED, WIDTH=width)
    wrong = [row for row, result in zip(rows, found, strict=True) if result != bits(*row, width)]
    assert not wrong, wrong[:9]


def test_a_division_takes_a_cycle_for_each_digit(library: Library, tmp_path: Path) -> None:
    rows = [(7, 2)] * 20
    _, report = operations.operate(library, BENCH, tmp_path, [32], rows, SEED=SEED, WIDTH=32, STALLS=0)
    latency, cycles = map(int, re.findall(r"\d+", report.splitlines()[-1]))
    assert (latency, cycles) == (36, 36 + 19 * 37 + 1)


def test_the_netlist_has_no_latches_and_the_same_results(library: Library, tmp_path: Path) -> None:
    assert library.latches("firm_integer_divide", {"WIDTH": 16}) == []
    netlist = Library("firm", tmp_path)
    netlist.analyse(core_files(*operations.CORES_OF_BENCHES))
    netlist.analyse(core_files("acc/python/python")[1:])
    netlist.replace_by_netlist("firm_integer_divide", {"WIDTH": 16})
    netlist.analyse(core_files("acc/python/python", fileset="tb"))
    rows = pairs(16, 150)
    found, _ = operations.operate(netlist, BENCH, tmp_path, [16], rows, SEED=SEED, WIDTH=16)
    assert found == [bits(*row, 16) for row in rows]
