"""robot:acc:firm_float in simulation: every operation over 3,000 operands against NumPy or exact arithmetic."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cores import operations
from tests.cores.floats import BITS, MODEL, SEED, SIZES, TYPES, Numbers, analysed, check, operate, size_of
from tests.cores.operators import FORMS, Form
from tests.hdl.ghdl import CORES, Generic, Library, core_files

FLOAT = CORES / "acc" / "float"
COUNT = 3000
# Of operations that take about 100 cycles.
MOST = 10_000
# GHDL's memory grows with the cycles of the filter and of the controller, so their samples are in several runs.
PIECE = 500
PIECES = [0, *(pytest.param(piece, marks=pytest.mark.thorough) for piece in range(1, MOST // PIECE + 1))]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return analysed(tmp_path_factory.mktemp("float"))


OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
}


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("operation", OPERATIONS)
def test_results_are_those_of_numpy(library: Library, tmp_path: Path, operation: str, name: str) -> None:
    numbers = Numbers(name)
    rows = numbers.several(COUNT, 2)
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION=operation, **size_of(numbers))
    with np.errstate(all="ignore"):
        expected = OPERATIONS[operation](*(numbers.values(column) for column in zip(*rows, strict=True)))
    check(numbers, rows, found, expected)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("operation", ["add", "subtract", "multiply"])
def test_results_of_short_forms_are_those_of_numpy(library: Library, tmp_path: Path, operation: str, name: str) -> None:
    numbers = Numbers(name)
    rows = numbers.several(COUNT, 2)
    generics = {**size_of(numbers), "IS_SHORT": True}
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION=operation, **generics)
    with np.errstate(all="ignore"):
        expected = OPERATIONS[operation](*(numbers.values(column) for column in zip(*rows, strict=True)))
    check(numbers, rows, found, expected)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", SIZES)
def test_square_roots_are_those_of_numpy(library: Library, tmp_path: Path, name: str) -> None:
    numbers = Numbers(name)
    rows = numbers.several(COUNT, 1)
    for row in rows[COUNT // 2 :]:
        # Squares and their neighbours; few roots of negative numbers.
        with np.errstate(all="ignore"):
            square = np.square(numbers.values([row[0] >> numbers.mantissa_bits // 2 << numbers.mantissa_bits // 2]))
        row[0] = int(square.view(BITS[name])[0]) + numbers.random.choice((0, 0, 0, 1)) & (1 << (numbers.width - 1)) - 1
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION="square_root", **size_of(numbers))
    with np.errstate(all="ignore"):
        check(numbers, rows, found, np.sqrt(numbers.values(row[0] for row in rows)))


@pytest.mark.parametrize("name", SIZES)
def test_comparisons_are_those_of_numpy(library: Library, tmp_path: Path, name: str) -> None:
    numbers = Numbers(name)
    rows = numbers.several(COUNT, 2)
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION="compare", **size_of(numbers))
    a, b = (numbers.values(column) for column in zip(*rows, strict=True))
    with np.errstate(all="ignore"):
        expected = (a < b) * 8 | (a == b) * 4 | (a > b) * 2 | (np.isnan(a) | np.isnan(b)) * 1
    assert found == expected.tolist()


@pytest.mark.parametrize("name", SIZES)
def test_a_clamp_is_that_of_numpy(library: Library, tmp_path: Path, name: str) -> None:
    numbers = Numbers(name)
    rows = numbers.several(COUNT, 3)
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION="clamp", **size_of(numbers))
    number, low, high = (numbers.values(column) for column in zip(*rows, strict=True))
    with np.errstate(all="ignore"):
        clipped = np.minimum(np.maximum(number, low), high)
    expected = np.array([MODEL.clamp(*map(float, row)) for row in zip(number, low, high, strict=True)], TYPES[name])
    check(numbers, rows, found, expected)
    # NumPy may choose either zero.
    np.testing.assert_array_equal(expected, clipped)


@pytest.mark.parametrize("name", SIZES)
def test_a_product_and_sum_is_rounded_once(library: Library, tmp_path: Path, name: str) -> None:
    numbers = Numbers(name)
    rows = numbers.several(COUNT, 3)
    with np.errstate(all="ignore"):
        for row in rows[COUNT // 2 :]:
            # The sum cancels the product, or nearly.
            if numbers.random.random() < 0.5:
                product = np.multiply(*numbers.values(row[:2]))
                row[2] = numbers.beside(int(product.view(BITS[name])))
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION="multiply_add", **size_of(numbers))
    size = MODEL.Format(*SIZES[name])
    expected = [MODEL.multiply_add(*map(float, numbers.values(row)), size) for row in rows]
    check(numbers, rows, found, np.array(expected, dtype=TYPES[name]))


@pytest.mark.parametrize(("name", "other"), [("float64", "float32"), ("float32", "float64")])
def test_conversions_between_sizes_are_those_of_numpy(library: Library, tmp_path: Path, name: str, other: str) -> None:
    numbers, results = Numbers(name), Numbers(other)
    rows = numbers.several(COUNT, 1)
    if name == "float64":
        # Numbers beside those of float32, and beside the middle of two.
        for row in rows[COUNT // 2 :]:
            near = results.values([results.draw()]).astype(np.float64).view(np.uint64)[0]
            row[0] = int(near) ^ numbers.random.choice((0, 1, 1 << 28, 1 << 28 | 1))
    size = {"OUT_EXPONENT_BITS": results.exponent_bits, "OUT_MANTISSA_BITS": results.mantissa_bits}
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION="resize", **size_of(numbers), **size)
    with np.errstate(all="ignore"):
        check(results, rows, found, numbers.values(row[0] for row in rows).astype(TYPES[other]))


def samples(numbers: Numbers, operands: int, count: int) -> list[list[int]]:
    """Rows of finite numbers about 1, the last of which restarts in one row of 50."""
    rows = numbers.random.choices((0, 1), (49, 1), k=count)
    several = ([numbers.random.gauss(0, 10) for _ in range(operands)] for _ in rows)
    return [
        [*(int(TYPES[numbers.name](number).view(BITS[numbers.name])) for number in row), restarts]
        for row, restarts in zip(several, rows, strict=True)
    ]


@pytest.mark.parametrize("piece", PIECES)
@pytest.mark.parametrize("name", SIZES)
def test_a_low_pass_is_its_model(library: Library, tmp_path: Path, name: str, piece: int) -> None:
    numbers, count = Numbers(name, piece), PIECE if piece else 100
    rows = samples(numbers, 2, count)
    for row in rows:
        row[1] = int(TYPES[name](numbers.random.random()).view(BITS[name]))
    rows[count // 5][0] = rows[count // 5][0] | numbers.specials[15]  # NaN, until the next restart
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION="low_pass", **size_of(numbers))
    model = MODEL.LowPass(MODEL.Format(*SIZES[name]))
    expected = [model.step(*map(float, numbers.values(row[:2])), restarts=bool(row[2])) for row in rows]
    check(numbers, rows, found, np.array(expected, dtype=TYPES[name]))
    assert np.isnan(expected).any()


@pytest.mark.one_in(2)
@pytest.mark.parametrize("piece", PIECES)
@pytest.mark.parametrize("name", SIZES)
def test_a_pid_controller_is_its_model(library: Library, tmp_path: Path, name: str, piece: int) -> None:
    numbers, count = Numbers(name, piece), PIECE if piece else 100
    rows = samples(numbers, 7, count)
    limits = (int(TYPES[name](limit).view(BITS[name])) for limit in (-200, 250))
    low, high = limits
    for row in rows:
        row[5:7] = low, high
    rows[count // 5][1] = rows[count // 5][1] | numbers.specials[15]  # NaN, which the integral survives
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION="pid", **size_of(numbers))
    model = MODEL.Pid(MODEL.Format(*SIZES[name]))
    expected = []
    for row in rows:
        setpoint, measured, kp, ki, kd, *ends = map(float, numbers.values(row[:7]))
        gains = (kp, ki, kd)
        expected.append(model.step(setpoint, measured, gains, tuple(ends), restarts=bool(row[7])))
    check(numbers, rows, found, np.array(expected, dtype=TYPES[name]))
    inside = sum(-200 < output < 250 for output in expected)
    assert count // 10 < inside < count * 9 // 10
    assert np.isnan(expected).sum() == 2


FIXED = [(32, 0, True), (64, 0, True), (64, 0, False), (8, 0, False), (16, 8, True), (40, 30, True), (128, 100, True)]


@pytest.mark.one_in(3, 3)
@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize(("width", "fraction", "is_signed"), FIXED)
def test_conversions_from_fixed_point(
    library: Library, tmp_path: Path, name: str, width: int, fraction: int, is_signed: bool
) -> None:
    numbers = Numbers(name)
    ends = [0, 1, 2, 3, 2**width - 1, 2 ** (width - 1), 2 ** (width - 1) - 1, 2 ** (width - 1) + 1]
    rows = [[end] for end in ends]
    while len(rows) < COUNT:
        bits = numbers.random.getrandbits(width) >> numbers.random.randrange(width)
        rows.append([numbers.random.choice((bits, 2**width - 1 - bits))])
    generics = {"WIDTH": width, "FRACTION": fraction, "IS_SIGNED": is_signed}
    found, _ = operate(library, tmp_path, width, rows, OPERATION="from_fixed", **size_of(numbers), **generics)
    size = MODEL.Format(*SIZES[name])
    signed = [row[0] - (2**width if is_signed and row[0] >= 2 ** (width - 1) else 0) for row in rows]
    expected = np.array([MODEL.from_fixed(number, fraction, size) for number in signed], dtype=TYPES[name])
    check(numbers, rows, found, expected)
    if not fraction and width <= 64:
        # NumPy's conversion of its integers.
        integers = np.array(signed, dtype=np.int64 if is_signed else np.uint64)
        check(numbers, rows, found, integers.astype(TYPES[name]))


@pytest.mark.one_in(3, 3)
@pytest.mark.parametrize("truncates", [False, True])
@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize(("width", "fraction", "is_signed"), FIXED)
def test_conversions_to_fixed_point(
    library: Library, tmp_path: Path, name: str, width: int, fraction: int, is_signed: bool, truncates: bool
) -> None:
    numbers = Numbers(name)
    rows = numbers.several(COUNT // 2, 1)
    size = MODEL.Format(*SIZES[name])
    ends = [sign << bits for sign in (-1, 1) for bits in (width, width + 1)]
    halves_beside = [end + beside for end in ends for beside in range(-3, 4)]
    while len(rows) < COUNT:
        # Beside the ends, in range or a little beyond, often half a unit.
        halves = numbers.random.randint(-(2**width), 2 ** (width + 1)) >> numbers.random.randrange(width)
        halves = halves_beside.pop() if halves_beside else halves
        near = TYPES[name](MODEL.from_fixed(halves, fraction + 1, size))
        rows.append([int(near.view(BITS[name]))])
    generics = {"WIDTH": width, "FRACTION": fraction, "IS_SIGNED": is_signed, "TRUNCATES": truncates}
    found, _ = operate(library, tmp_path, numbers.width, rows, OPERATION="to_fixed", **size_of(numbers), **generics)
    expected = []
    for row in rows:
        number = float(numbers.values(row)[0])
        units, beyond, undefined = MODEL.to_fixed(number, width, fraction, is_signed=is_signed, truncates=truncates)
        expected.append((units % 2**width) << 2 | beyond << 1 | undefined)
    wrong = [
        (hex(row[0]), hex(bits), hex(right))
        for row, bits, right in zip(rows, found, expected, strict=True)
        if bits != right
    ]
    assert not wrong, (len(wrong), wrong[:10])


def bench_generics(form: Form) -> dict[str, Generic]:
    """The generics of the bench for an operator's form; a conversion between sizes has others than its entity."""
    exponent_bits, mantissa_bits = SIZES[form.size]
    other = SIZES["float32" if form.size == "float64" else "float64"]
    sizes = {"OUT_EXPONENT_BITS": other[0], "OUT_MANTISSA_BITS": other[1]}
    own = {} if form.operator == "resize" else form.facts["generics"]
    return {"EXPONENT_BITS": exponent_bits, "MANTISSA_BITS": mantissa_bits, **sizes, **own}


def measured(library: Library, folder: Path, form: Form, bits: int, count: int, **generics: Generic) -> Any:
    """Latency and number of all cycles for `count` times the same operands, of these bits; neither side stalls."""
    numbers = Numbers(form.size)
    width = int(generics.get("WIDTH", 32)) if form.operator == "from_fixed" else numbers.width
    rows = [[bits] * OPERANDS.get(form.operator, 1)] * count
    generics = {**bench_generics(form), **generics}
    _, report = operate(library, folder, width, rows, OPERATION=form.operator, STALLS=0, **generics)
    return map(int, re.findall(r"\d+", report.splitlines()[-1]))


def bits_of(form: Form, number: float) -> int:
    return int(TYPES[form.size](number).view(BITS[form.size]))


def usual(form: Form) -> int:
    """Operands whose latency is not an exception: those of an angle below 2**10 take longer than those of 0."""
    return bits_of(form, 1000.0) if form.operator == "sincos" else 0


@pytest.mark.one_in(3)
@pytest.mark.parametrize("form", FORMS, ids=str)
def test_latency_and_throughput(library: Library, tmp_path: Path, form: Form) -> None:
    latency, cycles = measured(library, tmp_path, form, usual(form), 50)
    assert latency == form.latency(32)
    assert cycles == latency + form.facts["interval"] * 49 + 1


@pytest.mark.parametrize("form", [form for form in FORMS if "longest" in form.facts], ids=str)
def test_the_longest_latency_is_that_of_the_smallest_numbers(library: Library, tmp_path: Path, form: Form) -> None:
    """The longest one of sine and cosine is that of the largest angles."""
    latency, _ = measured(library, tmp_path, form, bits_of(form, 2.0**127) if form.operator == "sincos" else 1, 1)
    assert latency == form.facts["longest"]


WIDTHS_OF_CONVERSIONS = [2, 4, 5, 13, 14, 16, 17, 61, 62, 64, 65, 128]


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", WIDTHS_OF_CONVERSIONS)
@pytest.mark.parametrize("form", [form for form in FORMS if form.operator in ("from_fixed", "to_fixed")], ids=str)
def test_latency_of_a_conversion_by_width(library: Library, tmp_path: Path, form: Form, width: int) -> None:
    latency, _ = measured(library, tmp_path, form, 1, 1, WIDTH=width)
    assert latency == form.latency(width)


ENTITIES = {
    "multiply": "firm_float_multiply",
    "add": "firm_float_add",
    "multiply_add": "firm_float_multiply_add",
    "divide": "firm_float_divide",
    "square_root": "firm_float_square_root",
    "compare": "firm_float_compare",
    "clamp": "firm_float_clamp",
    "to_fixed": "firm_float_to_fixed",
    "from_fixed": "firm_fixed_to_float",
    "sincos": "firm_float_sincos",
    "atan2": "firm_float_atan2",
    "exp": "firm_float_exp",
    "log": "firm_float_log",
    "low_pass": "firm_float_low_pass",
    "pid": "firm_float_pid",
}
OPERANDS = {"multiply": 2, "add": 2, "divide": 2, "compare": 2, "multiply_add": 3, "clamp": 3, "low_pass": 3, "pid": 8}
OPERANDS["atan2"] = 2


@pytest.mark.one_in(3)
@pytest.mark.parametrize("operation", ENTITIES)
def test_netlists_have_no_latches_and_the_same_results(library: Library, tmp_path: Path, operation: str) -> None:
    numbers = Numbers("float32")
    count = 10 if operation in ("sincos", "atan2", "exp", "log", "low_pass", "pid") else 300
    rows = random.Random(SEED).sample(numbers.several(2000, OPERANDS.get(operation, 1)), count)
    sizes = size_of(numbers)
    results, _ = operate(library, tmp_path, 32, rows, OPERATION=operation, **sizes)
    assert library.latches(ENTITIES[operation], sizes) == []
    netlist = Library("firm", tmp_path)
    files = core_files(*operations.CORES_OF_BENCHES, "acc/cordic/cordic", "acc/float/float")
    netlist.analyse(files)
    netlist.replace_by_netlist(ENTITIES[operation], sizes)
    # Those that may use the replaced entity.
    later = next(number for number, file in enumerate(files, 1) if file.stem == ENTITIES[operation])
    netlist.analyse([*files[later:], *core_files("acc/float/float", fileset="tb")])
    assert operate(netlist, tmp_path, 32, rows, OPERATION=operation, **sizes)[0] == results


def test_the_model_has_the_results_of_numpy() -> None:
    numbers = Numbers("float32")
    for row in numbers.several(2000, 2):
        a, b = map(float, numbers.values(row))
        with np.errstate(all="ignore"):
            product = float(np.float32(a) * np.float32(b))
        if not math.isnan(product):
            assert MODEL.multiply_add(a, b, -0.0, MODEL.FLOAT32) == product


def own_data(name: str) -> list[str]:
    return (FLOAT / "tb" / "data" / f"{name}.txt").read_text().split()


def test_the_results_that_the_own_bench_expects_are_right() -> None:
    numbers = Numbers("float64")
    rows = [[int(line[k : k + 64], 2) for k in (0, 64, 128)] for line in own_data("vectors")]
    expected = [MODEL.multiply_add(*map(float, numbers.values(row))) for row in rows]
    check(numbers, rows, [int(line, 2) for line in own_data("expected")], np.array(expected))
