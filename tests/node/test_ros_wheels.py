"""ROS for machines without it: the wheels beside fusesoc-firm, and the sentences about what is missing."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.node.bridge.ros import BridgeError
from fusesoc_firm.node.bridge.ros1 import _warn_without_master
from fusesoc_firm.node.bridge.ros2_types import message_class
from fusesoc_firm.node.engine import carrier, ros_wheels
from fusesoc_firm.node.engine.carrier import CarrierError
from fusesoc_firm.text.diagnostics import InputError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The Python of an installed environment, which records its arguments."""
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(ros_wheels, "find_library", lambda name: name)
    path = tmp_path / "ros2" / "bin" / "python"
    path.parent.mkdir(parents=True)
    _script(path, 'echo "$@" >> "$0.log"')
    return path


def _script(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(0o755)


def test_the_wheels_and_those_of_message_packages_are_installed(
    python: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ros", "install", "nav_msgs", "geometry_msgs"]) == 0
    wheels = [*ros_wheels.requirements("jazzy"), "ros-jazzy-nav-msgs"]
    assert capsys.readouterr().out.splitlines() == [*wheels, str(python)]
    log = (python.parent / "python.log").read_text(encoding="utf-8")
    assert log == f"-m pip install --quiet --disable-pip-version-check {' '.join(wheels)}\n"


@pytest.mark.parametrize(
    ("distribution", "file", "further"),
    [("jazzy", "ros2.txt", "2.0.3"), ("kilted", "ros2_kilted.txt", "2.3.0")],
)
def test_the_wheels_are_those_of_the_tests(distribution: str, file: str, further: str) -> None:
    text = (ROOT / "tests" / "ros" / file).read_text(encoding="utf-8")
    # Only the tests need the last one.
    wheels = [*ros_wheels.requirements(distribution), f"ros-{distribution}-test-msgs=={further}"]
    assert wheels == text.splitlines()[1:]


def test_another_distribution_replaces_the_installed_one(python: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[bool] = []
    monkeypatch.setattr("venv.create", lambda *_, clear, **__: made.append(clear))
    installed = python.parents[1] / "lib/python3.11/site-packages/ros_jazzy_rclpy-7.1.6.dist-info"
    installed.mkdir(parents=True)
    ros_wheels.install_wheels([], "jazzy")
    assert made == []
    assert ros_wheels.install_wheels(["nav_msgs"], "kilted")[-1] == "ros-kilted-nav-msgs"
    assert made == [True]


def test_a_failure_of_pip_is_reported(python: Path) -> None:
    _script(python, "echo 'ERROR: No matching distribution found for ros-jazzy-no-msgs' >&2; exit 1")
    with pytest.raises(InputError, match="pip cannot install the wheels of ROS 2: No matching distribution found for"):
        ros_wheels.install_wheels(["no_msgs"])


def test_a_missing_library_is_reported(python: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros_wheels, "find_library", lambda _: None)
    with pytest.raises(InputError, match=r"apt-get install libpython3\.\d+"):
        ros_wheels.install_wheels([])
    assert not (python.parent / "python.log").exists()


def test_the_node_finds_the_wheels(python: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(carrier, "_MODULES", {1: "no_such_module", 2: "no_such_module"})
    assert carrier._python_of.__wrapped__(2) == str(python)


@pytest.mark.parametrize(("ros", "what"), [(1, "apt-get install python3-rospy"), (2, "'firm ros install' installs")])
def test_a_missing_ros_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ros: int, what: str) -> None:
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(carrier, "_MODULES", {1: "no_such_module", 2: "no_such_module"})
    with pytest.raises(CarrierError, match=what):
        carrier._python_of.__wrapped__(ros)


def test_a_missing_message_package_is_reported() -> None:
    with pytest.raises(BridgeError, match="'firm ros install no_such_msgs' or 'apt-get install"):
        message_class("no_such_msgs/msg/Thing")


@pytest.mark.parametrize("is_online", [True, False])
def test_a_missing_master_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], is_online: bool
) -> None:
    uri = "http://localhost:11311"
    fake = SimpleNamespace(is_master_online=lambda: is_online, get_master_uri=lambda: uri)
    monkeypatch.setitem(sys.modules, "rosgraph", fake)
    _warn_without_master()
    said = capsys.readouterr().err
    assert said == "" if is_online else f"waiting for the ROS master at {uri}; start it in another terminal" in said
