"""Hardware that sends goals to real servers of actionlib and rclpy.action, which may refuse, be absent, or die."""

from __future__ import annotations

import json
import random
import re
import shutil
import time
import xmlrpc.client
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.cli import main
from tests.ros.action_server_peer import HELD, Kind
from tests.ros.action_simulator import in_ros2
from tests.ros.cpp_nodes import Client, NodeProcess, Peer, roscpp_peer
from tests.ros.places import Place, diagnoses, running, versions
from tests.ros.test_actions import skip_without_actions
from tests.runs.replay.goals import what_is_told

pytestmark = pytest.mark.check

HERE = Path(__file__).resolve().parent
ACTION = "/count"
# The kind of what the hardware tells of feedback; that of a result is the number of the state.
FEEDBACK = 0xFF
# For each version of ROS.
SUCCEEDED, CANCELED, ABORTED, REJECTED, LOST = {1: 3, 2: 4}, {1: 2, 2: 5}, {1: 4, 2: 6}, {1: 5, 2: 0}, {1: 9, 2: 0}
Told = tuple[int, int, int]


@dataclass
class Planner(Place):
    """The system of tests/ros/planner."""

    def specification(self, time_limit: str = "") -> Path:
        """The specification, with another time limit of the server if one is given."""
        folder = self.folder / "planner"
        if not folder.exists():
            shutil.copytree(HERE / "planner", folder)
            shutil.copytree(HERE / "arm", self.folder / "arm")
        text = (HERE / "planner/planner.yaml").read_text(encoding="utf-8")
        text = in_ros2(text) if self.version == 2 else text
        spec = folder / f"planner{time_limit.replace(' ', '_')}.yaml"
        spec.write_text(text.replace("timeLimit: 100 s", f"timeLimit: {time_limit or '100 s'}"), encoding="utf-8")
        return spec

    @contextmanager
    def node(self, language: str, time_limit: str = "") -> Iterator[tuple[NodeProcess, Orders]]:
        """A node in Python or C++ before the VHDL in GHDL, and the orders to it."""
        spec = self.specification(time_limit)
        kind = "std_msgs/{}UInt{}".format("" if self.version == 1 else "msg/", "{}")
        topics = {"/told": kind.format(64)}, {"/order": kind.format(32)}
        with self.node_of(spec, language, self.simulator(spec)) as node, Peer(self.ros, *topics) as peer:
            peer.wait_until_connected()
            yield node, Orders(self.version, peer)

    @contextmanager
    def server(self, *kind: str) -> Iterator[Client]:
        """A server of rospy or rclpy, or one in C++; `--simple` is SimpleActionServer."""
        command = [self.ros.python, str(HERE / "action_server_peer.py"), str(self.version), ACTION, *kind]
        server = Client(
            self.ros, [str(roscpp_peer("action_server", "actionlib")), ACTION] if kind == ("cpp",) else command
        )
        try:
            assert server.line() == "ready\n"
            yield server
        finally:
            server.end()

    @contextmanager
    def recording(self, bag: Path, counts: Mapping[str, int]) -> Iterator[None]:
        """Record the action, the orders and what the hardware tells with ROS 1's own recorder.

        It ends when it has received so many messages of these topics and has nothing left to do: what is still on its
        way, or in the queue of its callbacks, would be lost.
        """
        topics = ["/order", "/told", *(f"{ACTION}/{end}" for end in ("goal", "cancel", "feedback", "result"))]
        command = ["rosbag", "record", "--tcpnodelay", "-O", str(bag), *topics, "__name:=recorder"]
        with NodeProcess(self.folder / "recorder.log", command, self.ros.environment) as recorder:
            while not all(map(self._is_recorded, topics)):
                assert recorder.process.poll() is None, recorder.said()
                time.sleep(0.02)
            yield
            (node,) = self._nodes("/recorder")
            number = node.getPid("/test")[2]
            while any(_received(node)[topic] < count for topic, count in counts.items()) or not _is_asleep(number):
                time.sleep(0.02)
            # Its script does not take a signal that it has inherited as ignored.
            node.shutdown("/test", "the test has ended")
            assert recorder.wait() == 0, recorder.said()

    def _is_recorded(self, topic: str) -> bool:
        """Whether each publisher of a topic sends to the recorder."""
        publishers = dict(self._master.getSystemState("/test")[2][0]).get(topic, [])
        alive = [links for node in self._nodes(*publishers) if (links := _links_of(node)) is not None]
        found = [link for link in chain(*alive) if [*link[1:3], link[4]] == ["/recorder", "o", topic]]
        return len(found) == len(alive) > 0

    @property
    def _master(self) -> Any:
        return xmlrpc.client.ServerProxy(self.ros.environment["ROS_MASTER_URI"])

    def _nodes(self, *names: str) -> list[Any]:
        return [xmlrpc.client.ServerProxy(self._master.lookupNode("/test", name)[2]) for name in names]


def _received(node: Any) -> Counter[str]:
    """The numbers of messages that a node of roscpp has received; it answers without the usual status and text."""
    _, subscriptions = node.getBusStats("/test")
    return Counter({topic: sum(link[2] for link in links) for topic, links in subscriptions})


def _is_asleep(number: int) -> bool:
    """Whether no thread of a process runs, or would."""
    tasks = Path(f"/proc/{number}/task").iterdir()
    return {task.joinpath("stat").read_text().rpartition(")")[2].split()[0] for task in tasks} == {"S"}


def _links_of(node: Any) -> list[Any] | None:
    """The connections of a node; None if it was killed, which its master does not notice."""
    try:
        return list(node.getBusInfo("/test")[2])
    except ConnectionRefusedError:
        return None


@dataclass
class Orders:
    """The orders to the hardware, and what it tells."""

    version: int
    peer: Peer

    def send(self, *orders: int) -> None:
        head = b"" if self.version == 1 else b"\0\1\0\0"
        for order in orders:
            self.peer.publish("/order", head + order.to_bytes(4, "little"))

    def told(self) -> Told:
        """The next thing that the hardware tells: an order, a kind, a number."""
        _, payload = self.peer.take()
        value = int.from_bytes(payload[-8:], "little")
        return value >> 40, value >> 32 & 0xFF, value & 0xFFFFFFFF

    def until_result(self) -> tuple[list[Told], Told]:
        """What the hardware tells until the next result: feedback and the result."""
        feedback: list[Told] = []
        while (told := self.told())[1] == FEEDBACK:
            feedback.append(told)
        return feedback, told

    def wrong(self, orders: Sequence[int]) -> list[object]:
        """What the hardware tells otherwise than expected; ROS may deliver feedback after the result."""
        wrong: list[object] = []
        for order in orders:
            feedback, result = self.until_result()
            is_held = order & HELD == HELD
            expected = [(order, FEEDBACK, order + step) for step in range(1, (1 if is_held else order % 4) + 1)]
            has_come = expected[: len(feedback)] == feedback and (not is_held or feedback)
            state = (CANCELED if is_held else SUCCEEDED)[self.version]
            if not has_come or result != (order, state, order):
                wrong.append((order, feedback, result))
        return wrong


@pytest.fixture(scope="module", params=versions("action_clients"))
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Planner]:
    with running(request, tmp_path_factory) as (ros, folder):
        skip_without_actions(ros)
        yield Planner(ros, folder)


def check_counts(node: NodeProcess, **counts: int) -> None:
    """Stop the node; it has counted each goal."""
    assert node.stop() == 0, node.said()
    names = ("goals", "succeeded", "canceled", "aborted", "rejected")
    lost = counts.get("lost", 0)
    values = [sum(counts.values()), *(counts.get(name, 0) for name in names[1:])]
    python = r"^count +{} +{} +{} +{} +{}$".format(*values)
    cpp = "^count: {} goals, {} succeeded, {} canceled, {} aborted, {} rejected, 0 unasked, {} lost".format(
        *values, lost
    )
    assert re.search(f"{python}|{cpp}", node.said(), re.MULTILINE), node.said()
    if lost:
        assert re.search(f"{cpp}|^lost goals: {lost}$", node.said(), re.MULTILINE), node.said()


@pytest.mark.parametrize("language", ["python", "cpp"])
@pytest.mark.parametrize("kind", ["full", "simple", "cpp"])
def test_goals_of_hardware_get_feedback_and_results(place: Planner, kind: str, language: str) -> None:
    """The whole way; some goals are canceled. The first one is sent before its server is there."""
    if place.version == 2 and kind != "full":
        pytest.skip("rclpy has one kind of server, and rclcpp is not among the wheels")
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    source = random.Random(seed)
    orders = [source.randrange(1 << 20) for _ in range(18)]
    orders += [HELD, HELD + 1]
    source.shuffle(orders)
    with place.node(language) as (node, hardware):
        hardware.send(3)
        with place.server(*([] if kind == "full" else ["cpp" if kind == "cpp" else "--simple"])):
            # A server may send the first feedback before it knows of the node.
            first = 1
            while not hardware.until_result()[0]:
                hardware.send(3)
                first += 1
            hardware.send(*orders)
            assert hardware.wrong(orders) == []
            canceled = sum(order & HELD == HELD for order in orders)
            check_counts(node, succeeded=first + len(orders) - canceled, canceled=canceled)


@pytest.mark.parametrize("language", ["python", "cpp"])
def test_a_server_rejects_and_aborts(place: Planner, language: str) -> None:
    rejected, aborted = Kind.REJECTED << 20, Kind.ABORTED << 20
    with (
        place.server(),
        place.node(language) as (node, hardware),
        diagnoses(place.ros, "planner: node") as reports,
    ):
        hardware.send(rejected, aborted, 5)
        version = place.version
        assert hardware.until_result() == ([], (rejected, REJECTED[version], 0))
        assert hardware.until_result()[1] == (aborted, ABORTED[version], 7)
        assert hardware.wrong([5]) == []
        counts = {"rejected": 1, "aborted": 1, "succeeded": 1}
        published = {f"count {name}": count for name, count in {**counts, "goals": 3, "lost": 0}.items()}
        assert next(report for report in reports if published.items() <= report.items())
        check_counts(node, **counts)


@pytest.mark.parametrize("language", ["python", "cpp"])
def test_a_goal_without_a_server_is_lost_in_time(place: Planner, language: str) -> None:
    """A later one reaches the server that has come since."""
    with place.node(language, "2 s") as (node, hardware):
        hardware.send(6)
        assert hardware.until_result() == ([], (6, LOST[place.version], 0))
        reason = "no server has told of it" if place.version == 1 else "there is no server of"
        assert re.search(f"a goal of .*count'? is lost: no answer within 2.*: {reason}", node.said())
        hardware.send(7)
        with place.server():
            # A busy machine may need longer than the time limit; then the goal is lost, too.
            found = hardware.until_result()[1]
            while found[1] == LOST[place.version]:
                hardware.send(7)
                found = hardware.until_result()[1]
            assert found == (7, SUCCEEDED[place.version], 7)
        assert node.stop() == 0, node.said()


@pytest.mark.parametrize("language", ["python", "cpp"])
def test_a_goal_whose_server_dies_is_lost(place: Planner, language: str) -> None:
    deadly = Kind.DEADLY << 20
    with place.node(language, "15 s") as (node, hardware):
        with place.server() as server:
            hardware.send(deadly)
            feedback, result = hardware.until_result()
            assert feedback == [(deadly, FEEDBACK, deadly + 1)]
            assert result == (deadly, LOST[place.version], 0)
            server.process.wait()
        assert "is lost: no answer within 15" in node.said()
        assert node.stop() == 0, node.said()


@pytest.mark.parametrize("language", ["python", "cpp"])
def test_a_node_that_ends_cancels_its_goal(place: Planner, language: str) -> None:
    """The hardware itself does not cancel it."""
    order = Kind.WAITING << 20
    with place.server() as server, place.node(language) as (node, hardware):
        hardware.send(order)
        assert hardware.told() == (order, FEEDBACK, order + 1)
        assert node.stop() == 0, node.said()
        assert json.loads(server.line()) == [order, "CANCELED"]


@pytest.mark.parametrize("language", ["python", "cpp"])
def test_goals_that_are_accepted_late_are_canceled(place: Planner, language: str) -> None:
    """Each of them, although others have followed."""
    if place.version == 1:
        pytest.skip("actionlib cancels goals before they are accepted")
    orders = [(Kind.LATE << 20) + number for number in range(2)]
    with place.server() as server, place.node(language, "1 s") as (node, hardware):
        # The server has to be found before.
        found = None
        while found != (4, SUCCEEDED[2], 4):
            hardware.send(4)
            found = hardware.until_result()[1]
        hardware.send(*orders)
        assert [hardware.until_result() for _ in orders] == [([], (order, LOST[2], 0)) for order in orders]
        ended: set[tuple[int, str]] = set()
        while not ended >= {(order, "CANCELED") for order in orders}:
            ended.add(tuple(json.loads(server.line())))
        assert node.stop() == 0, node.said()


def test_recorded_goals_are_replayed(place: Planner, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The hardware sends the goals and cancellations again, and gets the results of the server."""
    if place.version == 2:
        pytest.skip("rclpy cannot record the calls of an action")
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    source = random.Random(seed)
    orders = [*(source.randrange(1 << 20) & ~0x10 for _ in range(8)), HELD, Kind.REJECTED << 20, HELD + 1]
    bag, target = tmp_path / "in.bag", tmp_path / "out.bag"
    with place.server(), place.node("python") as (node, hardware):
        ends = {f"{ACTION}/{end}": len(orders) for end in ("goal", "result")}
        with place.recording(bag, {"/order": len(orders), "/told": len(orders), f"{ACTION}/cancel": 2, **ends}):
            hardware.send(*orders)
            results = [hardware.until_result()[1] for _ in orders]
        assert node.stop() == 0, node.said()
    capsys.readouterr()
    arguments = ["replay", str(place.specification()), "--in", str(bag), "--out", str(target), "--json"]
    assert main([*arguments, "--build-root", str(place.folder / "simulators")]) == 0
    said = json.loads(capsys.readouterr().out)
    names = ("as_recorded", "different", "missing", "not_recorded")
    rows = {kind: row for kind in ("goals", "cancellations") for row in said[kind]}
    counts = {kind: [row[name] for name in names if name in row] for kind, row in rows.items()}
    assert counts == {"goals": [len(orders), 0, 0, 0], "cancellations": [2, 0, 0]}
    assert said["warnings"] == []
    # ROS may deliver feedback after the result of its goal.
    assert [told for told in what_is_told(target) if told[1] != FEEDBACK] == results
