"""CORDIC and the conversions of double precision in simulation, over their generics, against exact arithmetic."""

from __future__ import annotations

import math
import random
import struct
from fractions import Fraction
from pathlib import Path

import pytest

from tests.hdl.ghdl import CORES, Generic, Library, core_files
from tests.seeds import seeded

SEED = seeded(1618)
PI = Fraction("3.14159265358979323846264338327950288")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The library with the benches, beside `firm` in the same directory."""
    directory = tmp_path_factory.mktemp("acc")
    cores = ("acc/cordic/cordic", "acc/float64/float64")
    Library("firm", directory).analyse(core_files("axis/package", "sim/checker", "sim/host", "sim/operation", *cores))
    work = Library("work", directory)
    work.analyse([bench for core in cores for bench in sorted((CORES / core).parent.glob("tb/*.vhd"))])
    return work


def run(library: Library, bench: str, generics: dict[str, Generic]) -> None:
    result = library.run(bench, generics)
    assert result.exit_code == 0, result.output


def files(folder: Path, *names: str) -> dict[str, Generic]:
    """The generic of each file of a bench."""
    return {name.upper(): str(folder / f"{name}.txt") for name in names}


def binary(number: int, width: int) -> str:
    return format(number & ((1 << width) - 1), f"0{width}b")


def signed(digits: str) -> int:
    return int(digits, 2) - (int(digits[0]) << len(digits))


def float_bits(number: float) -> str:
    return binary(int.from_bytes(struct.pack("<d", number), "little"), 64)


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("width", "fraction", "iterations"),
    [(64, 60, 35), (16, 8, 8), (24, 16, 12), (40, 64, 64), (80, 62, 50), (33, 20, 2)],
)
def test_cordic(library: Library, tmp_path: Path, width: int, fraction: int, iterations: int) -> None:
    print(f"seed {SEED}")
    generator = random.Random(SEED)
    # Twice a vector's length must have room.
    limit = int(2 ** (width - 1) / 1.6468 / math.sqrt(2)) - iterations
    vectors = [(0, 0), (limit, 0), (-limit, 0), (0, limit), (0, -limit), (limit, limit), (-limit, limit)]
    vectors += [(-limit, -limit), (limit, -limit), (1, 0), (0, -1)]
    vectors += [(generator.randint(-limit, limit), generator.randint(-limit, limit)) for _ in range(60)]
    (tmp_path / "vectors.txt").write_text("".join(f"{binary(x, width)} {binary(y, width)}\n" for x, y in vectors))
    generics = {"WIDTH": width, "FRACTION": fraction, "ITERATIONS": iterations}
    run(library, "firm_cordic_tb", {**generics, **files(tmp_path, "vectors", "results")})
    results = [line.split() for line in (tmp_path / "results.txt").read_text().splitlines()]
    assert len(results) == len(vectors)

    gain = math.prod(math.sqrt(1 + 4.0**-i) for i in range(iterations))
    for (x, y), (magnitude_digits, angle_digits) in zip(vectors, results, strict=True):
        magnitude, angle = signed(magnitude_digits), Fraction(signed(angle_digits), 2**fraction)
        length = math.hypot(x, y)
        # The last rotation is left over; every rotation rounds angle and length by a unit at most.
        left = 2.0 ** (1 - iterations)
        slack = iterations * (2.0**-fraction + 2 / max(length, 1)) + 1e-15
        if 0 in (x, y) or abs(x) == abs(y):
            assert abs(float(angle) - math.atan2(y, x)) <= 2.0 ** (1 - fraction) + 1e-15
        else:
            assert abs(float(angle) - math.atan2(y, x)) <= left + slack
        shortfall = length * gain * (left**2 / 2 + 1e-15) + 2 * iterations
        assert abs(magnitude - length * gain) <= shortfall


def test_vectors_on_the_axes_have_the_same_length_and_exact_angles(library: Library, tmp_path: Path) -> None:
    """Lengths 1 to 40, where roundings differ most, and the longest ones."""
    lengths = [*range(1, 41), *(2**61 + beside for beside in (-1, 0, 1))]
    vectors = [vector for n in lengths for vector in ((n, 0), (0, n), (-n, 0), (0, -n))]
    (tmp_path / "vectors.txt").write_text("".join(f"{binary(x, 64)} {binary(y, 64)}\n" for x, y in vectors))
    run(library, "firm_cordic_tb", files(tmp_path, "vectors", "results"))
    results = [tuple(map(signed, line.split())) for line in (tmp_path / "results.txt").read_text().splitlines()]
    half_pi = 2 * round(PI / 4 * 2**60)
    for first, second, third, fourth in zip(*[iter(results)] * 4, strict=True):
        assert {second[0], third[0], fourth[0]} == {first[0]}
        assert (first[1], second[1], third[1], fourth[1]) == (0, half_pi, 2 * half_pi, -half_pi)


def test_mirrored_vectors_have_the_same_length_and_mirrored_angles(library: Library, tmp_path: Path) -> None:
    print(f"seed {SEED}")
    generator = random.Random(SEED)
    vectors = []
    for _ in range(20):
        x, y = generator.randint(1, 2**60), generator.randint(1, 2**60)
        vectors += [(x, y), (-x, y), (-x, -y), (x, -y)]
    (tmp_path / "vectors.txt").write_text("".join(f"{binary(x, 64)} {binary(y, 64)}\n" for x, y in vectors))
    run(library, "firm_cordic_tb", files(tmp_path, "vectors", "results"))
    results = [tuple(map(signed, line.split())) for line in (tmp_path / "results.txt").read_text().splitlines()]
    for first, second, third, fourth in zip(*[iter(results)] * 4, strict=True):
        assert len({first[0], second[0], third[0], fourth[0]}) == 1
        assert fourth[1] == -first[1] and third[1] == -second[1]
        # pi is four times the angle of the first rotation.
        assert first[1] + second[1] == 4 * round(PI / 4 * 2**60)


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("fraction", "iterations"), [(29, 29), (8, 8), (58, 58), (40, 20), (20, 2)])
def test_sine_and_cosine(library: Library, tmp_path: Path, fraction: int, iterations: int) -> None:
    print(f"seed {SEED}")
    generator = random.Random(SEED)
    unit = 2**fraction
    angles = [0, 1, -1, 4 * unit - 1, -4 * unit]
    for eighths in range(-8, 9):
        angles += [round(PI / 8 * eighths * unit) + beside for beside in (-1, 0, 1)]
    # The angles that are folded begin here.
    angles += [sign * 13 * unit // 8 + beside for sign in (-1, 1) for beside in (-1, 0, 1)]
    angles += [generator.randint(-4 * unit, 4 * unit - 1) for _ in range(100)]
    (tmp_path / "vectors.txt").write_text("".join(f"{binary(angle, fraction + 3)}\n" for angle in angles))
    generics: dict[str, Generic] = {"OPERATION": "sincos", "FRACTION": fraction, "ITERATIONS": iterations}
    run(library, "firm_cordic_tb", {**generics, **files(tmp_path, "vectors", "results")})
    results = [tuple(map(signed, line.split())) for line in (tmp_path / "results.txt").read_text().splitlines()]
    assert len(results) == len(angles)
    # The last rotation is left over; the gain of those that are left out, and the rounding of all, come on top.
    bound = 2.0 ** (1 - iterations) + 4.0**-iterations + 2 / unit + 1e-15
    for angle, (cosine, sine) in zip(angles, results, strict=True):
        assert abs(cosine / unit - math.cos(angle / unit)) <= bound
        assert abs(sine / unit - math.sin(angle / unit)) <= bound


def fixed_of(number: float, width: int, fraction: int) -> tuple[int, bool, bool]:
    """What firm_float64_to_fixed makes of a number, by exact arithmetic: the result, overflow, undefined."""
    limit = 2 ** (width - 1) - 1
    if math.isnan(number):
        return 0, False, True
    magnitude = limit + 1 if math.isinf(number) else math.floor(abs(Fraction(number)) * 2**fraction + Fraction(1, 2))
    result = min(magnitude, limit)
    return -result if math.copysign(1, number) < 0 else result, magnitude > limit, False


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("width", "fraction"), [(32, 29), (64, 60), (64, 0), (2, 0), (12, 10), (54, 512), (30, 20)])
def test_float64_to_fixed(library: Library, tmp_path: Path, width: int, fraction: int) -> None:
    print(f"seed {SEED}")
    generator = random.Random(SEED)
    limit = Fraction(2) ** (width - 1 - fraction)
    numbers = [0.0, -0.0, 2.0**-1074, -(2.0**-1022), 1.7e308, -1.7e308, math.inf, -math.inf, math.nan, -math.nan]
    # The unit, its half and what rounds up to it; the limit and what lies beside it.
    unit = 2.0**-fraction
    numbers += [unit, unit / 2, math.nextafter(unit / 2, 0), 1.5 * unit, -1.5 * unit, -unit / 2]
    top = float(limit)
    numbers += [top, -top, math.nextafter(top, 0), float(limit - Fraction(unit)), float(limit - Fraction(unit) / 2)]
    numbers += [math.ldexp(generator.uniform(-1, 1), width - fraction - generator.randint(-2, 70)) for _ in range(300)]
    (tmp_path / "vectors.txt").write_text("".join(f"{float_bits(number)}\n" for number in numbers))
    generics = {"WIDTH": width, "FRACTION": fraction}
    run(library, "firm_float64_to_fixed_tb", {**generics, **files(tmp_path, "vectors", "results")})
    lines = [line.split() for line in (tmp_path / "results.txt").read_text().splitlines()]
    results = [(signed(digits), overflow == "1", undefined == "1") for digits, overflow, undefined in lines]
    assert results == [fixed_of(number, width, fraction) for number in numbers]


def block_of(numbers: list[float], fraction: int) -> tuple[list[int], int, bool, bool]:
    """What firm_float64_to_block makes of them, by exact arithmetic."""
    exponents = [int(float_bits(number)[1:12], 2) for number in numbers]
    largest = max(exponents)
    if largest in (0, 2047):
        return [0] * len(numbers), largest, largest == 2047, largest == 0
    results = []
    for number in numbers:
        exact = abs(Fraction(number)) * Fraction(2) ** (1022 - largest + fraction)
        magnitude = math.floor(exact + Fraction(1, 2))
        results.append(-magnitude if number < 0 else magnitude)
    return results, largest, False, False


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("count", "block_fraction", "fixed_fraction"), [(4, 60, 60), (1, 53, 0), (2, 62, 63), (5, 56, 512), (3, 61, 17)]
)
def test_float64(library: Library, tmp_path: Path, count: int, block_fraction: int, fixed_fraction: int) -> None:
    print(f"seed {SEED}")
    generator = random.Random(SEED)
    specials = (0.0, -0.0, 2.0**-1074, -(2.0**-1022), 1.7e308, -math.inf, math.nan, 1.0, -(1 - 2.0**-53))

    def number() -> float:
        if generator.random() < 0.2:
            return generator.choice(specials)
        return math.ldexp(
            generator.uniform(-1, 1), generator.choice((-1074, -1020, 0, 1, 1000)) - generator.randint(0, 66)
        )

    blocks = [[number() for _ in range(count)] for _ in range(200)]
    lines = ["".join(float_bits(value) for value in reversed(block)) for block in blocks]
    (tmp_path / "block_vectors.txt").write_text("\n".join(lines) + "\n")
    fixed = [0, 1, -1, 2**63 - 1, -(2**63), 2**53 + 1, 2**54 - 1, -(2**54 + 2), 3 << 53, 2**63 - 512, 2**63 - 513]
    fixed += [generator.randint(-(2**63), 2**63 - 1) >> generator.randint(0, 63) for _ in range(400)]
    (tmp_path / "fixed_vectors.txt").write_text("".join(f"{binary(value, 64)}\n" for value in fixed))

    generics = {"COUNT": count, "BLOCK_FRACTION": block_fraction, "FIXED_FRACTION": fixed_fraction}
    paths = files(tmp_path, "block_vectors", "block_results", "fixed_vectors", "fixed_results")
    run(library, "firm_float64_tb", {**generics, **paths})

    block_results = (tmp_path / "block_results.txt").read_text().splitlines()
    assert len(block_results) == len(blocks)
    for block, line in zip(blocks, block_results, strict=True):
        digits, exponent, undefined, zero = line.split()
        width = block_fraction + 1
        found = [signed(digits[k * width : (k + 1) * width]) for k in reversed(range(count))]
        expected, largest, is_undefined, is_zero = block_of(block, block_fraction)
        assert (int(exponent, 2), undefined == "1", zero == "1") == (largest, is_undefined, is_zero)
        assert is_undefined or found == expected
    fixed_results = (tmp_path / "fixed_results.txt").read_text().splitlines()
    # Python rounds int / int to nearest, ties to even; all results are normal numbers.
    assert fixed_results == [float_bits(value / 2**fixed_fraction) for value in fixed]


def own_data(core: str, name: str) -> list[list[str]]:
    """The words of each line of a file of a core's own bench."""
    return [line.split() for line in (CORES / "acc" / core / "tb" / "data" / f"{name}.txt").read_text().splitlines()]


def test_the_results_that_the_cores_own_benches_expect_are_right() -> None:
    turns = zip(own_data("cordic", "angles"), own_data("cordic", "angles_expected"), strict=True)
    for (angle,), (cosine, sine) in turns:
        turned = signed(angle) / 2**29
        assert abs(signed(cosine) / 2**29 - math.cos(turned)) < 2**-27
        assert abs(signed(sine) / 2**29 - math.sin(turned)) < 2**-27
    gain = math.prod(math.sqrt(1 + 4.0**-i) for i in range(35))
    vectors = zip(own_data("cordic", "vectors"), own_data("cordic", "vectors_expected"), strict=True)
    for (x, y), (magnitude, angle) in vectors:
        assert abs(signed(magnitude) - math.hypot(signed(x), signed(y)) * gain) <= 2**-33 * 2**60 + 70
        expected = math.atan2(signed(y), signed(x))
        assert abs(signed(angle) / 2**60 - expected) < 2**-32
    blocks = zip(own_data("float64", "block_vectors"), own_data("float64", "block_expected"), strict=True)
    for (numbers,), (digits, exponent, undefined, zero) in blocks:
        values = [struct.unpack(">d", int(numbers[k : k + 64], 2).to_bytes(8))[0] for k in (192, 128, 64, 0)]
        expected_block, largest, is_undefined, is_zero = block_of(values, 60)
        assert (int(exponent, 2), undefined == "1", zero == "1") == (largest, is_undefined, is_zero)
        assert is_undefined or [signed(digits[k : k + 61]) for k in (183, 122, 61, 0)] == expected_block
