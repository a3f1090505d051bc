"""A node of ROS 1 in a chip's sockets among those of rospy and roscpp: interpreted, and as hardware at the pins."""

from __future__ import annotations

import math
import random
import re
import shutil
import socket
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from rosbags.highlevel import AnyReader

from fusesoc_firm.fabric.ros1 import Node, image
from fusesoc_firm.fabric.wiznet.chip import Status
from fusesoc_firm.fabric.wiznet.chips import MODELS
from tests.ros.cpp_nodes import Ros, missing_ros1, ros1
from tests.ros.live_nodes import paced
from tests.seeds import seeded
from tests.wiznet.peers import free_port
from tests.wiznet.ros1 import Board, Frame, Manager, Stalls, clocked, endpoint, framed, hardware, interpreted, node
from tests.wiznet.ros1_peers import LONGEST_SECONDS, Running, header, header_of, read
from tests.wiznet.sequencer import ACCESSES, Sequencer
from tests.wiznet.test_ros1_frames import Publisher

SEED = seeded(20261126)
HERE = Path(__file__).parent
ROS = HERE.parent / "ros"
TURN, PLACE = endpoint("/turn", "geometry_msgs", "Quaternion"), endpoint("/place", "geometry_msgs", "Point")
TOOLS = ("rosnode", "rostopic", "rosbag")

pytestmark = [pytest.mark.check, pytest.mark.skipif(bool(missing_ros1()), reason=missing_ros1())]


def _first_three(_: int, payload: bytes) -> Iterator[tuple[int, bytes]]:
    """The accelerator: x, y and z of each quaternion as a point."""
    yield 0, payload[:24]


def _thrice(number: int, payload: bytes) -> Iterator[tuple[int, bytes]]:
    """An accelerator with three answers to each quaternion."""
    for _ in range(3):
        yield from _first_three(number, payload)


def _node(ros: Ros) -> Node:
    master = urlsplit(ros.environment["ROS_MASTER_URI"])
    return node((str(master.hostname), int(master.port or 0)), (TURN,), (PLACE,))


def _check_paced(results: list[dict[str, Any]], count: int) -> None:
    for result in results:
        assert result["sent"] == count
        assert result["z"] == [math.sin((number / 1000 - 3) / 2) for number in range(count)]


@pytest.mark.parametrize("number", MODELS)
def test_the_interpreter_answers_rospy(tmp_path: Path, number: int) -> None:
    with ros1(tmp_path) as ros, closing(interpreted(_node(ros), number, Manager(_first_three))):
        _check_paced(paced(ros, 50, 2, [("/turn", "/place")]), 100)


@dataclass
class Clocked:
    """The hardware of a chip, running, and what it did."""

    ros: Ros
    node: Node
    board: Board
    manager: Manager
    log: list[Frame]
    chip: int


@pytest.fixture(scope="module", params=[pytest.param(5200, marks=pytest.mark.thorough), 5500], ids="w{}".format)
def program(request: pytest.FixtureRequest) -> tuple[int, Path]:
    return request.param, hardware(request.param)


@pytest.fixture
def running(program: tuple[int, Path], tmp_path: Path) -> Iterator[Clocked]:
    print(f"seed {SEED}")
    with ros1(tmp_path) as ros:
        made, manager, log = _node(ros), Manager(_first_three), list[Frame]()
        board = clocked(made, program[0], manager, program[1], Stalls(SEED), log)
        with closing(board):
            board.wait_until_listening()
            yield Clocked(ros, made, board, manager, log, program[0])


class Recorded:
    """The chip that a run of hardware had, for the interpreter: answers the same, and expects the same."""

    sequencer: Sequencer

    def __init__(self, log: list[Frame]) -> None:
        self._log = log
        self._index = -1
        self.milliseconds = 0

    @property
    def is_over(self) -> bool:
        """Whether the next frame is not in the record."""
        return self._index + 1 == len(self._log)

    def select(self) -> None:
        """The next frame begins."""
        self._index += 1
        self._byte = 0
        self.milliseconds += self._log[self._index].milliseconds
        self.sequencer.offered.extend(self._log[self._index].offered)

    def answer(self) -> int:
        """The byte that the hardware read."""
        return self._log[self._index].answered[self._byte]

    def take(self, byte: int) -> None:
        """A byte of the interpreter."""
        assert byte == self._log[self._index].sent[self._byte], (self._index, self._byte)
        self._byte += 1

    def deselect(self) -> None:
        """The frame ends."""
        assert self._byte == len(self._log[self._index].sent), self._index


def _check_lock_step(running: Clocked) -> None:
    """The interpreter sends the same SPI frames, and gives the same to the Manager."""
    whole = running.log[:-1]  # the last one may be cut
    slave = Recorded(whole)
    sequencer = Sequencer(
        image(running.node, running.chip), ACCESSES[running.chip](slave), lambda: slave.milliseconds // 64
    )
    slave.sequencer = sequencer
    try:
        while not slave.is_over:
            sequencer.step()
    except IndexError:  # an access of the W5200 has a second frame, which the record cuts off
        assert slave.is_over
    manager = Manager(_first_three)
    for byte, is_last in sequencer.given:
        manager.take(byte, is_last)
    assert len(manager.taken) > 0
    assert manager.taken == running.manager.taken[: len(manager.taken)]


def _roscpp(running: Clocked, folder: Path, count: int) -> subprocess.Popen[str]:
    peer = folder / "peer"
    options = ["-std=c++17", "-O0", "-pthread", str(HERE / "ros1_peer.cpp"), "-o", str(peer)]
    subprocess.run(["g++", *options, *running.ros.libraries], check=True)
    words = [str(peer), "/turn", "/place", str(count), TURN.md5, PLACE.md5]
    return subprocess.Popen(words, env=dict(running.ros.environment), stdout=subprocess.PIPE, text=True)


def test_the_hardware_answers_rospy_and_roscpp_as_the_interpreter_does(running: Clocked, tmp_path: Path) -> None:
    _check_paced(paced(running.ros, 20, 1, [("/turn", "/place")]), 20)
    peer = _roscpp(running, tmp_path, 20)
    assert peer.communicate()[0].strip() == "20"
    running.board.stop()
    _check_lock_step(running)


def _tool(ros: Ros, *words: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, env=dict(ros.environment), cwd=folder, capture_output=True, text=True, check=False)


@contextmanager
def _started(ros: Ros, *words: str) -> Iterator[subprocess.Popen[str]]:
    """A program of ROS, which ends with the context."""
    variables = {**ros.environment, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(words, env=variables, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as tool:
        try:
            yield tool
        finally:
            tool.kill()


def _peer(ros: Ros) -> AbstractContextManager[subprocess.Popen[str]]:
    """A node of rospy that sends quaternions and is killed at the end."""
    return _started(ros, ros.python, str(ROS / "paced_peer.py"), "1", "20", "120", '[["/turn", "/place"]]')


@pytest.mark.skipif(not all(map(shutil.which, TOOLS)), reason=f"one of {', '.join(TOOLS)} is not installed")
def test_the_tools_of_ros_know_the_hardware(running: Clocked, tmp_path: Path) -> None:
    ros = running.ros
    with _peer(ros):
        echoed = _tool(ros, "rostopic", "echo", "-p", "-n", "3", "/place").stdout.splitlines()
        assert echoed[0] == "%time,field.x,field.y,field.z"
        assert len(echoed) == 4
        _tool(ros, "rosbag", "record", "-l", "3", "-O", "places.bag", "/place", folder=tmp_path)
    script = "import rosbag; print([m._type for _, m, _ in rosbag.Bag('places.bag').read_messages()])"
    read_back = _tool(ros, ros.python, "-c", script, folder=tmp_path).stdout
    assert read_back.strip() == str(3 * ["geometry_msgs/Point"])
    with AnyReader([tmp_path / "places.bag"]) as bag:
        assert [connection.msgtype for connection in bag.connections] == ["geometry_msgs/msg/Point"]
        ((_, _, data), *others) = bag.messages()
        assert len(others) == 2
        point: Any = bag.deserialize(data, "geometry_msgs/msg/Point")
        assert point.x == 0
    listed = _tool(ros, "rostopic", "list", "-v").stdout
    assert " * /place [geometry_msgs/Point] 1 publisher" in listed
    assert " * /turn [geometry_msgs/Quaternion] 1 subscriber" in listed
    assert _tool(ros, "rostopic", "type", "/place").stdout.strip() == "geometry_msgs/Point"
    assert str(running.node.uri()) in _tool(ros, "rostopic", "info", "/place").stdout
    assert "Pid: 1" in _tool(ros, "rosnode", "info", "/fabric").stdout
    assert "xmlrpc reply from" in _tool(ros, "rosnode", "ping", "-c", "1", "/fabric").stdout
    assert "killed" in _tool(ros, "rosnode", "kill", "/fabric").stdout
    while "/fabric" in _tool(ros, "rosnode", "list").stdout:
        time.sleep(0.1)
    assert "/place" not in _tool(ros, "rostopic", "list", "-p").stdout


def _found(ros: Ros, pattern: str, *words: str) -> re.Match[str]:
    """The first match in the output of a tool, which is ended when it takes too long."""
    text = ""
    with _started(ros, "timeout", str(LONGEST_SECONDS), *words) as tool:
        assert tool.stdout
        for line in tool.stdout:
            text += line
            if found := re.search(pattern, text):
                return found
    raise AssertionError(f"{words} printed no {pattern!r}: {text}")


@pytest.mark.skipif(not all(map(shutil.which, TOOLS)), reason=f"one of {', '.join(TOOLS)} is not installed")
def test_the_tools_of_ros_publish_and_measure(running: Clocked) -> None:
    ros = running.ros
    # With --once, it ends after 3 s, also if the hardware has not connected yet on a busy machine.
    with _started(ros, "rostopic", "pub", "-r", "10", "/turn", "geometry_msgs/Quaternion", "{x: 1, y: 2, z: 3, w: 4}"):
        running.board.wait_until(lambda: (0, struct.pack("<4d", 1, 2, 3, 4)) in running.manager.taken)
    with _peer(ros):
        # Of 40 messages or more, so that a moment in which the machine is busy counts little.
        rate = _found(ros, r"average rate: (\S+)\n.*window: ([4-9]\d|\d{3,})\n", "rostopic", "hz", "/place")[1]
        assert 5 < float(rate) < 80
        # It rounds to kilobytes while a burst has more than one in a second.
        assert _found(ros, r"mean: 24\.00B", "rostopic", "bw", "/place")


@pytest.mark.skipif(not all(map(shutil.which, TOOLS)), reason=f"one of {', '.join(TOOLS)} is not installed")
def test_five_subscribers_are_served_at_once(running: Clocked) -> None:
    ros, rng = running.ros, random.Random(SEED)
    words = ["rostopic", "echo", "-p", "-n", "10", "/place"]
    sockets = running.board.chip.sockets
    with ExitStack() as stack:
        peers = [stack.enter_context(_started(ros, *words)) for _ in range(5)]
        running.board.wait_until(lambda: sum(item.status == Status.ESTABLISHED for item in sockets) == len(peers))
        latest = time.monotonic() + LONGEST_SECONDS
        while any(peer.poll() is None for peer in peers) and time.monotonic() < latest:
            running.board.send(0, struct.pack("<3d", rng.random(), 0, 0))
            time.sleep(0.05)
        for peer in peers:
            assert peer.poll() == 0
            assert len(peer.communicate()[0].splitlines()) == 11


@pytest.mark.skipif(not all(map(shutil.which, TOOLS)), reason=f"one of {', '.join(TOOLS)} is not installed")
def test_eight_subscribers_take_turns_at_four_sockets(running: Clocked) -> None:
    """Those that are refused come when others have left."""
    ros, rng, own = running.ros, random.Random(SEED), running.node
    words = ["rostopic", "echo", "-p", "-n", "10", "/place"]
    sockets = running.board.chip.sockets
    with ExitStack() as stack:
        fifth = stack.enter_context(socket.create_connection((str(own.network.address), own.port), LONGEST_SECONDS))
        fifth.sendall(header("callerid=/me", "md5sum=*", "topic=/place"))
        assert "error" not in header_of(fifth)
        peers = [stack.enter_context(_started(ros, *words)) for _ in range(8)]
        running.board.wait_until(lambda: sum(item.status == Status.ESTABLISHED for item in sockets) >= 5)
        latest = time.monotonic() + 5 * LONGEST_SECONDS
        while any(peer.poll() is None for peer in peers) and time.monotonic() < latest:
            running.board.send(0, struct.pack("<3d", rng.random(), 0, 0))
            time.sleep(0.1)
        for peer in peers:
            assert peer.poll() == 0
            assert len(peer.communicate()[0].splitlines()) == 11


@pytest.mark.skipif(not all(map(shutil.which, TOOLS)), reason=f"one of {', '.join(TOOLS)} is not installed")
def test_another_node_with_its_name_takes_its_place(running: Clocked) -> None:
    ros = running.ros
    words = ["rostopic", "pub", "/turn", "geometry_msgs/Quaternion", "{w: 1}", "__name:=fabric"]
    # One that registers for the first time after the other one takes its place instead.
    running.board.wait_until(lambda: {"/place", "/turn"} <= {*_tool(ros, "rostopic", "list").stdout.split()})
    with _started(ros, *words):
        # The hardware stops for good.
        running.board.wait_until(lambda: running.board.listening() == 0)
        running.board.wait_until(lambda: "/place" not in _tool(ros, "rostopic", "list").stdout)
    # The first one may have ended as well: if the hardware was registering again when it came, each took the other's
    # place.
    with _started(ros, *words) as other:
        turn = " * /turn [geometry_msgs/Quaternion] 1 publisher"
        running.board.wait_until(lambda: turn in _tool(ros, "rostopic", "list", "-v").stdout)
        assert f"Pid: {other.pid}" in _tool(ros, "rosnode", "info", "/fabric").stdout


def test_a_killed_peer_disturbs_nobody(running: Clocked) -> None:
    ros = running.ros
    with _peer(ros):
        while not running.manager.taken:
            time.sleep(0.05)
    _check_paced(paced(ros, 20, 1, [("/turn", "/place")]), 20)


@pytest.mark.thorough
def test_a_thousand_points_at_100_hz_reach_three_subscribers(running: Clocked) -> None:
    rng = random.Random(SEED)
    own = running.node
    with ExitStack() as stack:
        peers = []
        for _ in range(3):
            address = str(own.network.address), own.port
            peers.append(stack.enter_context(socket.create_connection(address, LONGEST_SECONDS)))
            peers[-1].sendall(header("callerid=/me", "md5sum=*", "topic=/place"))
            assert "error" not in header_of(peers[-1])
        sent, begin = [rng.randbytes(24) for _ in range(1000)], time.monotonic()
        for index, payload in enumerate(sent):
            time.sleep(max(0, begin + index / 100 - time.monotonic()))
            running.board.send(0, payload)
        for peer in peers:
            assert read(peer, 28 * 1000) == b"".join(framed(0, payload)[1:] for payload in sent)


def test_a_new_master_is_found(program: tuple[int, Path], tmp_path: Path) -> None:
    (tmp_path / "first").mkdir()
    (tmp_path / "second").mkdir()
    with ExitStack() as stack:
        with ros1(tmp_path / "first") as ros:
            board = clocked(_node(ros), program[0], Manager(_first_three), program[1], Stalls(SEED), [])
            stack.callback(board.close)
            _check_paced(paced(ros, 20, 1, [("/turn", "/place")]), 20)
            port = int(_node(ros).master[1])
        with ros1(tmp_path / "second", port) as ros:
            _check_paced(paced(ros, 20, 1, [("/turn", "/place")]), 20)


def test_answers_leave_while_messages_of_many_publishers_wait(program: tuple[int, Path]) -> None:
    """The Manager takes nothing while its answers wait, and has more answers than messages."""
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    made = node(("127.0.0.1", free_port()), (TURN,), (PLACE,))
    with ExitStack() as stack:
        board = clocked(made, program[0], Manager(_thrice), program[1], Stalls(SEED, is_strict=True), [])
        stack.callback(board.close)
        board.wait_until_listening()
        running = Running(made, board, program[0])
        publishers = [stack.enter_context(closing(Publisher(TURN))) for _ in range(3)]
        peer = stack.enter_context(running.connect())
        peer.sendall(header("callerid=/me", "md5sum=*", "topic=/place"))
        assert "error" not in header_of(peer)
        assert running.call("publisherUpdate", "/master", "/turn", [item.uri for item in publishers])[0] == 1
        for item in publishers:
            item.accept()
        for _ in range(20):
            sent = [rng.randbytes(32) for _ in publishers]
            for item, payload in zip(publishers, sent, strict=True):
                item.send(payload)
            points = sorted(framed(0, payload[:24])[1:] for payload in 3 * sent)
            assert sorted(read(peer, 28) for _ in points) == points
