"""Quality of service against real ROS: latched topics, what ROS drops, other types; `firm live` and nodes in C++."""

from __future__ import annotations

import os
import random
import re
import signal
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from tests.ros.cpp_nodes import Node, NodeProcess, Peer, Ros, missing_ros, running_ros
from tests.ros.live_nodes import LiveNode, model_address

pytestmark = pytest.mark.check
# The node's own queue is short, and what it publishes is kept.
ECHO = """\
project: {name: qos_echo, width: 64}
blocks:
  - {name: image_in, middleware: ROS, mode: subscriber, message: sensor_msgs/Image, qos: {depth: 3},
     maxLength: 100000, outgoing: [{name: image_out}]}
  - {name: image_out, middleware: ROS, mode: publisher, message: sensor_msgs/Image, qos: {depth: 1000}}
  - {name: text_in, middleware: ROS, mode: subscriber, message: std_msgs/String, qos: {durability: transient_local},
     maxLength: 100, outgoing: [{name: text_out}]}
  - {name: text_out, middleware: ROS, mode: publisher, message: std_msgs/String,
     qos: {profile: action_status_default}}
"""
PIXELS = 50_000
MESSAGES = 400


@dataclass
class Place:
    """A version of ROS that runs, and the node in C++, compiled once."""

    ros: Ros
    folder: Path
    program: Path | None = None

    def specification(self) -> Path:
        path = self.folder / "qos_echo.yaml"
        text = ECHO if self.ros.version == 1 else re.sub(r"\bROS\b", "ROS2", ECHO)
        path.write_text(text, encoding="utf-8")
        return path

    def node(self, kind: str) -> NodeProcess:
        """A node of this kind before a model of the hardware."""
        address = model_address("--width", "64")
        if kind == "live":
            command = ["live", str(self.specification()), "--transport", address]
            return LiveNode(self.ros, self.folder / "node.log", command)
        if self.program is None:
            package, program = self.folder / "package", self.folder / "qos_echo"
            assert main(["system", "node", str(self.specification()), "--language", "cpp", "-o", str(package)]) == 0
            self.ros.compile(package, program)
            self.program = program
        return Node(self.ros, self.program, address)

    def type(self, name: str) -> str:
        """A message's name in this version."""
        return name if self.ros.version == 1 else name.replace("/", "/msg/")

    def text(self, text: str) -> bytes:
        """The payload of a string."""
        if self.ros.version == 1:
            return struct.pack("<I", len(text)) + text.encode()
        return b"\0\1\0\0" + struct.pack("<I", len(text) + 1) + text.encode() + b"\0"

    def image(self, number: int) -> bytes:
        """The payload of an image whose height is a number."""
        noise = random.Random(number).randbytes(8) * (PIXELS // 8)
        if self.ros.version == 1:
            words = struct.pack("<IIII", 0, 7, 8, 3) + b"cam" + struct.pack("<III", number, PIXELS, 4) + b"rgb8"
            return words + struct.pack("<BII", 0, PIXELS, PIXELS) + noise
        words = struct.pack("<iII", 7, 8, 4) + b"cam\0" + struct.pack("<III", number, PIXELS, 5) + b"rgb8\0"
        return b"\0\1\0\0" + words + struct.pack("<B", 0) + bytes(2) + struct.pack("<II", PIXELS, PIXELS) + noise

    def number(self, image: bytes) -> int:
        """The number of an image."""
        return int.from_bytes(image[19:23] if self.ros.version == 1 else image[20:24], "little")


@pytest.fixture(
    scope="module",
    params=[pytest.param(version, marks=pytest.mark.xdist_group(f"qos_{version}")) for version in (1, 2)],
    ids=["ros1", "ros2"],
)
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    folder = tmp_path_factory.mktemp(f"qos{request.param}")
    if reason := missing_ros(request.param):
        pytest.skip(reason)
    with running_ros(request.param, folder) as ros:
        yield Place(ros, folder)


both_kinds = pytest.mark.parametrize("kind", ["live", "cpp"])


@contextmanager
def stopped(node: NodeProcess) -> Iterator[None]:
    """The process that speaks to ROS does nothing within this context."""
    number = node.process.pid
    if isinstance(node, LiveNode):
        (number,) = [found for line, found in node.children().items() if "bridge.py" in line]
    os.kill(number, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(number, signal.SIGCONT)


def counts(node: NodeProcess) -> tuple[int, int, int, int]:
    """What an ended node tells of images: received, dropped, sent, lost by ROS."""
    patterns = (
        r"image_in +(\d+) +(\d+) +(\d+) +0 +(\d+)\n",
        r"(\d+) received, (\d+) dropped, (\d+) sent, .* (\d+) lost by ROS",
    )
    found = next(filter(None, (re.search(pattern, node.said()) for pattern in patterns)))
    received, dropped, sent, lost = map(int, found.groups())
    return received, dropped, sent, lost


@both_kinds
def test_what_is_published_before_the_node_or_its_peer_arrives(place: Place, kind: str) -> None:
    """A publisher keeps its last message for the node, and the node its own for a peer that comes later."""
    text = place.type("std_msgs/String") + " latched depth=1"
    with Peer(place.ros, {}, {"/text_in": text}) as first:
        first.wait_until_connected()
        first.publish("/text_in", place.text("early"))
        first.wait_until_published()
        with place.node(kind) as node:
            for _ in range(2):
                with Peer(place.ros, {"/text_out": text}, {}) as late:
                    late.wait_until_connected()
                    expected = place.text("early")
                    assert late.take()[1][: len(expected)] == expected
            assert node.stop() == 0


@both_kinds
def test_all_that_is_lost_is_counted(place: Place, kind: str) -> None:
    """The process of ROS stands still while a peer with a short queue sends; each message arrives or is counted."""
    image = place.type("sensor_msgs/Image")
    with place.node(kind) as node, Peer(place.ros, {"/image_out": image}, {"/image_in": f"{image} depth=3"}) as peer:
        peer.wait_until_connected()
        # The first number that arrives is the one from which the node counts.
        peer.publish("/image_in", place.image(0))
        assert place.number(peer.take()[1]) == 0
        with stopped(node):
            for number in range(1, MESSAGES):
                peer.publish("/image_in", place.image(number))
            peer.wait_until_published()
        peer.publish("/image_in", place.image(MESSAGES))
        came = [0]
        while came[-1] != MESSAGES:
            came.append(place.number(peer.take()[1]))
        assert node.stop() == 0
    received, dropped, sent, lost = counts(node)
    assert received + lost == MESSAGES + 1
    assert received == dropped + sent
    assert len(came) == sent and came == sorted(came)
    assert lost > 0


@both_kinds
def test_a_peer_with_another_type_is_reported_once(place: Place, kind: str) -> None:
    told = "no messages are exchanged"
    other = place.type("geometry_msgs/Point") + " latched"
    with place.node(kind) as node, Peer(place.ros, {}, {"/image_in": other}) as first:
        first.wait_until_connected()
        node.wait_until_said(told)
        with Peer(place.ros, {}, {"/text_in": other}) as second:
            second.wait_until_connected()
            node.wait_until_said(told, 2)
        said = [line for line in node.said().splitlines() if told in line]
        assert ["/image_in" in line for line in said] == [True, False]
        assert ["/text_in" in line for line in said] == [False, True]
        assert node.stop() == 0
