"""The two models of quat2euler against exact sums and `math`, and the C++ function against its model, bit for bit."""

from __future__ import annotations

import ctypes
import importlib.util
import itertools
import math
import random
import struct
import subprocess
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from types import ModuleType

import pytest

from tests.seeds import seeded

SPEC = Path(__file__).parents[2] / "specs" / "quat2euler"
SEED = seeded(20240607)
VECTORS = 10_000
QUIET_NAN = bytes.fromhex("7ff8000000000000")
SMALLEST_NORMAL = 2.0**-1022
SMALLEST = 2.0**-1074

Quaternion = tuple[float, float, float, float]
Angles = tuple[float, float, float]


def load(name: str) -> ModuleType:
    """A model of the specification's folder, which is no package."""
    module_spec = importlib.util.spec_from_file_location(name, SPEC / f"{name}.py")
    assert module_spec and module_spec.loader
    module = importlib.util.module_from_spec(module_spec)
    module_spec.loader.exec_module(module)
    return module


MODELS = {name: load(name) for name in ("model", "model_hls")}


@pytest.fixture(params=MODELS)
def model(request: pytest.FixtureRequest) -> ModuleType:
    return MODELS[request.param]


def reference(quaternion: Quaternion) -> Angles:
    """Roll, pitch and yaw from sums without rounding error; roll and yaw are not wrapped."""
    exponent = math.frexp(max(map(abs, quaternion)))[1]
    x, y, z, w = (Fraction(component) / Fraction(2) ** exponent for component in quaternion)
    p, q, r, s = (float(total) for total in (w + y, w - y, x + z, z - x))
    alpha, beta = math.atan2(r, q), math.atan2(s, p)
    pitch = 2 * math.atan2(math.hypot(p, s), math.hypot(q, r)) - math.pi / 2
    return alpha - beta, pitch, alpha + beta


def textbook(quaternion: Quaternion) -> Angles:
    """The formulas of every textbook, for unit quaternions away from the gimbal lock."""
    x, y, z, w = quaternion
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(2 * (w * y - z * x))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw


def error(angles: Sequence[float], expected: Sequence[float]) -> float:
    """The largest difference in rad, modulo a turn."""
    return max(abs(math.remainder(a - b, 2 * math.pi)) for a, b in zip(angles, expected, strict=True))


def bits(numbers: Sequence[float]) -> list[bytes]:
    return [struct.pack(">d", number) for number in numbers]


def unit_quaternions(generator: random.Random, count: int) -> list[Quaternion]:
    quaternions: list[Quaternion] = []
    for _ in range(count):
        x, y, z, w = (generator.gauss(0, 1) for _ in range(4))
        length = math.sqrt(x * x + y * y + z * z + w * w)
        quaternions.append((x / length, y / length, z / length, w / length))
    return quaternions


def near_lock(generator: random.Random, exponents: tuple[float, float]) -> Quaternion:
    """A unit quaternion whose distance from the gimbal lock is 10**exponent."""
    distance = 10 ** generator.uniform(*exponents)
    large, small = (generator.uniform(-math.pi, math.pi) for _ in range(2))
    p, s = math.sqrt(2) * math.cos(large), math.sqrt(2) * math.sin(large)
    q, r = distance * math.cos(small), distance * math.sin(small)
    if generator.random() < 0.5:
        p, q, r, s = q, p, s, r
    return (r - s) / 2, (p - q) / 2, (r + s) / 2, (p + q) / 2


def test_the_reference_agrees_with_the_textbook() -> None:
    print(f"seed {SEED}")
    for quaternion in unit_quaternions(random.Random(SEED), 1000):
        expected = textbook(quaternion)
        if abs(expected[1]) < 1.5:
            assert error(reference(quaternion), expected) < 1e-13


@pytest.mark.parametrize(("name", "bound"), [("model", 1.2e-10), ("model_hls", 2e-15)])
def test_unit_quaternions(name: str, bound: float) -> None:
    print(f"seed {SEED}")
    quaternions = unit_quaternions(random.Random(SEED), VECTORS)
    assert max(error(MODELS[name].quaternion_to_euler(*q), reference(q)) for q in quaternions) < bound


@pytest.mark.parametrize(("exponents", "bound"), [((-10, -6), 1e-8), ((-12, -10), 1e-6)])
def test_near_the_gimbal_lock(model: ModuleType, exponents: tuple[float, float], bound: float) -> None:
    """Down to 1e-12, where the rounding of x, y, z and w to 2**-60 begins to show."""
    print(f"seed {SEED}")
    generator = random.Random(SEED)
    quaternions = [near_lock(generator, exponents) for _ in range(2000)]
    assert max(error(model.quaternion_to_euler(*q), reference(q)) for q in quaternions) < bound


@pytest.mark.parametrize("exponent", [-1022, -1000, -300, 300, 1000, 1022])
def test_only_the_ratio_counts(model: ModuleType, exponent: int) -> None:
    """No result moves by a bit, whatever the exponent: the components have few enough bits to be denormal."""
    print(f"seed {SEED}")
    generator = random.Random(SEED)
    for _ in range(100):
        x, y, z = (generator.randint(-(2**50), 2**50) * 2.0**-50 for _ in range(3))
        scaled = [math.ldexp(component, exponent) for component in (x, y, z, 1.0)]
        assert model.quaternion_to_euler(*scaled) == model.quaternion_to_euler(x, y, z, 1.0)


HALF = math.pi / 2


@pytest.mark.parametrize(
    ("quaternion", "expected"),
    [
        pytest.param((0, 0, 0, 1), (0, 0, 0), id="identity"),
        pytest.param((0, 0, 0, -1), (0, 0, 0), id="identity, negative"),
        pytest.param((1, 0, 0, 0), (math.pi, 0, 0), id="half a turn about x"),
        pytest.param((-1, 0, 0, 0), (math.pi, 0, 0), id="half a turn about -x"),
        pytest.param((0, 1, 0, 0), (math.pi, 0, math.pi), id="half a turn about y"),
        pytest.param((0, 0, 1, 0), (0, 0, math.pi), id="half a turn about z"),
        pytest.param((0, 0, -1, 0), (0, 0, math.pi), id="half a turn about -z"),
        pytest.param((1, 0, 0, 1), (HALF, 0, 0), id="a quarter about x"),
        pytest.param((0, 0, -1, 1), (0, 0, -HALF), id="a quarter about -z"),
        pytest.param((0, 1, 0, 1), (0, HALF, 0), id="upper gimbal lock"),
        pytest.param((0, -1, 0, 1), (0, -HALF, 0), id="lower gimbal lock"),
        pytest.param((0.25, 0.5, -0.25, 0.5), (math.atan(0.5), HALF, -math.atan(0.5)), id="lock and roll"),
        pytest.param((0.5, 0.5, 0.5, 0.5), (HALF, 0, HALF), id="a third about the diagonal"),
        pytest.param((0, 0, 0, 0), (0, 0, 0), id="zero"),
        pytest.param((-0.0, -0.0, -0.0, -0.0), (0, 0, 0), id="negative zero"),
        pytest.param((SMALLEST, -SMALLEST, 0, SMALLEST_NORMAL - SMALLEST), (0, 0, 0), id="all denormal"),
        pytest.param((0, 0, 0, SMALLEST_NORMAL), (0, 0, 0), id="smallest normal"),
        pytest.param((0, 0, SMALLEST_NORMAL / 2, SMALLEST_NORMAL), (0, 0, 2 * math.atan(0.5)), id="denormal too"),
    ],
)
def test_known_angles(model: ModuleType, quaternion: Quaternion, expected: Angles) -> None:
    angles = model.quaternion_to_euler(*map(float, quaternion))
    for angle, value in zip(angles, expected, strict=True):
        # Multiples of a quarter turn are exact in the hardware, too.
        is_exact = value in (0, HALF, -HALF, math.pi)
        assert angle == value if is_exact else math.isclose(angle, value, rel_tol=0, abs_tol=1.2e-10)


@pytest.mark.parametrize("value", [math.nan, -math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("position", range(4))
def test_what_is_not_finite_gives_quiet_nans(model: ModuleType, value: float, position: int) -> None:
    quaternion = [1e-3, 1e308, 0.0, -2.0]
    quaternion[position] = value
    assert bits(model.quaternion_to_euler(*quaternion)) == [QUIET_NAN] * 3


def test_signs_and_ranges(model: ModuleType) -> None:
    """Every mix of zeros and signs: no -0, -pi < roll, yaw <= pi up to rounding, |pitch| <= pi/2."""
    values = (0.0, -0.0, 1.0, -1.0, 1e-300, -1e-300, SMALLEST, -SMALLEST, 0.3)
    for x, y, z, w in itertools.product(values, repeat=4):
        quaternion = x, y, z, w
        roll, pitch, yaw = angles = model.quaternion_to_euler(*quaternion)
        assert all(math.copysign(1, angle) == 1 for angle in angles if angle == 0)
        assert -math.pi <= roll <= math.pi and -math.pi <= yaw <= math.pi and abs(pitch) <= HALF
        if max(map(abs, quaternion)) >= SMALLEST_NORMAL and is_away_from_lock(quaternion):
            assert error(angles, reference(quaternion)) < 1.2e-10


def is_away_from_lock(quaternion: Quaternion) -> bool:
    """Neither of the two vectors is small and yet not zero: there roll and yaw lose what rounding takes."""
    x, y, z, w = map(Fraction, quaternion)
    largest = max(map(abs, (x, y, z, w)))
    lengths = [max(abs(a), abs(b)) / largest for a, b in ((w + y, z - x), (w - y, x + z))]
    return all(length == 0 or length > Fraction(1, 10**6) for length in lengths)


def test_respond(model: ModuleType) -> None:
    message = {"x": 0.0, "y": 0.0, "z": 1, "w": 1.0}
    assert model.respond("QuaternionToEuler_sub", message) == [
        ("QuaternionToEuler_pub", {"x": 0.0, "y": 0.0, "z": math.pi / 2})
    ]
    with pytest.raises(ValueError, match="'Other_sub'"):
        model.respond("Other_sub", message)
    with pytest.raises(TypeError, match="field 'y'"):
        model.respond("QuaternionToEuler_sub", message | {"y": "0"})


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Quaternion], Angles]:
    """QuaternionToEuler.cpp, as g++ translates it."""
    library = tmp_path_factory.mktemp("hls") / "quat2euler.so"
    door = f"""
        #include "{SPEC / "QuaternionToEuler.cpp"}"
        extern "C" void call(const double *in, double *out) {{
            QuaternionToEuler(in[0], in[1], in[2], in[3], out, out + 1, out + 2);
        }}"""
    options = ["-O2", "-ffp-contract=off", "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror", "-Wno-unknown-pragmas"]
    subprocess.run(["g++", *options, "-x", "c++", "-", "-o", str(library)], input=door, text=True, check=True)
    function = ctypes.CDLL(str(library)).call

    def call(quaternion: Quaternion) -> Angles:
        result = (ctypes.c_double * 3)()
        function((ctypes.c_double * 4)(*quaternion), result)
        return result[0], result[1], result[2]

    return call


def test_the_cpp_function_is_its_model(compiled: Callable[[Quaternion], Angles]) -> None:
    print(f"seed {SEED}")
    generator = random.Random(SEED)
    special = (0.0, -0.0, 1.0, -1.0, SMALLEST, -SMALLEST_NORMAL, 1.7e308, math.inf, math.nan)
    quaternions = unit_quaternions(generator, VECTORS) + [near_lock(generator, (-17, -6)) for _ in range(2000)]
    quaternions += [(x, y, z, w) for x, y, z, w in itertools.product(special, repeat=4)]
    for quaternion in quaternions:
        assert bits(compiled(quaternion)) == bits(MODELS["model_hls"].quaternion_to_euler(*quaternion)), quaternion
