"""Simulated systems as nodes of real ROS: `firm live` and generated nodes in Python, with peers of rospy and rclpy."""

from __future__ import annotations

import csv
import json
import random
import re
import signal
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from fusesoc_firm.cli import main
from tests.ros.cpp_nodes import Peer, Ros, check_angles
from tests.ros.live_nodes import LiveNode, model_address, paced, specification
from tests.ros.places import running, versions

# Topics of no bytes and of any number, with no accelerator between.
pytestmark = pytest.mark.check
ECHO = """\
project: {name: echo, width: 512}
blocks:
  - {name: empty_in, middleware: ROS, mode: subscriber, message: std_msgs/Empty, outgoing: [{name: empty_out}]}
  - {name: empty_out, middleware: ROS, mode: publisher, message: std_msgs/Empty}
  - {name: text_in, middleware: ROS, mode: subscriber, message: std_msgs/String,
     maxLength: 16384, outgoing: [{name: text_out}]}
  - {name: text_out, middleware: ROS, mode: publisher, message: std_msgs/String}
  - {name: image_in, middleware: ROS, mode: subscriber, message: sensor_msgs/Image,
     maxLength: 8388608, outgoing: [{name: image_out}]}
  - {name: image_out, middleware: ROS, mode: publisher, message: sensor_msgs/Image}
"""
FULL_HD = 1920 * 1080 * 3


@dataclass
class Place:
    """A version of ROS that runs, and a folder for its tests."""

    ros: Ros
    folder: Path

    def live(self, *arguments: str | Path) -> LiveNode:
        """`firm live`, whose simulators are shared by these tests."""
        build = ["--build-root", str(self.folder / "simulators")]
        return LiveNode(self.ros, self.folder / "node.log", ["live", *map(str, arguments), *build])

    def echo(self, *arguments: str | Path) -> LiveNode:
        """The echo before a model of hardware, unless the arguments have another transport."""
        given = [] if "--transport" in arguments else ["--transport", model_address("--width", "512")]
        return self.live(self.echo_specification(), *given, *arguments)

    def echo_specification(self) -> Path:
        path = self.folder / "echo.yaml"
        path.write_text(self.spelled(ECHO), encoding="utf-8")
        return path

    def mixed_specification(self) -> Path:
        """quat2euler and the echo in one system, so that one simulator serves several tests."""
        folder = self.folder / "mixed"
        folder.mkdir(exist_ok=True)
        spec = specification("quat2euler", self.ros.version, folder)
        text = spec.read_text(encoding="utf-8")
        if "image_in" not in text:
            text = text.replace("name: quat2euler\n", "name: quat2euler\n  width: 64\n", 1)
            spec.write_text(text + self.spelled(ECHO).partition("blocks:\n")[2], encoding="utf-8")
        return spec

    def spelled(self, text: str) -> str:
        """A specification in this version."""
        return text if self.ros.version == 1 else re.sub(r"\bROS\b", "ROS2", text)

    def type(self, name: str) -> str:
        """A message's name in this version."""
        return name if self.ros.version == 1 else name.replace("/", "/msg/")

    def peer(self, **messages: str) -> Peer:
        """A peer that hears `<name>_out` and publishes `<name>_in` for each name with its message."""
        types = {name: self.type(message) for name, message in messages.items()}
        return Peer(
            self.ros,
            {f"/{name}_out": message for name, message in types.items()},
            {f"/{name}_in": message for name, message in types.items()},
        )


@pytest.fixture(scope="module", params=versions("live"))
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with running(request, tmp_path_factory) as (ros, folder):
        yield Place(ros, folder)


@dataclass(frozen=True)
class Payload:
    """A serialised message, and where in it padding is: it may hold any byte in ROS 2."""

    data: bytes
    padding: frozenset[int]

    def is_in(self, version: int, other: bytes) -> bool:
        """Whether another payload is the same message: rospy numbers headers itself, ROS 2 may pad the end."""
        if not len(self.data) <= len(other) <= len(self.data) + (0 if version == 1 else 3):
            return False
        unsure = self.padding | (set(range(4)) if version == 1 else set())
        return all(
            one == two or place in unsure for place, (one, two) in enumerate(zip(self.data, other, strict=False))
        )


class Writer:
    """Payloads of a version's messages, by its rules."""

    def __init__(self, version: int) -> None:
        self.is_first = version == 1
        self._data = bytearray(b"" if self.is_first else b"\0\1\0\0")
        self._origin = len(self._data)
        self._padding: set[int] = set()

    @property
    def payload(self) -> Payload:
        return Payload(bytes(self._data), frozenset(self._padding))

    def put(self, form: str, *values: float) -> Writer:
        """Numbers of one form, each aligned where the version has it."""
        for value in values:
            if not self.is_first:
                gap = -(len(self._data) - self._origin) % struct.calcsize(form)
                self._padding.update(range(len(self._data), len(self._data) + gap))
                self._data += bytes(gap)
            self._data += struct.pack(f"<{form}", value)
        return self

    def text(self, text: str) -> Writer:
        """A string; ROS 2 counts the NUL."""
        end = b"" if self.is_first else b"\0"
        self.put("I", len(text) + len(end))
        self._data += text.encode() + end
        return self

    def bytes(self, data: bytes) -> Writer:
        """A sequence of bytes."""
        self.put("I", len(data))
        self._data += data
        return self

    def header(self, number: int) -> Writer:
        """A header by whose stamp a message is known."""
        if self.is_first:
            self.put("I", 0)
        return self.put("I", number, 0).text("map")


def image(version: int, number: int, data: bytes) -> Payload:
    writer = Writer(version).header(number).put("I", 1, len(data)).text("mono8")
    return writer.put("B", 0).put("I", len(data)).bytes(data).payload


def noise(version: int, number: int, source: random.Random) -> Payload:
    return image(version, number, source.randbytes(source.randrange(1500)))


def twist(version: int, number: int, source: random.Random) -> Payload:
    return Writer(version).header(number).put("d", *(source.gauss(0, 1) for _ in range(6))).payload


def scan(version: int, number: int, source: random.Random) -> Payload:
    writer = Writer(version).header(number).put("f", *(source.gauss(0, 1) for _ in range(7)))
    for _ in range(2):
        values = [float(source.randrange(1000)) for _ in range(source.choice((0, 1, 2, 90)))]
        writer.put("I", len(values)).put("f", *values)
    return writer.payload


@contextmanager
def connected(node: LiveNode, peer: Peer) -> Iterator[Peer]:
    """The peer, when both find each other."""
    with peer:
        node.wait_until_ready()
        peer.wait_until_connected()
        # rospy's publisher knows a subscriber a moment after that knows it.
        time.sleep(0.5)
        yield peer


def test_quaternions_come_back_as_angles(place: Place) -> None:
    """The whole way: a real peer, the node, the VHDL in GHDL; and the trace of it, in both kinds of time."""
    version = place.ros.version
    source = random.Random(version)
    table = place.folder / "ways.csv"
    types = [place.type(f"geometry_msgs/{name}") for name in ("Point", "Quaternion")]
    prefix = Writer(version).payload.data
    with (
        place.live(specification("quat2euler", version, place.folder), "--ros", str(version), "--trace", table) as node,
        connected(
            node, Peer(place.ros, {"/QuaternionToEuler_pub": types[0]}, {"/QuaternionToEuler_sub": types[1]})
        ) as peer,
    ):
        for _ in range(20):
            check_angles(peer, source, prefix)
        assert node.stop() == 0
        assert re.search(r"QuaternionToEuler_sub +20 +0 +20 +0 +0\n", node.said())
    rows = [*csv.DictReader(table.open(encoding="utf-8"))]
    assert len(rows) == 20
    for row in rows:
        # A frame of 37 or 41 bytes at 8 bits, one of 29 or 33.
        assert int(row["input_cycles"]) == int(row["bytes_in"]) + 4
        assert int(row["output_cycles"]) == int(row["bytes_out"]) + 4
        assert 50 < int(row["accelerator_cycles"]) < 200
        times = [int(row[name]) for name in ("received_ns", "queued_ns", "sent_ns", "published_ns")]
        assert times == sorted(times)
    picture = place.folder / "ways.svg"
    assert main(["trace", str(table), "-o", str(picture)]) == 0
    assert picture.read_text(encoding="utf-8").count("accelerator: p50 ") == 1


def test_any_size_goes_through(place: Place) -> None:
    """From a message of no bytes and a string of none to an image of 6 MB, through simulated converters."""
    version = place.ros.version
    types = {"empty": "std_msgs/Empty", "text": "std_msgs/String", "image": "sensor_msgs/Image"}
    with (
        place.live(place.mixed_specification(), "--tool", "verilator") as node,
        connected(node, place.peer(**types)) as peer,
    ):
        # ROS 2 has no empty struct.
        empty = b"" if version == 1 else b"\0\1\0\0\0"
        peer.publish("/empty_in", empty)
        topic, payload = peer.take()
        assert topic == "/empty_out" and payload[:5] == empty
        for text in ("", "a", "x" * 10_000):
            sent = Writer(version).text(text).payload
            peer.publish("/text_in", sent.data)
            topic, payload = peer.take()
            assert topic == "/text_out" and payload[: len(sent.data)] == sent.data
        for size in (0, 1, 63, 64, 65_536, FULL_HD):
            sent = image(version, size, random.Random(size).randbytes(size))
            peer.publish("/image_in", sent.data)
            topic, payload = peer.take()
            assert topic == "/image_out" and sent.is_in(version, payload), size
        assert node.stop(signal.SIGTERM) == 0


def test_any_bytes_may_follow_a_message(place: Place) -> None:
    """rclpy's serialize_message returns its whole buffer, and nodes publish it.

    Of a message of fixed size, Fast DDS sends at most three bytes more.
    """
    if place.ros.version == 1:
        pytest.skip("publishers of ROS 1 append nothing")
    types = {"text": "std_msgs/String", "image": "sensor_msgs/Image"}
    sent = {"text": Writer(2).text("a").payload.data, "image": image(2, 1, b"pixels").data}
    with (
        place.live(place.mixed_specification(), "--tool", "verilator") as node,
        connected(node, place.peer(**types)) as peer,
    ):
        for more in (1, 3, 4, 5, 8, 92, 200):
            for name, payload in sent.items():
                peer.publish(f"/{name}_in", payload + b"\xee" * more, is_raw=True)
                topic, came = peer.take()
                assert topic == f"/{name}_out" and came[: len(payload)] == payload, more
        assert node.stop() == 0


def test_frames_of_all_types_through_a_preemptive_system(place: Place) -> None:
    """multi_type: images wait while twists and scans interrupt them; each comes whole, and each topic in its order."""
    version = place.ros.version
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    source = random.Random(seed)
    count, window = 300, 20
    types = {"twist": "geometry_msgs/TwistStamped", "scan": "sensor_msgs/LaserScan", "image": "sensor_msgs/Image"}
    makers = {
        "twist": twist,
        "scan": scan,
        "image": noise,
    }
    waiting: dict[str, list[Payload]] = {name: [] for name in types}
    spec = specification("multi_type", version, place.folder)
    with place.live(spec, "--queue", "100") as node, connected(node, place.peer(**types)) as peer:
        taken = 0
        for number in range(count + window):
            if number < count:
                name = source.choice([*types])
                payload = makers[name](version, number, source)
                waiting[name].append(payload)
                peer.publish(f"/{name}_in", payload.data)
            if number >= window:
                topic, came = peer.take()
                expected = waiting[topic.strip("/").removesuffix("_out")].pop(0)
                assert expected.is_in(version, came), f"{topic}: {came[:40]!r} for {expected.data[:40]!r}"
                taken += 1
        assert taken == count
        assert node.stop() == 0
        assert not any(waiting.values())


def test_a_rate_is_held(place: Place) -> None:
    """5 s at 100 Hz: nothing is lost, and all comes in order. `make bench BENCH=live` has a minute of it.

    All fit the queue, as a busy machine may not let the node work for a while.
    """
    with place.live(place.mixed_specification(), "--tool", "verilator", "--queue", "500") as node:
        node.wait_until_ready()
        (found,) = paced(place.ros, 100, 5, [("/QuaternionToEuler_sub", "/QuaternionToEuler_pub")])
        assert node.stop() == 0
    assert found["sent"] == len(found["z"]) == 500
    assert found["z"] == pytest.approx([number / 1000 - 3 for number in range(500)], abs=1e-9)


def test_a_peer_that_dies_and_comes_back_is_served_again(place: Place) -> None:
    version = place.ros.version
    with place.echo() as node:
        for number in range(2):
            with connected(node, place.peer(image="sensor_msgs/Image")) as peer:
                sent = image(version, number, b"pixels")
                peer.publish("/image_in", sent.data)
                assert sent.is_in(version, peer.take()[1])
                # One that nobody is there for any more.
                peer.publish("/image_in", image(version, 7, bytes(500_000)).data)
                peer.kill()
        assert node.stop() == 0


@pytest.mark.parametrize(
    ("fault", "said"),
    [("garbage", "the simulator"), ("cut", "the simulator ended with status 4"), ("kill", "the simulator")],
)
def test_a_simulator_that_fails_ends_the_node(place: Place, fault: str, said: str) -> None:
    """Garbage on the pipe, an end within a burst, a kill: the node says so, and its exit status is 1."""
    address = model_address("--width", "512", "--fault", fault, "--at", "1")
    with place.echo("--transport", address) as node, connected(node, place.peer(image="sensor_msgs/Image")) as peer:
        for number in range(2):
            peer.publish("/image_in", image(place.ros.version, number, bytes(100)).data)
        assert node.wait() == 1
        assert f"error: {said}" in node.said()
        assert "Traceback" not in node.said()


def test_a_simulator_that_is_killed_in_mid_frame_is_started_again(place: Place) -> None:
    """Each one dies when it has taken its second frame, and with it that frame."""
    version = place.ros.version
    address = model_address("--width", "512", "--fault", "kill", "--at", "1")
    with (
        place.echo("--transport", address, "--restart") as node,
        connected(node, place.peer(image="sensor_msgs/Image")) as peer,
    ):
        for number in range(3):
            sent = image(version, number, bytes(100))
            peer.publish("/image_in", sent.data)
            assert sent.is_in(version, peer.take()[1])
            peer.publish("/image_in", image(version, 100 + number, bytes(100)).data)
            node.wait_until_said("the hardware is restarted", number + 1)
        assert node.stop() == 0
        assert "restarts: 3" in node.said()


def test_what_was_taken_is_published_before_the_end(place: Place) -> None:
    """The hardware needs a while for each frame, so most are under way when Ctrl-C comes."""
    version = place.ros.version
    address = model_address("--width", "512", "--latency", "4000")
    with (
        place.echo("--transport", address, "--queue", "100") as node,
        connected(node, place.peer(image="sensor_msgs/Image")) as peer,
    ):
        for number in range(60):
            peer.publish("/image_in", image(version, number, bytes(100)).data)
        came = [peer.take()[1]]
        assert node.stop() == 0
        row = re.search(r"image_in +(\d+) +(\d+) +(\d+) ", node.said())
        assert row and row[2] == "0" and row[1] == row[3]
        came += [peer.take()[1] for _ in range(int(row[1]) - 1)]
        assert all(image(version, number, bytes(100)).is_in(version, payload) for number, payload in enumerate(came))


def test_ros_kills_or_loses_the_node(place: Place) -> None:
    """The process that is the node in ROS is killed: ours says so, and ends."""
    with place.echo() as node:
        node.wait_until_ready()
        node.kill_child("node/bridge")
        assert node.wait() == 1
        assert f"the process for ROS {place.ros.version} ({place.ros.python}) has ended" in node.said()


def test_names_are_those_that_ros_is_told(place: Place) -> None:
    """A name, a namespace and a remapping, and a generated node in place of `firm live`."""
    version = place.ros.version
    folder = place.folder / "generated"
    assert main(["system", "node", str(place.echo_specification()), "--language", "python", "-o", str(folder)]) == 0
    namespace = ["__ns:=/robot"] if version == 1 else ["--ros-args", "-r", "__ns:=/robot"]
    options = ["--transport", model_address("--width", "512"), "--name", "eye", "image_in:=/camera"]
    # What is ROS 2's own comes last.
    node = LiveNode(place.ros, folder / "node.log", [str(folder / "echo_node.py"), *options], *namespace)
    message = place.type("sensor_msgs/Image")
    with node, connected(node, Peer(place.ros, {"/robot/image_out": message}, {"/camera": message})) as peer:
        sent = image(version, 5, b"pixels")
        peer.publish("/camera", sent.data)
        assert sent.is_in(version, peer.take()[1])
        assert "/camera -> image_in" in node.said()
        assert "image_out -> /robot/image_out" in node.said()
        assert node.stop() == 0


def test_a_type_that_is_not_installed_is_named(place: Place) -> None:
    if place.ros.version == 1:
        pytest.skip("ROS 1 needs no installed message")
    spec = place.folder / "odd.yaml"
    (place.folder / "odd/odd_msgs/msg").mkdir(parents=True)
    (place.folder / "odd/odd_msgs/msg/Odd.msg").write_text("int32 x\n", encoding="utf-8")
    spec.write_text(place.spelled(ECHO.replace("std_msgs/Empty", "odd_msgs/Odd")), encoding="utf-8")
    arguments = ("--transport", model_address(), "--path", str(place.folder / "odd"))
    with place.live(spec, *arguments) as node:
        assert node.wait() == 1
        assert f"the message 'odd_msgs/msg/Odd' is not installed for {place.ros.python}" in node.said()


def test_a_version_that_the_system_does_not_speak_is_told(place: Place) -> None:
    other = 3 - place.ros.version
    with place.echo("--ros", str(other)) as node:
        assert node.wait() == 1
        assert f"error: system 'echo' has no ROS {other} topics, only topics of ROS {place.ros.version}" in node.said()


def test_a_page_shows_the_messages_of_the_node(place: Place) -> None:
    """`--watch` serves the page of a run that the page does not control."""
    text = struct.pack("<I", 5) + (b"hello" if place.ros.version == 1 else b"hell\0")
    payload = text if place.ros.version == 1 else b"\0\1\0\0" + text
    with place.echo("--watch", "--no-browser") as node, place.peer(text="std_msgs/String") as peer:
        node.wait_until_ready()
        peer.wait_until_connected()
        peer.publish("/text_in", payload)
        peer.take()
        address = re.search(r"http://127\.0\.0\.1:\d+/\S+/", node.said())
        assert address
        with urlopen(f"{address[0]}api/record?before=2", timeout=60) as answer:
            rows = json.load(answer)["messages"]
        assert [row[:2] for row in rows] == [[0, "text_in"], [1, "text_out"]]
        assert rows[1][4] == 0
        assert rows[1][6] > 0
        with urlopen(f"{address[0]}api/message?number=1", timeout=60) as answer:
            fields = json.load(answer)["fields"]
        assert fields == [["data", "hello" if place.ros.version == 1 else "hell", ""]]
        body = Request(f"{address[0]}api/control", b'{"do": "stop"}', {"Content-Type": "application/json"})
        with pytest.raises(HTTPError, match="400"):
            urlopen(body, timeout=60)
        assert node.stop() == 0
