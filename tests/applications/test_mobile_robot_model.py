"""The mobile robot's model against its kinematics and its controller in float64."""

from __future__ import annotations

import importlib.util
import math
import random
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.seeds import seeded

SPEC = Path(__file__).parents[2] / "specs" / "mobile_robot"
SEED = seeded(20240505)
# The robot of the default parameters, in SI units.
TRACK_WIDTH, WHEEL_RADIUS, COUNTS_PER_TURN, PERIOD = 0.4, 0.1, 204_800, 1e-4


def load() -> ModuleType:
    """The model in the specification's folder, which is no package."""
    module_spec = importlib.util.spec_from_file_location("mobile_robot_kinematics", SPEC / "model.py")
    assert module_spec and module_spec.loader
    module = importlib.util.module_from_spec(module_spec)
    # Dataclasses look their module up.
    sys.modules[module_spec.name] = module
    module_spec.loader.exec_module(module)
    return module


MODEL = load()
PARAMETERS = MODEL.Parameters()


def counts_of(speed: float) -> float:
    """Counts a period of a wheel that rolls at a speed in m/s."""
    return speed / WHEEL_RADIUS / (2 * math.pi) * COUNTS_PER_TURN * PERIOD


def test_commands_become_speeds_of_the_sides() -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    for _ in range(1000):
        x, z = source.uniform(-3, 3), source.gauss(0, 5)
        for found, side in zip(MODEL.setpoints(PARAMETERS, x, z), (-1, 1), strict=True):
            wanted = counts_of(x + side * z * TRACK_WIDTH / 2)
            limited = max(-PARAMETERS.speed_limit, min(PARAMETERS.speed_limit, wanted))
            # Half a unit by rounding, and what the twist's own rounding to 2**-16 makes.
            assert abs(found / 256 - limited) <= 0.5 / 256 + counts_of(2**-17 * 1.2) + 1e-6


@pytest.mark.parametrize(
    ("x", "z", "sides"),
    [
        (math.inf, 0.0, (1, 1)),
        (-math.inf, 0.0, (-1, -1)),
        (0.0, 1e300, (-1, 1)),
        (0.0, -1e300, (1, -1)),
        (math.nan, 1.0, (0, 0)),
        (1.0, math.nan, (0, 0)),
        (2.0**-1074, -0.0, (0, 0)),
    ],
)
def test_commands_that_no_robot_follows(x: float, z: float, sides: tuple[int, int]) -> None:
    assert MODEL.setpoints(PARAMETERS, x, z) == tuple(side * PARAMETERS.speed_limit * 256 for side in sides)


def test_counts_become_a_twist() -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    for _ in range(1000):
        counts = [source.randint(-127, 127) for _ in range(4)]
        left, right = ((counts[side] + counts[side + 2]) / 2 / counts_of(1.0) for side in (0, 1))
        x, z = MODEL.twist(PARAMETERS, counts)
        assert x == pytest.approx((left + right) / 2, rel=1e-7, abs=1e-12)
        assert z == pytest.approx((right - left) / TRACK_WIDTH, rel=1e-7, abs=1e-12)


def test_the_controller_is_a_pid_within_its_limits() -> None:
    """Against the textbook's in float64, both fed with the same counts; it stops integrating at a limit."""
    print(f"seed {SEED}")
    source = random.Random(SEED)
    pid = MODEL.Pid(PARAMETERS)
    integral, before = 0.0, 0
    limited = 0
    setpoint, counts = 0, 0
    for number in range(3000):
        if number % 40 == 0:
            setpoint = source.choice([-1, 1]) * source.randint(1, 10240)
        counts = max(-127, min(127, counts + source.randint(-6, 6)))
        error = setpoint / 256 - counts
        increased = integral + PARAMETERS.ki / 256 * error
        raw = PARAMETERS.kp / 256 * error + increased + PARAMETERS.kd / 256 * (before - counts)
        before = counts
        is_beyond = abs(raw) > PARAMETERS.pwm_cycles
        limited += is_beyond
        if not (is_beyond and raw * error > 0):
            integral = increased
        wanted = max(-PARAMETERS.pwm_cycles, min(PARAMETERS.pwm_cycles, raw))
        # Rounded down to whole cycles.
        assert -1 <= pid.duty(setpoint, counts) - wanted <= 0.01
    assert 100 < limited < 2900


def test_a_wheel_that_stands_and_should_is_let_go() -> None:
    pid = MODEL.Pid(PARAMETERS)
    for _ in range(20):
        pid.duty(256, 0)
    assert pid.integral > 0
    for counts in (1, 0, -1):
        assert pid.duty(0, counts) == 0
        assert pid.integral == 0
    assert pid.duty(0, 2) < 0


def test_the_default_gains_fit_the_motor_that_they_are_meant_for() -> None:
    """Settled to 5 % in three of its time constants, reversed in five, never 5 % too fast, and at rest for good."""
    robot = MODEL.Robot(PARAMETERS, [MODEL.Motor(PARAMETERS, 80_500) for _ in range(4)])
    speeds = {x: [robot.period((x, 0.0))[0] for _ in range(200)] for x in (0.6, -0.6, 0.0)}
    for x, settling in ((0.6, 30), (-0.6, 50)):
        assert all(abs(speed - x) <= 0.03 for speed in speeds[x][settling:])
        assert max(speeds[x], key=lambda speed: speed * x) / x <= 1.05
        assert sum(speeds[x][100:]) / 100 == pytest.approx(x, rel=0.002)
    assert set(speeds[0.0][60:]) == {0.0}
    assert robot.duties == [0, 0, 0, 0]


def test_a_motor_follows_its_voltage_with_one_time_constant() -> None:
    motor = MODEL.Motor(PARAMETERS, full_speed=80_000, time_constant=20)
    for periods in range(1, 200):
        motor.run(PARAMETERS.pwm_cycles)
        wanted = 80_000 * (1 - (1 - 1 / 20) ** periods)
        assert abs(motor.speed - wanted) <= 20
    angle = motor.angle
    motor.is_held = True
    motor.run(PARAMETERS.pwm_cycles)
    assert (motor.speed, motor.angle) == (0, angle)


def test_the_hardware_has_the_same_defaults() -> None:
    lines = (SPEC / "rtl" / "mobile_robot.vhd").read_text(encoding="utf-8").splitlines()
    for name in PARAMETERS.__dataclass_fields__:
        (line,) = (line for line in lines if line.split()[:2] == [name.upper(), ":"])
        assert int(line.split(":=")[1].strip(" ;")) == getattr(PARAMETERS, name)
