"""A generated package that roslaunch starts: the node in Python, with a namespace, a name and a remapped topic."""

from __future__ import annotations

import os
import shutil
import struct
import sys
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from tests.ros.cpp_nodes import NodeProcess, Peer, missing_ros, running_ros
from tests.ros.live_nodes import REPOSITORY, model_address

pytestmark = [pytest.mark.check, pytest.mark.xdist_group("live_1")]

SPECIFICATION = """\
project: {name: robot, width: 64}
blocks:
  - {name: in, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: out}]}
  - {name: out, middleware: ROS, mode: publisher, message: geometry_msgs/Point}
"""


def test_roslaunch_starts_the_node(tmp_path: Path) -> None:
    if reason := missing_ros(1) or ("" if shutil.which("roslaunch") else "roslaunch is not installed"):
        pytest.skip(reason)
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPECIFICATION, encoding="utf-8")
    package = tmp_path / "packages" / "robot_node"
    assert main(["system", "node", str(spec), "--language", "python", "-o", str(package)]) == 0
    # The model's command has blanks; roslaunch must keep it as one argument.
    arguments = [f"transport:={model_address('--width', '64')}", "name:=turner", "namespace:=arm", "in_topic:=/raw"]
    with running_ros(1, tmp_path) as ros:
        environment = {
            **ros.environment,
            "ROS_PACKAGE_PATH": str(tmp_path / "packages"),
            "PYTHONPATH": os.pathsep.join([str(REPOSITORY), os.environ.get("PYTHONPATH", "")]),
            "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        }
        command = ["roslaunch", "robot_node", "robot.launch", *arguments, f"options:=--ros-python {ros.python}"]
        message = "geometry_msgs/Point"
        with (
            NodeProcess(tmp_path / "launch.log", command, environment) as node,
            Peer(ros, {"/arm/out": message}, {"/raw": message}) as peer,
        ):
            node.wait_until_said("robot is a node of ROS 1")
            peer.wait_until_connected()
            payload = struct.pack("<3d", 1.0, -2.0, 3.5)
            assert peer.publish_until_back("/raw", payload)[1] == payload
            assert "/raw -> in" in node.said() and "out -> /arm/out" in node.said()
            node.stop()
            assert "received" in node.said()
