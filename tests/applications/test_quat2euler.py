"""quat2euler in simulation: the RTL and its synthesised netlist against the bit-true model, and its cycles."""

from __future__ import annotations

import importlib.util
import math
import random
import re
import shutil
import struct
import subprocess
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from types import ModuleType

import pytest

from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

ROOT = Path(__file__).parents[2]
SPEC = ROOT / "specs" / "quat2euler"
FIRM_SOURCES = core_files("acc/cordic/cordic", "acc/float64/float64")
TABLE = FIRM_SOURCES[0]
TOP = SPEC / "rtl" / "quat2euler.vhd"
BENCH = SPEC / "tb" / "quat2euler_tb.vhd"
VERILOG_BENCH = SPEC / "tb" / "quat2euler_netlist_tb.v"
SEED = seeded(4711)
# A frame of a Quaternion in ROS 1: id, length and 32 bytes.
FRAME_BYTES = 37

Quaternion = tuple[float, float, float, float]


def load_model() -> ModuleType:
    module_spec = importlib.util.spec_from_file_location("quat2euler_model", SPEC / "model.py")
    assert module_spec and module_spec.loader
    module = importlib.util.module_from_spec(module_spec)
    module_spec.loader.exec_module(module)
    return module


MODEL = load_model()


@pytest.fixture(scope="module")
def rtl(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The library with the accelerator and its bench, beside `firm` in the same directory."""
    directory = tmp_path_factory.mktemp("rtl")
    Library("firm", directory).analyse(FIRM_SOURCES)
    work = Library("work", directory)
    work.analyse([TOP, BENCH])
    return work


def quaternions(count: int) -> list[Quaternion]:
    """Specials, then quaternions of which some have components of very different size."""
    generator = random.Random(SEED)
    nan, inf, tiny, small = math.nan, math.inf, 2.0**-1074, 2.0**-1022
    root = math.sqrt(0.5)
    result: list[Quaternion] = [
        (0.0, 0.0, 0.0, 1.0),
        (0.0, 0.0, 0.0, 0.0),
        (-0.0, -0.0, -0.0, -0.0),
        (nan, 0.0, 0.0, 1.0),
        (0.0, -nan, 0.0, 1.0),
        (0.0, 0.0, inf, 1.0),
        (0.0, 0.0, 0.0, -inf),
        (tiny, -tiny, tiny, small - tiny),
        (small, tiny, small / 2, -small),
        (1e300, -1e308, 1.7e308, 1.1e308),
        (1e-300, 1e-308, -2e-300, 1.1e-308),
        (0.0, root, 0.0, root),
        (root, -root, 0.0, 0.0),
        (1.0, -1.0, 1.0, -1.0),
        (1.0, 1.0, -1.0, -1.0),
        # What is aligned away: the last unit, half of it, less than half of it.
        (1.0, 2.0**-60, -(2.0**-61), 2.0**-62),
        (1.0, 3 * 2.0**-62, -3 * 2.0**-62, 2.0**-200),
    ]
    for sign in (1.0, -1.0):
        result += [(sign, 0.0, 0.0, 0.0), (0.0, sign, 0.0, 0.0), (0.0, 0.0, sign, 0.0), (0.0, 0.0, 0.0, sign)]
    while len(result) < count:
        spread = generator.choice((0, 0, 10, 70))
        exponent = generator.choice((0, 0, -1000, 1000))
        x, y, z, w = (math.ldexp(generator.gauss(0, 1), exponent - generator.randint(0, spread)) for _ in range(4))
        result.append((x, y, z, w))
    return result


def text(numbers: Sequence[float]) -> str:
    return "".join(struct.pack(">d", number).hex().upper() for number in numbers)


def check_bench(work: Library, vectors: Sequence[Quaternion], tmp_path: Path, **generics: int) -> str:
    """Run the bench, compare every bit with the model; what the bench prints."""
    (tmp_path / "vectors.txt").write_text("".join(f"{text(vector)}\n" for vector in vectors))
    files = {"VECTORS": str(tmp_path / "vectors.txt"), "RESULTS": str(tmp_path / "results.txt")}
    result = work.run("quat2euler_tb", {**generics, **files})
    print(result.output)
    assert result.exit_code == 0, result.output
    results = (tmp_path / "results.txt").read_text().split()
    assert results == [text(MODEL.quaternion_to_euler(*vector)) for vector in vectors]
    return result.output


def test_back_to_back_frames_never_wait(rtl: Library, tmp_path: Path) -> None:
    """A message with every frame of a stream of 8 bits: at most 92 cycles latency, none taken late."""
    bounds = {"MAX_LATENCY": 92, "MAX_INTERVAL": FRAME_BYTES}
    report = check_bench(rtl, quaternions(400), tmp_path, SPACING=FRAME_BYTES, **bounds)
    assert "latency 92 to 92, longest interval 37 cycles" in report


def test_full_throughput(rtl: Library, tmp_path: Path) -> None:
    """A message is always waiting; it is taken early, so part of its latency is waiting inside."""
    report = check_bench(rtl, quaternions(400), tmp_path, MAX_INTERVAL=FRAME_BYTES)
    assert "longest interval 37 cycles" in report


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize(
    ("seed", "stall_in", "stall_out"), [(1, 50, 50), (2, 98, 0), (3, 0, 98), (4, 97, 97), (5, 90, 99)]
)
def test_random_stalls(rtl: Library, tmp_path: Path, seed: int, stall_in: int, stall_out: int) -> None:
    check_bench(rtl, quaternions(300), tmp_path, SEED=seed, STALL_IN=stall_in, STALL_OUT=stall_out)


@pytest.mark.parametrize(
    ("generics", "message"),
    [
        ({"MAX_LATENCY": 91}, "latency 92 exceeds 91"),
        ({"SPACING": 40, "MAX_INTERVAL": 39}, "interval 40 exceeds 39"),
    ],
)
def test_the_bench_fails_on_a_slow_accelerator(
    rtl: Library, tmp_path: Path, generics: dict[str, int], message: str
) -> None:
    with pytest.raises(AssertionError, match=message):
        check_bench(rtl, quaternions(5)[:3], tmp_path, **{"SPACING": 100, **generics})


@pytest.fixture(scope="module")
def netlists(rtl: Library) -> dict[str, str]:
    """What `ghdl --synth` makes of the top, in VHDL and in Verilog."""
    return {language: rtl.synthesise("quat2euler", language=language) for language in ("vhdl", "verilog")}


def test_synthesis_makes_no_latch(rtl: Library, netlists: dict[str, str]) -> None:
    assert rtl.latches("quat2euler") == []
    assert not [language for language, netlist in netlists.items() if "latch" in netlist.lower()]


def test_the_verilog_netlist_is_verilog(netlists: dict[str, str]) -> None:
    """ghdl 2.0 copies `abs` over as VHDL, wide constants as strings, and shifts signed numbers without their sign."""
    assert "std_logic" not in netlists["verilog"]
    assert '"' not in netlists["verilog"]
    assert not re.search(r"\$signed\([^;]*>>[^>]", netlists["verilog"])


def test_the_netlist_is_the_model(netlists: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "netlist.vhd").write_text(netlists["vhdl"])
    # The netlist repeats the entity with its use clause.
    Library("firm", tmp_path).analyse([TABLE])
    work = Library("work", tmp_path)
    work.analyse([tmp_path / "netlist.vhd", BENCH])
    check_bench(work, quaternions(60), tmp_path, SEED=6, STALL_IN=50, STALL_OUT=90)


@pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed")
def test_the_verilog_netlist_is_the_model(netlists: dict[str, str], tmp_path: Path) -> None:
    vectors = quaternions(200)
    (tmp_path / "netlist.v").write_text(netlists["verilog"])
    (tmp_path / "vectors.txt").write_text("".join(f"{text(vector)}\n" for vector in vectors))
    sources = [str(tmp_path / "netlist.v"), str(VERILOG_BENCH)]
    messages = f"-Pquat2euler_netlist_tb.MESSAGES={len(vectors)}"
    subprocess.run(["iverilog", messages, "-o", str(tmp_path / "netlist.vvp"), *sources], check=True)
    command = ["vvp", str(tmp_path / "netlist.vvp"), f"+vectors={tmp_path / 'vectors.txt'}"]
    result = subprocess.run(command, check=True, capture_output=True, text=True)
    assert result.stdout.upper().split() == [text(MODEL.quaternion_to_euler(*vector)) for vector in vectors]


def arctangent(index: int, precision: int) -> Fraction:
    """atan(2**-index) within 2**-precision; pi/4 by Euler's 5 atan(1/7) + 2 atan(3/79)."""

    def series(x: Fraction) -> Fraction:
        total, power, odd = Fraction(0), x, 1
        while abs(power) * 2**precision > 1:
            total += power / odd
            power *= -x * x
            odd += 2
        return total

    if index == 0:
        return 5 * series(Fraction(1, 7)) + 2 * series(Fraction(3, 79))
    return series(Fraction(1, 2**index))


def test_the_table_of_angles() -> None:
    """Every literal is exact to its last bit, and still is when rounded to any fraction that may use it."""
    entries = [int(digits, 16) for digits in re.findall(r'x"([0-9a-f]{24})"', TABLE.read_text())]
    assert len(entries) == 64
    for index, entry in enumerate(entries):
        exact = arctangent(index, 140)
        assert entry == round(exact * 2**96)
        for fraction in range(max(index, 8), 65):
            assert (entry + (1 << (95 - fraction))) >> (96 - fraction) == round(exact * 2**fraction)


def test_the_model_uses_the_same_angles() -> None:
    assert list(MODEL.ARCTANGENTS) == [round(arctangent(index, 140) * 2**60) for index in range(35)]


@pytest.mark.parametrize(
    ("entity", "generics", "message"),
    [
        ("firm_cordic_vectoring", {"FRACTION": 7, "ITERATIONS": 7}, "FRACTION is 7, legal: 8 to 64"),
        ("firm_cordic_vectoring", {"FRACTION": 65}, "FRACTION is 65, legal: 8 to 64"),
        ("firm_cordic_vectoring", {"ITERATIONS": 1}, r"ITERATIONS is 1, legal: 2 to FRACTION \(60\)"),
        ("firm_cordic_vectoring", {"FRACTION": 20, "ITERATIONS": 21}, "ITERATIONS is 21, legal: 2 to FRACTION"),
        ("firm_cordic_vectoring", {"WIDTH": 3}, "WIDTH is 3, legal: 4 or more"),
        ("firm_cordic_sincos", {"FRACTION": 7, "ITERATIONS": 7}, "FRACTION is 7, legal: 8 to 58"),
        ("firm_cordic_sincos", {"FRACTION": 59}, "FRACTION is 59, legal: 8 to 58"),
        ("firm_cordic_sincos", {"ITERATIONS": 30}, r"ITERATIONS is 30, legal: 2 to FRACTION \(29\)"),
        ("firm_float64_to_fixed", {"WIDTH": 65}, "WIDTH is 65, legal: 2 to 64"),
        ("firm_float64_to_fixed", {"WIDTH": 1, "FRACTION": 0}, "WIDTH is 1, legal: 2 to 64"),
        ("firm_float64_to_fixed", {"FRACTION": 513}, "FRACTION is 513, legal: 0 to 512"),
        ("firm_float64_to_block", {"FRACTION": 52}, "FRACTION is 52, legal: 53 to 62"),
        ("firm_float64_to_block", {"FRACTION": 63}, "FRACTION is 63, legal: 53 to 62"),
        ("firm_fixed_to_float64", {"FRACTION": 513}, "FRACTION is 513, legal: 0 to 512"),
    ],
)
def test_illegal_generics(rtl: Library, entity: str, generics: dict[str, int], message: str) -> None:
    result = Library("firm", rtl.directory).run(entity, generics, options=["--stop-time=1ns"])
    assert result.exit_code != 0
    assert re.search(f"{entity}: {message}", result.output)
