"""Quality of service and diagnostics against real ROS, of `firm live` and nodes in C++.

`pytest -m thorough tests/ros/test_qos.py -s` runs 1,000 messages a second for half a minute and prints the account.
"""

from __future__ import annotations

import json
import os
import random
import re
import signal
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.node.transport.built_simulator import build_simulator
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import identity
from tests.ros.cpp_nodes import Node, NodeProcess, Peer, Ros
from tests.ros.live_nodes import LiveNode, model_address, paced, specification
from tests.ros.places import running, versions

RATE, SECONDS = 1000, 30
# Processes on a computer share the names of systems whose status they serve.
NAME = f"qos_echo_{os.getpid()}"
# The node's own queue is short, and what it publishes is kept.
ECHO = f"""\
project: {{name: {NAME}, width: 64, status: frames}}
blocks:
  - {{name: image_in, middleware: ROS, mode: subscriber, message: sensor_msgs/Image, qos: {{depth: 3}},
     maxLength: 100000, outgoing: [{{name: image_out}}]}}
  - {{name: image_out, middleware: ROS, mode: publisher, message: sensor_msgs/Image, qos: {{depth: 1000}}}}
  - {{name: text_in, middleware: ROS, mode: subscriber, message: std_msgs/String, qos: {{durability: transient_local}},
     maxLength: 100, outgoing: [{{name: text_out}}]}}
  - {{name: text_out, middleware: ROS, mode: publisher, message: std_msgs/String,
     qos: {{profile: action_status_default}}}}
"""
# The registers of the status: two subscribers, two publishers, three unknown ids, 17 texts of which two were too
# long, and 16 back.
STATUS = {0x0: 0x4D524946, 0x4: 0x01002002, 0x18: 3, 0x8074: 17, 0x805C: 2, 0x80F4: 16}
PIXELS = 50_000
MESSAGES = 400


_BLOCKS = ("image_in", "text_in", "image_out", "text_out")
HARDWARE = {
    **{f"{block} {text}": 0 for block in _BLOCKS for text in ("frames", "longest wait in cycles")},
    "unknown ids": 3,
    "link errors": 0,
    "uncounted faults": 0,
    "text_in frames": 17,
    "text_out frames": 16,
    "text_in: the payload is longer than maxLength": 2,
}


@dataclass
class Place:
    """A version of ROS that runs, and the nodes in C++, each compiled once."""

    ros: Ros
    folder: Path
    programs: dict[Path, Path] = field(default_factory=dict)

    def specification(self) -> Path:
        path = self.folder / f"{NAME}.yaml"
        text = ECHO if self.ros.version == 1 else re.sub(r"\bROS\b", "ROS2", ECHO)
        path.write_text(text, encoding="utf-8")
        return path

    def node(self, kind: str) -> NodeProcess:
        """A node of this kind before a model of the hardware."""
        digest = identity(load_beside(self.specification(), [], None, needs_sources=False)).digest
        words = {**STATUS, **{0x3C - 4 * place: int(digest[8 * place :][:8], 16) for place in range(4)}}
        options = [word for address, value in words.items() for word in ("--word", f"{address:x}={value:x}")]
        address = model_address("--width", "64", *options)
        if kind == "live":
            command = ["live", str(self.specification()), "--transport", address]
            return LiveNode(self.ros, self.folder / "node.log", command)
        return Node(self.ros, self.compiled(self.specification()), address)

    def compiled(self, spec: Path) -> Path:
        """The node of a system in C++."""
        if spec not in self.programs:
            package = self.folder / f"{spec.stem}_package"
            assert main(["system", "node", str(spec), "--language", "cpp", "-o", str(package)]) == 0
            self.programs[spec] = self.folder / spec.stem
            self.ros.compile(package, self.programs[spec])
        return self.programs[spec]

    def angles(self, kind: str, *arguments: str) -> NodeProcess:
        """A node of quat2euler, simulated by Verilator."""
        spec = specification("quat2euler", self.ros.version, self.folder)
        built = build_simulator(spec, "verilator", build_root=self.folder / "simulators")
        address = f"pipe:exec {built.script()}"
        if kind == "cpp":
            return Node(self.ros, self.compiled(spec), address, *arguments)
        options = ["--transport", address, *(word.replace("--depth", "--queue") for word in arguments)]
        return LiveNode(self.ros, self.folder / "node.log", ["live", str(spec), *options])

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


@pytest.fixture(scope="module", params=versions("qos"))
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with running(request, tmp_path_factory) as (ros, folder):
        yield Place(ros, folder)


check = pytest.mark.check
both_kinds = pytest.mark.parametrize("kind", ["live", "cpp"])


def state(task: Path) -> str:
    """The letter of a thread's state in Linux; `X` if it has ended."""
    try:
        return (task / "stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return "X"


@contextmanager
def stopped(node: NodeProcess) -> Iterator[None]:
    """The process that speaks to ROS does nothing within this context."""
    number = node.process.pid
    if isinstance(node, LiveNode):
        (number,) = [found for line, found in node.children().items() if "node/bridge" in line]
    os.kill(number, signal.SIGSTOP)
    # Each of its threads stops when it runs next, unless it ends.
    while any(state(task) not in "TXZ" for task in Path(f"/proc/{number}/task").iterdir()):
        time.sleep(0.01)
    try:
        yield
    finally:
        os.kill(number, signal.SIGCONT)


def counts(node: NodeProcess, block: str) -> tuple[int, int, int, int]:
    """What an ended node tells of a block: received, dropped, sent, lost by ROS."""
    patterns = (
        rf"{block} +(\d+) +(\d+) +(\d+) +0 +(\d+)\n",
        r"(\d+) received, (\d+) dropped, (\d+) sent, .* (\d+) lost by ROS",
    )
    found = next(filter(None, (re.search(pattern, node.said()) for pattern in patterns)))
    received, dropped, sent, lost = map(int, found.groups())
    return received, dropped, sent, lost


@check
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


@check
@both_kinds
def test_all_that_is_lost_is_counted(place: Place, kind: str) -> None:
    """The process of ROS stands still while a peer with a short queue sends; each message arrives or is counted."""
    image = place.type("sensor_msgs/Image")
    with place.node(kind) as node, Peer(place.ros, {"/image_out": image}, {"/image_in": f"{image} depth=3"}) as peer:
        peer.wait_until_connected()
        # The first number that arrives is the one from which the node counts.
        first, back = peer.publish_until_back("/image_in", place.image(0))
        assert place.number(back) == 0
        with stopped(node):
            for number in range(1, MESSAGES):
                peer.publish("/image_in", place.image(number))
            peer.wait_until_published()
        peer.publish("/image_in", place.image(MESSAGES))
        came = [0]
        while came[-1] != MESSAGES:
            came.append(place.number(peer.take()[1]))
        assert node.stop() == 0
    received, dropped, sent, lost = counts(node, "image_in")
    # Those before the node and the peer had found each other do not count.
    assert MESSAGES + 1 <= received + lost <= MESSAGES + first
    assert received == dropped + sent
    assert sent - first < len(came) <= sent and came == sorted(came)
    assert lost > 0


@check
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
        # A master may still know a peer of an earlier node, so the order is free.
        assert [sum(name in line for line in said) for name in ("/image_in", "/text_in")] == [1, 1]
        assert len(said) == 2
        assert node.stop() == 0


@check
@both_kinds
def test_counts_are_published_as_diagnostics(place: Place, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Two strings are in the counts of some later second; what was lost is a warning there, and only then."""
    image = place.type("sensor_msgs/Image")
    script = str(Path(__file__).with_name("diagnostics_peer.py"))
    command = [place.ros.python, script, str(place.ros.version)]
    with (
        place.node(kind) as node,
        Peer(place.ros, {"/image_out": image}, {"/image_in": f"{image} depth=3"}) as peer,
        subprocess.Popen(command, env=dict(place.ros.environment), stdout=subprocess.PIPE, text=True) as watcher,
    ):
        try:
            assert watcher.stdout
            statuses = (json.loads(line) for line in watcher.stdout)
            peer.wait_until_connected()
            # They come one after the other: a subscriber that starts between them receives that of the hardware first.
            first = next(status for status in statuses if status["name"] == f"{NAME}: node")
            assert first["level"] == 0
            hardware = next(
                status for status in statuses if status["name"] == f"{NAME}: hardware" and len(status["values"]) == 13
            )
            assert main(["status", f"node:{NAME}", "--system", str(place.specification())]) == 0
            for number in range(2):
                peer.publish("/image_in", place.image(number))
                peer.take()
            with stopped(node):
                for number in range(2, MESSAGES):
                    peer.publish("/image_in", place.image(number))
                peer.wait_until_published()
            # After it, all others have come, or were lost.
            peer.publish("/image_in", place.image(MESSAGES))
            while place.number(peer.take()[1]) != MESSAGES:
                continue
            own = (status for status in statuses if status["name"] == f"{NAME}: node")
            warning = next(status for status in own if status["level"])
            prefix = "image_in " if kind == "live" else ""
            names = [f"{prefix}{name}" for name in ("received", "dropped", "sent", "lost")]
            calm = (status for status in own if not status["level"])
            told = (tuple(int(status["values"][name]) for name in names) for status in calm)
            last = next(found for found in told if found[0] + found[3] == MESSAGES + 1 == sum(found[1:]))
        finally:
            watcher.kill()
        assert node.stop() == 0
    # A busy machine may take longer for an answer than the node waits.
    hardware["values"].pop("accesses without an answer")
    assert hardware["values"] == {name: str(count) for name, count in HARDWARE.items()}
    assert re.search(r"text_in +\w{8} +17 +0 cycles  2 of code 7\n", capsys.readouterr().out)
    assert warning["level"] == 1
    assert int(first["values"][names[0]]) == 0
    assert last == counts(node, "image_in")


@pytest.mark.thorough
@pytest.mark.parametrize("depth", [100, 1000])
@both_kinds
def test_a_thousand_messages_a_second(place: Place, kind: str, depth: int) -> None:
    """Each message comes back or is counted; how many do depends on the machine, and is printed."""
    with place.angles(kind, "--depth", str(depth)) as node:
        (found,) = paced(place.ros, RATE, SECONDS, [("/QuaternionToEuler_sub", "/QuaternionToEuler_pub")])
        assert node.stop() == 0
    received, dropped, sent, lost = counts(node, "QuaternionToEuler_sub")
    came = len(found["z"])
    print(f"ROS {place.ros.version}, {kind}, {depth}: sent {found['sent']}, came {came}, {dropped=}, {lost=}")
    assert found["sent"] == RATE * SECONDS == received + lost
    assert received == dropped + sent
    assert came == sent
