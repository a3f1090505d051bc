"""`firm replay` with simulated hardware: whole bags in and out, compared with independent results."""

from __future__ import annotations

import random
import shutil
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.message import ROS1
from fusesoc_firm.node.engine.bursts import BurstJoiner, JoinedFrame
from tests.applications.applications import SPECS
from tests.applications.images import image
from tests.applications.quaternions import quaternion_bag, worst_error
from tests.converter.simulated.pass_through import QUIET, PassThrough, received, systems_of_all
from tests.frame.oracle import Oracle
from tests.message.test_bag_definitions import POINT, TEXT, record
from tests.runs.replay.replays import Item, read, write
from tests.seeds import seeded
from tests.system.simulated.systems import DATA

SEED = seeded(20261121)
needs_verilator = pytest.mark.skipif(not shutil.which("verilator"), reason="no verilator; make test installs it")


@pytest.fixture(scope="module")
def builds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which each simulator is built once."""
    return tmp_path_factory.mktemp("builds")


def replay(spec: Path, source: Path, target: Path, builds: Path, *options: str) -> list[Item]:
    """Replay a bag and return the recorded messages."""
    arguments = ["replay", str(spec), "--in", str(source), "--out", str(target), "--build-root", str(builds)]
    assert main([*arguments, *options]) == 0
    return read(target)


# --- angles ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tool", "count"), [("ghdl", 200), pytest.param("verilator", 1000, marks=[needs_verilator, pytest.mark.thorough])]
)
def test_a_bag_of_quaternions(tmp_path: Path, builds: Path, tool: str, count: int) -> None:
    source = quaternion_bag(tmp_path / "in.bag", count, SEED)
    spec = SPECS / "quat2euler" / "quat2euler.yaml"
    found = replay(spec, source, tmp_path / "out.bag", builds, "--tool", tool, "--quiet", "200")
    assert len(found) == count
    assert worst_error(source, tmp_path / "out.bag") < 1e-9


def test_stalls_change_nothing(tmp_path: Path, builds: Path) -> None:
    source = quaternion_bag(tmp_path / "in.bag", 20, SEED)
    spec = SPECS / "quat2euler" / "quat2euler.yaml"
    smooth = replay(spec, source, tmp_path / "smooth.bag", builds, "--quiet", "200")
    stalls = ("--stall-percent", "40", "--seed", "7")
    assert replay(spec, source, tmp_path / "rough.bag", builds, "--quiet", "200", *stalls) == smooth


# --- every type ------------------------------------------------------------------------------------------------------

FEW = {
    "noetic": ["geometry_msgs/Quaternion", "sensor_msgs/JointState", "std_msgs/Empty", "diagnostic_msgs/KeyValue"],
    "humble": ["geometry_msgs/Quaternion", "sensor_msgs/JointState", "std_msgs/Empty", "rcl_interfaces/ParameterEvent"],
}


def pass_through(system: PassThrough, folder: Path) -> None:
    source, sent = system.bag(folder)
    target = folder / ("out.bag" if source.suffix == ".bag" else "out")
    options = ("--distro", system.distribution, "--quiet", str(QUIET))
    replay(system.specification(folder), source, target, folder / "build", *options)
    assert received(target) == sent


@pytest.mark.one_in(2)
@pytest.mark.parametrize("megahertz", [None, 150.0])
@pytest.mark.parametrize("distribution", FEW)
def test_what_passes_through_is_the_same(tmp_path: Path, distribution: str, megahertz: float | None) -> None:
    """With a fast clock, through register slices at the subscribers."""
    pass_through(PassThrough(distribution, FEW[distribution], 6, SEED, megahertz=megahertz), tmp_path)


@pytest.mark.thorough
@pytest.mark.parametrize("distribution", FEW)
def test_every_message_passes_through_as_it_is(tmp_path: Path, distribution: str) -> None:
    for number, system in enumerate(systems_of_all(distribution, 4, SEED)):
        folder = tmp_path / str(number)
        folder.mkdir()
        pass_through(system, folder)


# --- bursts and software ---------------------------------------------------------------------------------------------

# 'low' is being sent when the accelerator responds to 'high'.
FORKED = """\
project: {name: forked, width: 8, scheduler: fixed_priority_preemptive, shortestRun: 2}
accelerators:
  - name: rotate
    type: VHDL
    sources: rotate.vhd
    interface:
      input: [{middleware: ROS, message: geometry_msgs/Vector3}]
      output: [{middleware: ROS, message: geometry_msgs/Vector3}]
blocks:
  - {name: sub, middleware: ROS, mode: subscriber, message: geometry_msgs/Vector3, outgoing: [{name: low}, {name: acc}]}
  - {name: acc, type: rotate, outgoing: [{name: high}]}
  - {name: high, middleware: ROS, mode: publisher, message: geometry_msgs/Vector3}
  - {name: low, middleware: ROS, mode: publisher, message: geometry_msgs/Vector3}
"""


def test_frames_that_interrupt_each_other(tmp_path: Path, builds: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bursts: list[bytes] = []
    push = BurstJoiner.push

    def counted(joiner: BurstJoiner, burst: bytes, *arguments: Any, **options: Any) -> JoinedFrame | None:
        bursts.append(burst)
        return push(joiner, burst, *arguments, **options)

    monkeypatch.setattr(BurstJoiner, "push", counted)
    chance, type_ = random.Random(SEED), "geometry_msgs/msg/Vector3"
    parts = [[chance.randbytes(8) for _ in range(3)] for _ in range(5)]
    (tmp_path / "forked.yaml").write_text(FORKED)
    shutil.copy(DATA / "rotate.vhd", tmp_path)
    source = write(tmp_path / "in.bag", "ros1", [("/sub", type_, n, b"".join(each)) for n, each in enumerate(parts)])
    found = replay(tmp_path / "forked.yaml", source, tmp_path / "out.bag", builds, "--quiet", "100")
    assert sorted(found) == sorted(
        [("/low", type_, n, x + y + z) for n, (x, y, z) in enumerate(parts)]
        + [("/high", type_, n, z + x + y) for n, (x, y, z) in enumerate(parts)]
    )
    assert len(bursts) > len(found)


@pytest.mark.check
def test_a_system_answers_the_same_wherever_a_block_is(tmp_path: Path, builds: Path) -> None:
    chance, oracle = random.Random(SEED), Oracle(ROS1)
    images = [oracle.serialise("sensor_msgs/Image", image("ROS", chance, 4, 6, 3)) for _ in range(4)]
    items = [("/camera", "sensor_msgs/msg/Image", number * 10**8, data) for number, data in enumerate(images)]
    source = write(tmp_path / "in.bag", "ros1", items)
    answers = [
        replay(SPECS / "image_pipeline" / f"{name}.yaml", source, tmp_path / f"{name}.bag", builds, "--quiet", "300")
        for name in ("image_pipeline", "image_pipeline_software")
    ]
    assert answers[0] == answers[1]
    assert [(topic, stamp) for topic, _, stamp, _ in answers[0]] == [("/sums", number * 10**8) for number in range(4)]


def test_messages_that_only_the_bag_defines(tmp_path: Path, builds: Path) -> None:
    """The specification lists the bag, so simulator and replay find the same messages."""
    bag = record(tmp_path, "ros1", {"odd_msgs/msg/Odd": TEXT + POINT}, count=3, size=28)
    message = "middleware: ROS, message: odd_msgs/Odd"
    blocks = f"""
  - {{name: t0, mode: subscriber, {message}, outgoing: [{{name: b}}]}}
  - {{name: b, mode: publisher, {message}}}
"""
    (tmp_path / "robot.yaml").write_text(f"project: {{name: robot}}\npaths: drive.bag\nblocks:{blocks}")
    found = replay(tmp_path / "robot.yaml", bag, tmp_path / "answers.bag", builds)
    assert [(topic, payload) for topic, _, _, payload in found] == [("/b", bytes(28))] * 3
