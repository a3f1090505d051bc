"""Nodes in Python and C++ whose options are parameters: of a master of ROS 1, and in a file of ROS 2."""

from __future__ import annotations

import os
import struct
import sys
import xmlrpc.client
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from tests.ros.cpp_nodes import NodeProcess, Peer, Ros
from tests.ros.live_nodes import REPOSITORY, model_address
from tests.ros.places import running, versions

pytestmark = pytest.mark.check

SPECIFICATION = """\
project: {{name: robot, width: 64}}
blocks:
  - {{name: in, middleware: {ros}, mode: subscriber, message: geometry_msgs/Point, outgoing: [{{name: out}}]}}
  - {{name: out, middleware: {ros}, mode: publisher, message: geometry_msgs/Point}}
"""
TRANSPORT = model_address("--width", "64")


@dataclass
class Place:
    """A version of ROS that runs, and a folder."""

    ros: Ros
    folder: Path

    def node(self, language: str) -> list[str]:
        """The command of a generated node without its transport."""
        spec = self.folder / "spec.yaml"
        spec.write_text(SPECIFICATION.format(ros="ROS" if self.ros.version == 1 else "ROS2"), encoding="utf-8")
        package = self.folder / language
        if not package.exists():
            command = ["system", "node", str(spec), "--language", language, "-o", str(package)]
            assert main(command) == 0
        if language == "python":
            (script,) = package.rglob("*_node.py")
            return [sys.executable, str(script)]
        program = self.folder / "program"
        if not program.exists():
            self.ros.compile(package, program)
        return [str(program)]

    def started(self, language: str, parameters: dict[str, Any], *options: str) -> NodeProcess:
        """A node called `/arm/turner` with parameters."""
        command = [*self.node(language), *options]
        if language == "python":
            parameters = {**parameters, "ros_python": self.ros.python}
        environment = {**self.ros.environment}
        if language == "python":
            # What programs in C++ need of the wheels is not for our own Python.
            environment = {name: value for name, value in environment.items() if not name.startswith("LD_")}
            environment["PYTHONPATH"] = os.pathsep.join([str(REPOSITORY), os.environ.get("PYTHONPATH", "")])
        if self.ros.version == 1:
            master = xmlrpc.client.ServerProxy(self.ros.environment["ROS_MASTER_URI"])
            master.deleteParam("/test", "/arm")
            for name, value in parameters.items():
                master.setParam("/test", f"/arm/turner/{name}", value)
            command += ["__ns:=/arm", "__name:=turner"]
        else:
            file = self.folder / "parameters.yaml"
            file.write_text(yaml.safe_dump({"/**/turner": {"ros__parameters": parameters}}), encoding="utf-8")
            command += ["--ros-args", "-r", "__ns:=/arm", "-r", "__node:=turner", "--params-file", str(file)]
        return NodeProcess(self.folder / f"{language}.log", command, environment)

    def peer(self) -> Peer:
        point = "geometry_msgs/Point" if self.ros.version == 1 else "geometry_msgs/msg/Point"
        return Peer(self.ros, {"/arm/out": point}, {"/arm/in": point})


@pytest.fixture(scope="module", params=versions("parameters"))
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with running(request, tmp_path_factory) as (ros, folder):
        yield Place(ros, folder)


both = pytest.mark.parametrize("language", ["python", "cpp"])


@both
def test_a_node_takes_its_transport_from_a_parameter(place: Place, language: str) -> None:
    payload = (b"" if place.ros.version == 1 else b"\0\1\0\0") + struct.pack("<3d", 1.0, -2.0, 3.5)
    depth = "queue" if language == "python" else "depth"
    parameters = {"transport": TRANSPORT, depth: 7, "restart": True, "overflow": "block"}
    with place.started(language, parameters) as node, place.peer() as peer:
        peer.wait_until_connected()
        peer.publish("/arm/in", payload)
        assert peer.take() == ("/arm/out", payload)
        assert node.stop() == 0


@both
def test_the_command_line_has_priority(place: Place, language: str) -> None:
    with place.started(language, {"transport": TRANSPORT}, "--transport", "uart:/dev/missing:9600") as node:
        assert node.wait() == 1
        assert "/dev/missing" in node.said()


@both
@pytest.mark.parametrize(
    ("name", "value", "message"),
    [("overflow", "spill", "spill"), ("restart", 3, "restart"), ("", "", "--transport")],
)
def test_a_parameter_that_is_wrong_or_missing_is_reported(
    place: Place, language: str, name: str, value: Any, message: str
) -> None:
    with place.started(language, {name: value, "transport": TRANSPORT} if name else {}) as node:
        assert node.wait() in (1, 2)
        assert message in node.said()
