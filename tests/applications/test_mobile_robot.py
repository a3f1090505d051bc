"""The mobile robot in simulation: a closed loop over motors against the bit-true model and stated bounds."""

from __future__ import annotations

import importlib.util
import random
import re
import struct
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pytest
import yaml

from tests.applications.applications import SPECS, for_ros2, simulation
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

ROBOT = SPECS / "mobile_robot"
CORES = ("acc/float64/float64",)
SOURCES = ("quadrature_decoder", "wheel_pid", "pwm_driver", "skid_steer", "mobile_robot")
SEED = seeded(20240707)
NAN, INF = float("nan"), float("inf")

# What the bench's generics make of a control period, and its motors: the last one is too weak for SPEED_LIMIT.
GENERICS = {"clock_hz": 5_000_000, "pwm_cycles": 100, "kp": 1_000, "ki": 110, "kd": 200, "timeout": 50}
FULL_SPEEDS = (1_600_000, 1_500_000, 1_550_000, 1_200_000)
TIME_CONSTANT = 50
# m/s that a count of all four wheels, or of one of them, means.
COUNT, QUARTER = 0.0307, 0.0077
WEAK, BLOCKED = 3, 1
# Periods in which a step settles to 5 % (a motor's time constant is ten), and those that its mean is taken of.
SETTLING, WATCHED = 35, 20
# Periods until a wheel that was let go, when it was as slow as a count a period, cannot creep over an edge any more.
RESTING = 90


def load_model() -> ModuleType:
    """The model in the specification's folder, which is no package."""
    module_spec = importlib.util.spec_from_file_location("mobile_robot_model", ROBOT / "model.py")
    assert module_spec and module_spec.loader
    module = importlib.util.module_from_spec(module_spec)
    # Dataclasses look their module up.
    sys.modules[module_spec.name] = module
    module_spec.loader.exec_module(module)
    return module


MODEL = load_model()


@dataclass(frozen=True)
class Period:
    """What a control period gets: a command, if any, and the wheels that are held."""

    command: tuple[float, float] | None
    held: tuple[int, ...] = ()


@dataclass(frozen=True)
class Answer:
    """What it gives: a twist if it was commanded, the wheels that are stalled, and the encoders' errors."""

    twist: tuple[float, float] | None
    stalled: tuple[int, ...]
    errors: int


STEP, BACK, SPIN, STOP, BEYOND = (0.6, 0.0), (-0.6, 0.0), (0.0, 2.0), (0.0, 0.0), (5.0, 0.0)
SCENARIO = {
    "step": [Period(STEP)] * 70,
    "reversal": [Period(BACK)] * 70,
    "stop": [Period(STOP)] * 130,
    "spin": [Period(SPIN)] * 60,
    "saturation": [Period(BEYOND)] * 90,
    "back from saturation": [Period(STEP)] * 60,
    "blocked": [Period(STEP, (BLOCKED,))] * 50,
    "released": [Period(STEP)] * 70,
    "not a number": [Period((NAN, 0.0))] * 130,
    "again": [Period(STEP)] * 60,
    "silence": [Period(None)] * 110,
    "after silence": [Period(STOP)] * 3,
}


def play(work: Library, folder: Path, periods: Sequence[Period], **generics: int) -> list[Answer]:
    """The bench's answers."""
    folder.mkdir(exist_ok=True)
    lines = [
        f"{int(item.command is not None)} {digits(item.command or (0.0, 0.0))} "
        + "".join(str(int(wheel in item.held)) for wheel in (3, 2, 1, 0))
        for item in periods
    ]
    (folder / "scenario.txt").write_text("\n".join(lines) + "\n")
    files = {"SCENARIO": str(folder / "scenario.txt"), "RESULTS": str(folder / "results.txt")}
    result = work.run("mobile_robot_tb", {**files, **generics})
    assert result.exit_code == 0, result.output
    found = []
    for line in (folder / "results.txt").read_text().splitlines():
        is_answered, x, z, stalled, errors = line.split()
        twist = (number(x), number(z)) if is_answered == "1" else None
        wheels = tuple(wheel for wheel in range(4) if stalled[3 - wheel] == "1")
        found.append(Answer(twist, wheels, int(errors, 2)))
    return found


def digits(numbers: tuple[float, float]) -> str:
    return " ".join(format(struct.unpack("<Q", struct.pack("<d", value))[0], "064b") for value in numbers)


def number(text: str) -> float:
    return float(struct.unpack("<d", struct.pack("<Q", int(text, 2)))[0])


def model_of(periods: Sequence[Period]) -> list[Answer]:
    """The same by the model."""
    parameters = MODEL.Parameters(pwm_periods=5, stall_periods=20, filter=3, **GENERICS)
    robot = MODEL.Robot(parameters, [MODEL.Motor(parameters, speed, TIME_CONSTANT) for speed in FULL_SPEEDS])
    answers = []
    for item in periods:
        for wheel, motor in enumerate(robot.motors):
            motor.is_held = wheel in item.held
        twist = robot.period(item.command)
        stalled = tuple(wheel for wheel, pid in enumerate(robot.pids) if pid.is_stalled)
        answers.append(Answer(twist if item.command else None, stalled, 0))
    return answers


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return analysed(tmp_path_factory.mktemp("robot"))


def analysed(folder: Path) -> Library:
    """The accelerator and its benches."""
    Library("firm", folder).analyse(core_files(*CORES))
    found = Library("work", folder)
    found.analyse([ROBOT / "rtl" / f"{name}.vhd" for name in SOURCES])
    found.analyse([ROBOT / "tb" / f"{name}.vhd" for name in ("motor", "mobile_robot_tb", "quadrature_decoder_tb")])
    return found


@pytest.fixture(scope="module")
def answers(work: Library, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Answer]]:
    """Of every part of the scenario, all of which are played one after the other."""
    periods = [period for part in SCENARIO.values() for period in part]
    found = play(work, tmp_path_factory.mktemp("scenario"), periods)
    assert found == model_of(periods)
    parts, start = {}, 0
    for name, part in SCENARIO.items():
        parts[name] = found[start : start + len(part)]
        start += len(part)
    return parts


def twists(found: Sequence[Answer]) -> list[tuple[float, float]]:
    return [answer.twist for answer in found if answer.twist]


def settles(found: Sequence[Answer], x: float, z: float) -> None:
    """Each answer behind SETTLING is within 5 % and a count, and their mean within 1 % and a quarter of a wheel's."""
    behind = twists(found)[SETTLING:]
    assert len(behind) >= WATCHED
    watched = behind[-WATCHED:]
    # A twist's z of one count is that of x by half the track width.
    for measured, wanted, unit in ((0, x, 1.0), (1, z, 1 / 0.2)):
        assert all(abs(twist[measured] - wanted) <= (0.05 * abs(wanted) + COUNT * unit) for twist in behind)
        mean = sum(twist[measured] for twist in watched) / WATCHED
        assert abs(mean - wanted) <= 0.01 * abs(wanted) + QUARTER / 4 * unit


@pytest.mark.one_in(7)
@pytest.mark.parametrize(
    ("part", "x", "z"),
    [
        ("step", *STEP),
        ("reversal", *BACK),
        ("spin", *SPIN),
        ("back from saturation", *STEP),
        ("released", *STEP),
        ("again", *STEP),
    ],
)
def test_a_command_settles(answers: dict[str, list[Answer]], part: str, x: float, z: float) -> None:
    settles(answers[part], x, z)


def test_a_step_overshoots_little(answers: dict[str, list[Answer]]) -> None:
    assert max(x for x, _ in twists(answers["step"])) <= 0.6 * 1.05 + QUARTER


def test_zero_is_standing_still(answers: dict[str, list[Answer]]) -> None:
    """Nothing but a last count of each wheel comes late, and none when they are at rest."""
    for part in ("stop", "not a number"):
        assert sum(abs(x) for x, _ in twists(answers[part])[SETTLING:]) <= 4 * QUARTER
        assert set(twists(answers[part])[RESTING:]) == {(0.0, 0.0)}


def test_a_command_beyond_the_motors_ends_at_their_limits(answers: dict[str, list[Answer]]) -> None:
    """Three wheels run 40 counts a period, SPEED_LIMIT, the weak one the 35.8 that its motor can."""
    parameters = MODEL.Parameters(pwm_periods=5, **GENERICS)
    weak = FULL_SPEEDS[WEAK] * 500 / 2**24
    expected = (3 * 40 + weak) / 4 / parameters.counts_per_metre
    for x, z in twists(answers["saturation"])[-WATCHED:]:
        assert abs(x - expected) <= COUNT
        assert z < 0.0
    assert not any(answer.stalled for answer in answers["saturation"])


def test_a_blocked_wheel_is_told_and_does_not_wind_up(answers: dict[str, list[Answer]]) -> None:
    """It is told after some periods at full duty, and no more when it turns; how it settles is a test of its own."""
    blocked = answers["blocked"]
    assert blocked[0].stalled == ()
    assert blocked[-1].stalled == (BLOCKED,)
    assert not any(answer.stalled for answer in answers["released"][5:])


def test_the_robot_stops_when_commands_do(answers: dict[str, list[Answer]]) -> None:
    assert all(answer.twist is None for answer in answers["silence"])
    assert twists(answers["after silence"]) == [(0.0, 0.0)] * 3


def test_no_encoder_has_an_error(answers: dict[str, list[Answer]]) -> None:
    assert all(answer.errors == 0 for part in answers.values() for answer in part)


def test_random_commands(work: Library, tmp_path: Path) -> None:
    """Also of speeds that no robot has, and wheels held at random; every bit is the model's."""
    print(f"seed {SEED}")
    source = random.Random(SEED)
    periods: list[Period] = []
    while len(periods) < 150:
        command = (
            source.choice([source.uniform(-2, 2), -INF, 1e-9, 200.0]),
            source.choice([source.gauss(0, 5), NAN, 0.0]),
        )
        held = tuple(wheel for wheel in range(4) if source.random() < 0.1)
        periods += [Period(command if source.random() < 0.9 else None, held)] * source.randint(1, 15)
    assert play(work, tmp_path, periods) == model_of(periods)


def test_an_answer_that_waits_holds_commands_up(work: Library, tmp_path: Path) -> None:
    """An answer that waits for more than a period: every second period takes a command, and no answer is lost."""
    found = play(work, tmp_path, [Period(STEP)] * 12, ANSWER_WAITS=520)
    assert [answer.twist is not None for answer in found] == [False] + [True, False] * 5 + [True]


def decoded(work: Library, folder: Path, steps: Sequence[tuple[int, int, int]], filter_: int) -> tuple[int, int]:
    """The counts and errors of lines A and B, each pair for some cycles."""
    (folder / "vectors.txt").write_text("".join(f"{' '.join(map(str, step))}\n" for step in steps))
    files = {"VECTORS": str(folder / "vectors.txt"), "RESULTS": str(folder / "results.txt")}
    result = work.run("quadrature_decoder_tb", {**files, "FILTER": filter_})
    assert result.exit_code == 0, result.output
    count, errors = map(int, (folder / "results.txt").read_text().split())
    return count, errors


LINES = ((0, 0), (1, 0), (1, 1), (0, 1))


@pytest.mark.one_in(5)
@pytest.mark.parametrize("filter_", [2, 4, 9])
@pytest.mark.parametrize("start", range(4))
def test_the_decoder_counts_every_edge_and_no_glitch(work: Library, tmp_path: Path, filter_: int, start: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED + start)
    position, steps = start, [(*LINES[start], 0)]
    for _ in range(600):
        position += source.choice([1, 1, 1, -1])
        a, b = LINES[position % 4]
        for _ in range(source.randint(0, 2)):
            # Long enough between glitches that what was before counts, too short within one to count.
            steps += [(a, b, filter_ + source.randint(2, 9)), (1 - a, b, source.randint(1, filter_ - 1))]
            steps += [(a, b, filter_ + 2), (a, 1 - b, source.randint(1, filter_ - 1))]
            # A glitch that is seen counts forth and back; on both lines at once it is an error.
            steps += [(a, b, filter_ + 2), (1 - a, 1 - b, filter_ - 1)]
        steps.append((a, b, filter_ + source.randint(1, 20)))
    assert decoded(work, tmp_path, steps, filter_) == (position - start, 0)


def test_the_decoder_counts_jumps_of_both_lines_as_errors(work: Library, tmp_path: Path) -> None:
    """Between them is a step back, behind them are three forward."""
    steps = [(0, 0, 9), (1, 1, 9), (1, 0, 9), (0, 1, 9), (0, 0, 9), (1, 0, 9), (1, 1, 9)]
    assert decoded(work, tmp_path, steps, 4) == (-1 + 3, 2)


def test_the_decoder_stops_counting_errors_at_its_end(work: Library, tmp_path: Path) -> None:
    steps = [(0, 0, 9), *[(1, 1, 9), (0, 0, 9)] * 130]
    assert decoded(work, tmp_path, steps, 4) == (0, 255)


@pytest.mark.check
def test_the_system_with_stalls(tmp_path: Path) -> None:
    """The motors turn at their own time, so stalls of the host change no answer; one encoder has glitches."""
    system = simulation(ROBOT, tmp_path, *CORES)
    assert system.passes(SEED=3, STALL_PERCENT=50)


@pytest.mark.check
def test_ros2(tmp_path: Path) -> None:
    robot = for_ros2("mobile_robot", tmp_path)
    stimuli = yaml.safe_load((robot / "stimuli.yaml").read_text())
    (robot / "stimuli.yaml").write_text(yaml.safe_dump(stimuli[8:16]))
    assert simulation(robot, tmp_path / "system", *CORES).passes(SEED=4)


def test_synthesis_makes_no_latch_and_verilog(work: Library) -> None:
    """ghdl 2.0 writes wide constants as strings and shifts signed numbers without their sign."""
    assert work.latches("mobile_robot") == []
    netlist = work.synthesise("mobile_robot", language="verilog")
    assert '"' not in netlist
    assert not re.search(r"\$signed\([^;]*>>[^>]", netlist)


# The bench's, as a netlist has no generics of its own.
NETLIST_GENERICS: dict[str, Generic] = {
    **{name.upper(): value for name, value in GENERICS.items()},
    "PWM_PERIODS": 5,
    "STALL_PERIODS": 20,
    "FILTER": 3,
}


def test_the_netlist_answers_alike(tmp_path: Path) -> None:
    library = analysed(tmp_path)
    library.replace_by_netlist("mobile_robot", NETLIST_GENERICS)
    library.analyse([ROBOT / "tb" / "mobile_robot_tb.vhd"])
    periods = (
        [Period(STEP)] * 8 + [Period((-1.0, 3.0), (BLOCKED,))] * 6 + [Period((NAN, 0.0))] * 2 + [Period(BEYOND)] * 2
    )
    assert play(library, tmp_path / "run", periods) == model_of(periods)


@pytest.mark.parametrize(
    ("generics", "message"),
    [
        ({"PWM_CYCLES": 31, "CLOCK_HZ": 620_000}, "mobile_robot: PWM_CYCLES is 31, legal: 32 to 32767"),
        ({"SPEED_LIMIT": 128}, "skid_steer: SPEED_LIMIT is 128, legal: 1 to 127"),
        ({"KI": 131072}, "wheel_pid: KP, KI, KD are 50000, 131072, 10000, legal: 0 to 131071"),
        ({"FILTER": 1}, "quadrature_decoder: FILTER is 1, legal: 2 to 250"),
        ({"WHEEL_RADIUS_UM": 100}, "skid_steer: 1 m/s or 1 rad/s makes too few or too many counts a period"),
        ({"COUNTS_PER_TURN": 4}, "skid_steer: 1 m/s or 1 rad/s makes too few or too many counts a period"),
    ],
)
def test_illegal_generics(work: Library, generics: dict[str, Generic], message: str) -> None:
    result = work.run("mobile_robot", generics, options=["--stop-time=1ns"])
    assert result.exit_code != 0
    assert message in result.output
