"""robot:acc:firm_fixed in simulation: every operation over 3,000 operands against exact arithmetic."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.cores import operations
from tests.cores.models import load_model
from tests.hdl.ghdl import CORES, Generic, Library, core_files
from tests.seeds import seeded

FIXED = CORES / "acc" / "fixed"
SEED = seeded(1414)
COUNT = 3000
MODEL = load_model("fixed")

# Bits and fraction bits of both operands and of the result.
SIZES = [
    ((32, 16), (32, 16), (32, 16)),
    ((16, 15), (16, 15), (16, 15)),
    ((8, 0), (12, 4), (10, 9)),
    ((24, 20), (10, 0), (40, 3)),
    ((2, 0), (3, 1), (5, 12)),
    ((64, 32), (64, 32), (64, 32)),
]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    found = Library("firm", tmp_path_factory.mktemp("fixed"))
    found.analyse(core_files(*operations.CORES_OF_BENCHES, "acc/fixed/fixed"))
    found.analyse(core_files("acc/fixed/fixed", fileset="tb"))
    return found


def drawn(generator: random.Random, width: int) -> int:
    """A number: an end of the range, one beside zero, or any of any size."""
    ends = (-(2 ** (width - 1)), 2 ** (width - 1) - 1, -1, 0, 1)
    if generator.random() < 0.2:
        return generator.choice(ends)
    return generator.randint(*ends[:2]) >> generator.randrange(width)


def generics_of(a: Sequence[int], b: Sequence[int], out: Sequence[int]) -> dict[str, Generic]:
    return {
        f"{side}_{name}": bits
        for side, size in (("A", a), ("B", b), ("OUT", out))
        for name, bits in zip(("WIDTH", "FRACTION"), size, strict=True)
    }


def operate(
    library: Library, folder: Path, widths: Sequence[int], rows: Sequence[Sequence[int]], **generics: Generic
) -> tuple[list[int], str]:
    return operations.operate(library, "firm_fixed_tb", folder, widths, rows, SEED=SEED, **generics)


def check(rows: Sequence[Sequence[int]], found: Sequence[int], expected: Sequence[tuple[int, ...]], width: int) -> None:
    wanted = [(number % 2**width) << 2 | is_beyond << 1 | any(undefined) for number, is_beyond, *undefined in expected]
    wrong = [(row, bits, right) for row, bits, right in zip(rows, found, wanted, strict=True) if bits != right]
    assert not wrong, (len(wrong), wrong[:10])


@pytest.mark.parametrize("operation", ["add", "subtract"])
@pytest.mark.parametrize("width", [2, 16, 32, 64])
def test_sums_are_saturated(library: Library, tmp_path: Path, operation: str, width: int) -> None:
    generator = random.Random(f"{SEED} {width}")
    rows = [(drawn(generator, width), drawn(generator, width)) for _ in range(COUNT)]
    generics: dict[str, Generic] = {"A_WIDTH": width, "B_WIDTH": width, "OUT_WIDTH": width}
    found, _ = operate(library, tmp_path, (width, width), rows, OPERATION=operation, **generics)
    size, sign = MODEL.Format(width, 0), 1 if operation == "add" else -1
    check(rows, found, [size.fitted(a + sign * b) for a, b in rows], width)


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("a", "b", "out"), SIZES)
@pytest.mark.parametrize("operation", ["multiply", "divide"])
def test_products_and_quotients_are_rounded_once(
    library: Library,
    tmp_path: Path,
    operation: str,
    a: tuple[int, int],
    b: tuple[int, int],
    out: tuple[int, int],
) -> None:
    generator = random.Random(f"{SEED} {a} {b} {out}")
    count = COUNT if operation == "multiply" or a == SIZES[1][0] else COUNT // 10
    rows = [(drawn(generator, a[0]), drawn(generator, b[0])) for _ in range(count)]
    found, _ = operate(library, tmp_path, (a[0], b[0]), rows, OPERATION=operation, **generics_of(a, b, out))
    of_a, of_b, of_out = (MODEL.Format(*size) for size in (a, b, out))
    exact = [(of_a.exact(first), of_b.exact(second)) for first, second in rows]
    if operation == "multiply":
        expected = [of_out.fitted(first * second) for first, second in exact]
    else:
        expected = [of_out.quotient(first, second) for first, second in exact]
    check(rows, found, expected, out[0])


@pytest.mark.parametrize(
    ("size", "out"),
    [
        ((32, 16), (16, 8)),
        ((16, 8), (32, 20)),
        ((8, 7), (8, 0)),
        ((8, 0), (6, 6)),
        ((12, 11), (4, 10)),
        ((4, 30), (8, 2)),
    ],
)
def test_numbers_of_another_size(library: Library, tmp_path: Path, size: tuple[int, int], out: tuple[int, int]) -> None:
    generator = random.Random(f"{SEED} {size} {out}")
    rows = [(drawn(generator, size[0]),) for _ in range(COUNT)]
    found, _ = operate(library, tmp_path, size[:1], rows, OPERATION="resize", **generics_of(size, size, out))
    of_in, of_out = MODEL.Format(*size), MODEL.Format(*out)
    check(rows, found, [of_out.fitted(of_in.exact(number)) for (number,) in rows], out[0])


# In cycles, as docs/reference/arithmetic.md states them, and from one result to the next.
TIMES = {"add": (3, 1), "multiply": (4, 1), "divide": (53, 54), "resize": (2, 1)}


@pytest.mark.parametrize("operation", TIMES)
def test_latency_and_throughput(library: Library, tmp_path: Path, operation: str) -> None:
    rows = [(1, 1)[: 1 if operation == "resize" else 2]] * 50
    _, report = operate(library, tmp_path, (32, 32)[: len(rows[0])], rows, OPERATION=operation, STALLS=0)
    latency, cycles = map(int, re.findall(r"\d+", report.splitlines()[-1]))
    assert latency == TIMES[operation][0]
    assert cycles == latency + TIMES[operation][1] * (len(rows) - 1) + 1


# Their netlists include firm_fixed_resize.
@pytest.mark.parametrize("operation", ["add", "multiply", "divide"])
def test_netlists_have_no_latches_and_the_same_results(library: Library, tmp_path: Path, operation: str) -> None:
    entity = f"firm_fixed_{operation}"
    generator = random.Random(SEED)
    rows = [(drawn(generator, 16), drawn(generator, 16)) for _ in range(200)]
    sizes = generics_of((16, 12), (16, 10), (16, 8))
    generics = {"WIDTH": 16} if operation == "add" else sizes
    results, _ = operate(library, tmp_path, (16, 16), rows, OPERATION=operation, **sizes)
    assert library.latches(entity, generics) == []
    netlist = Library("firm", tmp_path)
    netlist.analyse(core_files(*operations.CORES_OF_BENCHES, "acc/fixed/fixed"))
    netlist.replace_by_netlist(entity, generics)
    netlist.analyse(core_files("acc/fixed/fixed", fileset="tb"))
    assert operate(netlist, tmp_path, (16, 16), rows, OPERATION=operation, **sizes)[0] == results


def test_the_results_that_the_own_bench_expects_are_right() -> None:
    size = MODEL.Format()
    vectors, expected = (
        (FIXED / "tb" / "data" / f"{name}.txt").read_text().split() for name in ("vectors", "expected")
    )
    rows = [[int(line[k : k + 32], 2) - (int(line[k]) << 32) for k in (0, 32)] for line in vectors]
    found = [size.fitted(size.exact(a) * size.exact(b)) for a, b in rows]
    check(rows, [int(line, 2) for line in expected], found, 32)
