"""The reference of a node in fabric with real peers: rclpy with Fast DDS, and Cyclone DDS, in network namespaces."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from queue import Empty, Queue
from typing import Any, TypeVar

import pytest

from tests.fabric.dissection import read_alike
from tests.fabric.hosts import Host, captured, missing, switched
from tests.fabric.messages import AckNack, Data, DataFrag, Heartbeat, InfoDestination, NackFrag, Other
from tests.ros.cpp_nodes import missing_ros, ros2
from tests.seeds import seeded

HERE = Path(__file__).parent
SEED = seeded(20261126)
TYPES = {"turn": "Quaternion", "text": "String"}
ECHO = """\
project:
  name: board
  width: 64
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:01", address: 192.0.2.1}
blocks:
  - {name: turn_in, middleware: ROS2, mode: subscriber, message: geometry_msgs/Quaternion, qos: QUALITY,
     outgoing: [{name: turn_out}]}
  - {name: text_in, middleware: ROS2, mode: subscriber, message: std_msgs/String, qos: QUALITY, maxLength: 65536,
     outgoing: [{name: text_out}]}
  - {name: turn_out, middleware: ROS2, mode: publisher, message: geometry_msgs/Quaternion, qos: QUALITY}
  - {name: text_out, middleware: ROS2, mode: publisher, message: std_msgs/String, qos: QUALITY}
"""
# Programs of DDS are never idle, so that a test which waits for them ends by itself.
MOST_SECONDS = 120
# A payload has 9 bytes besides the text, and at most 65536.
SIZES = (0, 1, 2, 3, 100, 1335, 1336, 1471, 1473, 5000, 20_000, 65_527)

Sample = tuple[str, list[Any]]


def _why_not() -> str:
    try:
        import cyclonedds  # noqa: F401
    except ImportError:
        return "cyclonedds is not installed; its wheels are for Python 3.13 and earlier"
    return missing() or missing_ros(2)


pytestmark = [pytest.mark.check, pytest.mark.xdist_group("fabric")]


class Process:
    """A program on a host that speaks by lines of JSON."""

    def __init__(self, host: Host, words: Sequence[str], environment: Mapping[str, str] | None = None) -> None:
        self._process = subprocess.Popen(
            host.command(*words), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )
        self._lines: Queue[str] = Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put("")

    def tell(self, value: object) -> None:
        assert self._process.stdin
        self._process.stdin.write(value if isinstance(value, str) else json.dumps(value) + "\n")
        self._process.stdin.flush()

    def line(self) -> Any:
        try:
            line = self._lines.get(timeout=MOST_SECONDS)
        except Empty:
            pytest.fail(f"no line for {MOST_SECONDS} s from {self._process.args!r}")
        assert line, self._process.args
        return json.loads(line)

    def wait(self) -> int:
        """Wait for its end, whatever it prints till then."""
        return self._process.wait()

    def send_signal(self, number: signal.Signals) -> None:
        self._process.send_signal(number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)
        self._process.wait()


AnyProcess = TypeVar("AnyProcess", bound=Process)


class Peer(Process):
    """A peer of rclpy or of Cyclone DDS."""

    _is_started = False

    def wait_until_started(self) -> None:
        """Wait until it has all its publishers and subscribers."""
        if not self._is_started:
            assert self.line() == {"started": True}
            self._is_started = True

    def wait_until_matched(self) -> float:
        """The seconds that it took."""
        self.wait_until_started()
        return float(self.line()["matched"])

    def send(self, samples: Sequence[Sample]) -> None:
        for sample in samples:
            self.tell(sample)

    def take(self, count: int) -> list[Sample]:
        """The next samples that come."""
        return [(topic, values) for topic, values in (self.line() for _ in range(count))]

    def next_sample(self, seconds: float) -> Sample | None:
        """The next sample, if one comes within a time."""
        try:
            topic, values = json.loads(self._lines.get(timeout=seconds))
        except Empty:
            return None
        return topic, values

    @property
    def is_quiet(self) -> bool:
        """Whether it has said nothing that was not read."""
        return self._lines.empty()


class Place:
    """Three hosts at a switch: the board, one with rclpy and one with Cyclone DDS."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self._stack, self.folder = stack, folder
        self._ros = ros2(folder)
        self.switch, self._board, *self._hosts = stack.enter_context(switched(3))

    def board(self, quality: str = "{depth: 1000}", *options: str) -> Process:
        """The node in fabric, which returns what it gets."""
        path = self.folder / "echo.yaml"
        path.write_text(ECHO.replace("QUALITY", quality), encoding="utf-8")
        assert self._board.address == "192.0.2.1"
        words = [sys.executable, "-m", "tests.fabric.echo_node", str(path), *options]
        started = self._started(Process(self._board, words))
        assert started.line() == {"ready": True}
        return started

    def peers(self, reliability: str = "reliable") -> dict[str, Peer]:
        """One peer of each kind."""
        others = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DOMAIN_ID")
        environment = {name: value for name, value in self._ros.environment.items() if name not in others}
        options = [reliability, json.dumps(TYPES)]
        ros = [self._ros.python, str(HERE / "ros_peer.py"), *options]
        cyclone = [sys.executable, str(HERE / "cyclone_peer.py"), *options]
        return {
            "rclpy": self._started(Peer(self._hosts[0], ros, environment)),
            "cyclone": self._started(Peer(self._hosts[1], cyclone, dict(os.environ))),
        }

    def _started(self, process: AnyProcess) -> AnyProcess:
        self._stack.callback(process.kill)
        return process


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Place]:
    if reason := _why_not():
        pytest.skip(reason)
    with ExitStack() as stack:
        yield Place(tmp_path, stack)


def samples(name: str, turns: int, sizes: Sequence[int] = SIZES) -> list[Sample]:
    """What a peer sends; its name is in each."""
    mark = float(len(name))
    texts = [("text", [name[0] * size]) for size in sizes]
    return [*(("turn", [float(number), mark, -0.5, 1e300]) for number in range(turns)), *texts]


def of(topic: str, all_: Sequence[Sample]) -> list[list[Any]]:
    return [values for name, values in all_ if name == topic]


def is_in(part: Sequence[object], whole: Sequence[object]) -> bool:
    """Whether the whole without some of its items is the part."""
    left = iter(whole)
    return all(item in left for item in part)


def wait_until_known(board: Process) -> None:
    """The board matches the four endpoints of each peer and rclpy's reader of the graph, and both know the board's."""
    while board.line() != {"peers": 2, "matches": 9, "knowing": 2}:
        pass


def check_echoes(peers: Mapping[str, Peer], sent: Mapping[str, list[Sample]]) -> None:
    """Each peer gets each sample of each peer once, and those of one peer in order."""
    count = sum(map(len, sent.values()))
    for peer in peers.values():
        came = peer.take(count)
        for topic in TYPES:
            found = of(topic, came)
            assert len(found) == sum(len(of(topic, own)) for own in sent.values())
            assert all(is_in(of(topic, own), found) for own in sent.values())


@pytest.mark.parametrize("is_board_first", [True, False])
def test_both_see_the_node_and_get_every_message_in_order(place: Place, is_board_first: bool) -> None:
    board = place.board() if is_board_first else None
    peers = place.peers()
    board = board or place.board()
    print({name: peer.wait_until_matched() for name, peer in peers.items()})
    wait_until_known(board)
    sent = {name: samples(name, 100) for name in peers}
    for name, peer in peers.items():
        peer.send(sent[name])
    check_echoes(peers, sent)
    peers["rclpy"].tell('"graph"\n')
    graph = peers["rclpy"].line()
    assert ["board", "/"] in graph["nodes"]
    assert ["/text_out", ["std_msgs/msg/String"]] in graph["topics"]
    assert len(graph["ends"]) == 4
    assert all(end[:2] == ["board", "/"] and end[3].startswith("RIHS01_") for end in graph["ends"])


@pytest.mark.thorough
def test_lost_packets_are_sent_again(place: Place) -> None:
    board = place.board("{depth: 1000}", "--loss", "20", "--seed", str(SEED))
    print(f"seed {SEED}")
    peers = place.peers()
    for peer in peers.values():
        peer.wait_until_matched()
    wait_until_known(board)
    sent = {name: samples(name, 60, (10, 3000)) for name in peers}
    for name, peer in peers.items():
        peer.send(sent[name])
    check_echoes(peers, sent)
    board.tell("stop\n")


def test_best_effort_messages_arrive(place: Place) -> None:
    board = place.board("{reliability: best_effort}")
    peers = place.peers("best_effort")
    for peer in peers.values():
        peer.wait_until_matched()
    wait_until_known(board)
    for name, peer in peers.items():
        first: Sample = ("turn", [0.0, float(len(name)), 0.0, 0.0])
        peer.send([first])
        for other in peers.values():
            assert other.take(1) == [first]


def test_a_node_that_crashes_and_restarts_is_found_again(place: Place) -> None:
    board = place.board()
    peers = place.peers()
    for peer in peers.values():
        peer.wait_until_matched()
    board.kill()
    again = place.board()
    # The peers of the first life see the second one: they acknowledge its endpoints, and it matches theirs.
    wait_until_known(again)
    sent = {name: samples(name, 20, (10, 3000)) for name in peers}
    for name, peer in peers.items():
        peer.send(sent[name])
    check_echoes(peers, sent)


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_all_their_packets_as_the_reference_does(place: Place) -> None:
    capture = place.folder / "switch.pcapng"
    with captured(place.switch, capture):
        board = place.board("{depth: 1000}", "--loss", "5", "--seed", str(SEED))
        peers = place.peers()
        for peer in peers.values():
            peer.wait_until_matched()
        wait_until_known(board)
        sent = {name: samples(name, 30, (10, 3000, 65_527)) for name in peers}
        for name, peer in peers.items():
            peer.send(sent[name])
        check_echoes(peers, sent)
        for peer in peers.values():
            peer.tell('"farewell"\n')
            assert peer.wait() == 0
        board.tell("stop\n")
        board.wait()
    kinds = {type(item) for _, message in read_alike(capture) for item in message.submessages}
    assert kinds >= {Data, DataFrag, Heartbeat, AckNack, NackFrag, InfoDestination, Other}
