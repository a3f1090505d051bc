"""Nodes of ROS 2 with lifecycle states, driven by a real client of their services."""

from __future__ import annotations

import json
import random
import re
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from tests.ros.cpp_nodes import Client, Node, NodeProcess, Peer, missing_ros, running_ros
from tests.ros.live_nodes import REPOSITORY, LiveNode, model_address
from tests.ros.places import Place
from tests.ros.test_services import Camera
from tests.seeds import seeded

# Nodes of these tests have the same names.
pytestmark = [pytest.mark.check, pytest.mark.xdist_group("lifecycle")]
_RANDOM = random.Random(seeded(20261128))

SPECIFICATION = """\
project: {name: robot, width: 64}
blocks:
  - {name: in, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: out}]}
  - {name: out, middleware: ROS2, mode: publisher, message: geometry_msgs/Point}
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    if reason := missing_ros(2):
        pytest.skip(reason)
    folder = tmp_path_factory.mktemp("lifecycle")
    with running_ros(2, folder) as ros:
        yield Place(ros, folder)


class Manager(Client):
    """The client of a node's lifecycle."""

    def __init__(self, place: Place, node: str, service: str = "") -> None:
        super().__init__(
            place.ros, [place.ros.python, str(Path(__file__).with_name("lifecycle_peer.py")), node, service]
        )

    def ask(self, line: str) -> object:
        assert self.process.stdin
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()
        return json.loads(self.line())


@contextmanager
def managed(place: Place, node: str, service: str = "") -> Iterator[Manager]:
    manager = Manager(place, node, service)
    try:
        yield manager
    finally:
        manager.end()


def node_of(place: Place, spec: Path, transport: str, kind: str) -> NodeProcess:
    """The node of a system: `firm live`, or a generated one in Python or C++, named as the system."""
    if kind == "cpp":
        options = ["--drain", "100", "--lifecycle", "--ros-args", "-r", f"__node:={spec.stem}"]
        return Node(place.ros, place.program(spec), transport, *options)
    command = ["live", str(spec)]
    if kind == "python":
        package = place.folder / f"{spec.stem}_python"
        if not package.exists():
            assert main(["system", "node", str(spec), "--language", "python", "-o", str(package)]) == 0
        (script,) = package.rglob("*_node.py")
        command = [str(script)]
    return LiveNode(place.ros, place.folder / "node.log", [*command, "--transport", transport, "--lifecycle"])


def point() -> bytes:
    return b"\0\1\0\0" + struct.pack("<3d", *(_RANDOM.random() for _ in range(3)))


@pytest.mark.parametrize("kind", ["live", "python", "cpp"])
def test_messages_pass_only_while_the_node_is_active(place: Place, kind: str) -> None:
    spec = place.folder / "robot.yaml"
    spec.write_text(SPECIFICATION, encoding="utf-8")
    transport = model_address("--width", "64")
    topics = {"/out": "geometry_msgs/msg/Point"}, {"/in": "geometry_msgs/msg/Point"}
    with (
        node_of(place, spec, transport, kind) as node,
        Peer(place.ros, *topics) as peer,
        managed(place, "/robot") as manager,
    ):
        peer.wait_until_connected()
        assert manager.ask("") == [True, "unconfigured"]
        for first, second in (("configure", "activate"), ("deactivate", "activate")):
            if first == "deactivate":
                assert manager.ask(first) == [True, "inactive"]
            # It is ignored. A message and a request may overtake each other, so the message has to be taken before.
            peer.publish("/in", point())
            peer.wait_until_acked()
            manager.ask("")
            if first == "configure":
                assert manager.ask("activate") == [False, "unconfigured"]
                assert manager.ask(first) == [True, "inactive"]
            assert manager.ask("") == [True, "inactive"]
            assert manager.ask(second) == [True, "active"]
            payload = point()
            peer.publish("/in", payload)
            assert peer.take() == ("/out", payload)
        assert manager.ask("deactivate") == [True, "inactive"]
        assert manager.ask("cleanup") == [True, "unconfigured"]
        assert manager.ask("unconfigured_shutdown") == [True, ""]
        assert node.wait() == 0
        counts = r"^in +2 +0 +2 +0 +0$" if kind != "cpp" else "^robot_node: 2 received, 0 dropped, 2 sent, 2 published"
        assert re.search(counts, node.said(), re.MULTILINE), node.said()


@pytest.mark.parametrize("kind", ["live", "cpp"])
def test_a_transient_local_message_waits_until_the_node_is_active(place: Place, kind: str) -> None:
    """It passes once, also if it came while the node was inactive again. Later messages follow it."""
    spec = place.folder / "latched.yaml"
    quality = "message: geometry_msgs/Point, qos: {durability: transient_local}, outgoing"
    text = SPECIFICATION.replace("name: robot", "name: latched")
    spec.write_text(text.replace("message: geometry_msgs/Point, outgoing", quality), encoding="utf-8")
    topics = {"/out": "geometry_msgs/msg/Point"}, {"/in": "geometry_msgs/msg/Point latched"}
    with (
        node_of(place, spec, model_address("--width", "64"), kind) as node,
        Peer(place.ros, *topics) as peer,
        managed(place, "/latched") as manager,
    ):
        peer.wait_until_connected()
        assert manager.ask("configure") == [True, "inactive"]
        for _ in range(2):
            payloads = [point() for _ in range(3)]
            for payload in payloads[:2]:
                peer.publish("/in", payload)
            # The node's reader has them.
            peer.wait_until_acked()
            assert manager.ask("activate") == [True, "active"]
            peer.publish("/in", payloads[2])
            for payload in payloads:
                assert peer.take() == ("/out", payload)
            assert manager.ask("deactivate") == [True, "inactive"]
        assert manager.ask("inactive_shutdown") == [True, ""]
        assert node.wait() == 0
        counts = (
            r"^in +6 +0 +6 +0 +0$" if kind != "cpp" else "^latched_node: 6 received, .* 6 published, .* 0 lost by ROS"
        )
        assert re.search(counts, node.said(), re.MULTILINE), node.said()


@pytest.mark.parametrize("kind", ["live", "cpp"])
def test_services_are_there_only_while_the_node_is_active(place: Place, kind: str) -> None:
    camera = Camera(place.ros, place.folder)
    service = "/set_camera_info"
    with (
        node_of(place, camera.specification(), camera.model, kind) as node,
        managed(place, "/camera", service) as manager,
    ):
        assert manager.ask("configure") == [True, "inactive"]
        assert manager.ask("-") == "-"
        for _ in range(2):
            assert manager.ask("activate") == [True, "active"]
            assert manager.ask("+") == "+"
            client = camera.client("python", 5, 1)
            try:
                assert client.line() == "ready\n"
                client.begin()
                assert json.loads(client.line()) == {"wrong": [], "failed": []}
            finally:
                client.end()
            assert manager.ask("deactivate") == [True, "inactive"]
            assert manager.ask("-") == "-"
        assert manager.ask("inactive_shutdown") == [True, ""]
        assert node.wait() == 0
        counts = r" +10 +10 +0 +0" if kind != "cpp" else ": 10 called, 10 answered, 0 failed, 0 unasked"
        assert re.search(f"^set_camera_info{counts}$", node.said(), re.MULTILINE), node.said()


def test_ros_1_has_no_lifecycle(tmp_path: Path) -> None:
    spec = tmp_path / "robot.yaml"
    spec.write_text(SPECIFICATION.replace("ROS2", "ROS"), encoding="utf-8")
    command = [sys.executable, "-m", "fusesoc_firm.cli", "live", str(spec), "--lifecycle", "--transport", "pipe:cat"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=REPOSITORY, check=False)
    assert done.returncode == 1
    assert "'--lifecycle' is for ROS 2, but the topics use ROS 1" in done.stderr
