"""The robotic arm's core for franka_msgs/FrankaState, whose definition is not ours: it comes from ROS_PACKAGE_PATH."""

from __future__ import annotations

from pathlib import Path

from tests import corpus
from tests.house.test_main_job import run

CORE = "robotic_arm_franka"
# What the system takes of a FrankaState, within other fields.
_STATE = """\
Header header
float64[6] wrench
float64[16] O_T_EE
float64[16] O_T_EE_d
float64[7] q
float64[7] q_d
string[] errors
"""


def write_definition(folder: Path) -> Path:
    """A franka_msgs/FrankaState of our own, which has the fields that are taken; the folder for ROS_PACKAGE_PATH."""
    package = folder / "ros" / "franka_msgs" / "msg"
    package.mkdir(parents=True)
    (package / "FrankaState.msg").write_text(_STATE, encoding="utf-8")
    return folder / "ros"


def passes(definitions: Path, build_root: Path) -> bool:
    done = run(CORE, build_root, environment={"ROS_PACKAGE_PATH": str(definitions)})
    print(done.stdout)
    return done.returncode == 0 and "PASS 3/3" in done.stdout.splitlines()


def test_it_passes_with_a_definition_of_a_sourced_ros(tmp_path: Path) -> None:
    assert passes(write_definition(tmp_path), tmp_path / "build")


def test_it_passes_with_the_definition_of_franka_ros(tmp_path: Path) -> None:
    assert passes(corpus.definitions("ros1", "franka_msgs"), tmp_path / "build")


def test_without_the_definition_it_says_what_is_missing(tmp_path: Path) -> None:
    done = run(CORE, tmp_path / "build")
    assert done.returncode != 0
    assert "robotic_arm_franka.yaml:11:20: error: unknown message 'franka_msgs/FrankaState'" in done.stdout
    assert "looked in: " in done.stdout
