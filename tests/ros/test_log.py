"""The lines of nodes in ROS's log, `/rosout`: peers of rospy and rclpy receive what the terminal shows."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence

import pytest

from fusesoc_firm.cli import main
from tests.ros.cpp_nodes import Node, NodeProcess
from tests.ros.live_nodes import LiveNode, model_address
from tests.ros.places import Place, log_of, running, versions

pytestmark = pytest.mark.check
SPECIFICATION = """\
project: {{name: robot, width: 64}}
blocks:
  - {{name: in, middleware: {ros}, mode: subscriber, message: std_msgs/Int32, outgoing: [{{name: out}}]}}
  - {{name: out, middleware: {ros}, mode: publisher, message: std_msgs/Int32}}
"""
LANGUAGES = pytest.mark.parametrize("language", ["live", "python", "cpp"])


@pytest.fixture(scope="module", params=versions("log"))
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with running(request, tmp_path_factory) as (ros, folder):
        yield Place(ros, folder)


def started(place: Place, language: str, options: Sequence[str] = (), arguments: Sequence[str] = ()) -> NodeProcess:
    """A node of the system before a model of its hardware, with its options and the arguments of ROS."""
    spec = place.folder / "robot.yaml"
    spec.write_text(SPECIFICATION.format(ros="ROS" if place.version == 1 else "ROS2"), encoding="utf-8")
    # The model is the child that is killed, and not a shell.
    transport = model_address("--width", "64").replace(":", ":exec ", 1)
    if language == "cpp":
        return Node(place.ros, place.program(spec), transport, *options, *arguments)
    command = ["live", str(spec)]
    if language == "python":
        package = place.folder / "python_package"
        assert main(["system", "node", str(spec), "--language", "python", "-o", str(package)]) == 0
        command = [str(next(package.rglob("*_node.py")))]
    return LiveNode(place.ros, place.folder / "node.log", [*command, "--transport", transport, *options], *arguments)


def name_of(place: Place, language: str) -> str:
    name = "robot_node" if language == "cpp" else "robot"
    return f"/{name}" if place.version == 1 else name


@LANGUAGES
def test_faults_and_counts_are_in_the_log(place: Place, language: str) -> None:
    with started(place, language, ["--restart"]) as node, log_of(place.ros) as peer:
        node.kill_child("model_simulator")
        fault = peer.wait_for("killed by signal 9")
        assert (fault["name"], fault["level"]) == (name_of(place, language), logging.WARNING)
        assert node.stop() == 0
        counts = peer.wait_for(" received")
        assert (counts["name"], counts["level"]) == (name_of(place, language), logging.INFO)
        own = [line["text"] for line in peer.lines if line["name"] == fault["name"]]
        assert len(own) == len({*own}), "no line is twice in the log"
        assert [node.said().count(text) for text in own] == [1] * len(own), "nor in the terminal"


@LANGUAGES
def test_the_fault_that_ends_the_node_is_an_error_in_the_log(place: Place, language: str) -> None:
    with started(place, language) as node, log_of(place.ros) as peer:
        node.kill_child("model_simulator")
        fault = peer.wait_for("killed by signal 9")
        assert (fault["name"], fault["level"]) == (name_of(place, language), logging.ERROR)
        assert node.wait() == 1
        assert node.said().count(fault["text"]) == 1


@LANGUAGES
def test_ros_2_has_arguments_for_its_log(place: Place, language: str) -> None:
    if place.version == 1:
        pytest.skip("nodes of ROS 1 have none")
    arguments = ["--ros-args", "--log-level", "warn"]
    with started(place, language, ["--restart"], arguments) as node, log_of(place.ros) as peer:
        node.kill_child("model_simulator")
        peer.wait_for("killed by signal 9")
        assert node.stop() == 0
        assert " received" in node.said()
        assert {line["level"] for line in peer.lines if "peer" not in line["name"]} == {logging.WARNING}
