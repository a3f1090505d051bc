"""Goals of actions: what the hardware sees, and what clients learn, in both versions of ROS."""

from __future__ import annotations

import random
import re
import struct
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.frame.codec import decode, encode, pack_frame
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.node.actions.action_server import MOST_KEPT
from fusesoc_firm.node.engine.calls import CallLine
from fusesoc_firm.node.engine.carrier import Call
from fusesoc_firm.node.interface.action_types import (
    CANCEL,
    CANCEL_GOAL,
    FEEDBACK,
    GET_RESULT,
    GOAL,
    RESULT,
    SEND_GOAL,
    STATES,
)
from fusesoc_firm.node.interface.description import NodeDescription, describe
from fusesoc_firm.node.node import HardwareListener, NodeSettings
from fusesoc_firm.node.package.python_node import python_node
from fusesoc_firm.node.transport.transport import Burst
from fusesoc_firm.system.system_core import LoadedSystem, load_system
from tests.node.fake_node import FakeHardware, Run, until
from tests.ros.action_simulator import HELD, HERE, NUMBERS, feedback_of, in_ros2, number_of, result_of

LIBRARIES = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
SUCCEEDED, CANCELED, ABORTED, REJECTED = range(4)
# A goal about which the hardware of these tests says nothing.
SILENT = HELD << 8
IDS = {1: b"goal-%d", 2: b"%016d"}


def system(folder: Path, version: int) -> LoadedSystem:
    text = (HERE / "arm/arm.yaml").read_text(encoding="utf-8")
    if version == 2:
        text = in_ros2(text)
    spec = folder / "arm.yaml"
    spec.write_text(text.replace("paths: msg", f"paths: {HERE / 'arm/msg'}"), encoding="utf-8")
    return load_system(spec, LIBRARIES, needs_sources=False)


def frame(version: int, name: str) -> Frame:
    library = MessageLibrary(middleware_of(version), [HERE / "arm/msg"])
    return frame_of(parse_name(name), library.closure(parse_name(name)))


class Counter:
    """Hardware with the action of tests/ros/arm. A goal that is held ends with its cancellation."""

    def __init__(self, version: int) -> None:
        self.version = version
        self.held: int | None = None
        self.hardware: FakeHardware | None = None

    def open(self, listener: HardwareListener) -> FakeHardware:
        self.hardware = FakeHardware(self.answers, listener)
        return self.hardware

    def answers(self, subscriber: int, payload: bytes) -> list[Burst]:
        if subscriber == 1:
            held, self.held = self.held, None
            return [] if held is None else [self.result(held, CANCELED)]
        goal = number_of(self.version, payload)
        if goal == SILENT:
            return []
        feedback = Burst(pack_frame(0, feedback_of(self.version, goal + 1)))
        if goal & HELD == HELD:
            self.held = goal
            return [feedback]
        return [feedback, self.result(goal, SUCCEEDED)]

    def result(self, goal: int, state: int) -> Burst:
        return Burst(pack_frame(1, result_of(self.version, state, goal)))


class Peer:
    """A client of the node's action, by the fake carrier."""

    def __init__(self, folder: Path, version: int, settings: NodeSettings | None = None, **changes: Any) -> None:
        self.version = version
        self.counter = Counter(version)
        found: NodeDescription = describe(system(folder, version))
        (action,) = found.actions
        self.description = replace(found, actions=(replace(action, **changes),))
        self.run = Run(self.description, self.counter.open, settings)
        self.count = 0
        # The node tells the states before it takes goals.
        until(lambda: self.run.carrier.published)

    def id(self, goal: int) -> bytes:
        return IDS[self.version] % goal

    def send(self, goal: int) -> None:
        if self.version == 1:
            message = {
                "header": {"seq": 1, "stamp": {"sec": 2, "nsec": 3}, "frame_id": "here"},
                "goal_id": {"stamp": {"sec": 5, "nsec": 6}, "id": self.id(goal).decode()},
                "goal": {"goal": goal},
            }
            self.run.carrier.give(GOAL, encode(frame(1, "actionlib/TestActionGoal"), message))
            return
        message = {"goal_id": {"uuid": list(self.id(goal))}, "goal": {"order": goal}}
        self.ask(SEND_GOAL, encode(frame(2, "test_msgs/Fibonacci_SendGoal_Request"), message))

    def cancel(self, goal: int | None) -> None:
        """Cancel a goal, or all."""
        name = b"" if goal is None else self.id(goal)
        if self.version == 1:
            self.run.carrier.give(CANCEL, struct.pack("<III", 0, 0, len(name)) + name)
        else:
            self.ask(CANCEL_GOAL, b"\0\1\0\0" + (name or bytes(16)) + bytes(8))

    def ask(self, service: int, payload: bytes) -> int:
        self.count += 1
        self.run.carrier.ask(service, Call(self.count, payload))
        return self.count

    def answer(self, number: int) -> bytes:
        """The answer to a call."""
        answers = self.run.carrier.answers
        until(lambda: any(item[1] == number for item in answers))
        (found,) = (item[2].payload for item in answers if item[1] == number)
        assert found is not None
        return found

    def result(self, goal: int) -> tuple[int, int | None]:
        """The number of a goal's state, and its result, which ROS 1 publishes and ROS 2 keeps."""
        if self.version == 2:
            found = self.answer(self.ask(GET_RESULT, b"\0\1\0\0" + self.id(goal)))
            message = decode(frame(2, "test_msgs/Fibonacci_GetResult_Response"), found)
            return message["status"], next(iter(message["result"]["sequence"]), None)
        until(lambda: self._results(goal))
        (message,) = self._results(goal)
        return message["status"]["status"], message["result"]["result"]

    def _results(self, goal: int) -> list[dict[str, Any]]:
        found = [decode(frame(1, "actionlib/TestActionResult"), item) for item in self.published(RESULT)]
        return [item for item in found if item["status"]["goal_id"]["id"] == self.id(goal).decode()]

    def published(self, topic: int) -> list[bytes]:
        return [payload for number, payload in [*self.run.carrier.published] if number == topic]

    def handed(self) -> list[int]:
        """The goals that the hardware has got."""
        assert self.counter.hardware
        return [number_of(self.version, payload) for item, payload in [*self.counter.hardware.sent] if item == 0]

    def number(self, state: int) -> int:
        return NUMBERS[self.version][state]


Make = Callable[..., Peer]


@pytest.fixture(params=[1, 2])
def peer(request: pytest.FixtureRequest, tmp_path: Path) -> Make:
    return lambda *arguments, **changes: Peer(tmp_path, request.param, *arguments, **changes)


def test_a_goal_gets_feedback_and_a_result_of_its_own(peer: Make) -> None:
    client = peer()
    for goal in (5, 8, 3):
        client.send(goal)
    assert [client.result(goal) for goal in (5, 8, 3)] == [(client.number(SUCCEEDED), goal) for goal in (5, 8, 3)]
    client.run.stop()
    if client.version == 1:
        found = [decode(frame(1, "actionlib/TestActionFeedback"), item) for item in client.published(FEEDBACK)]
        told = [(item["status"]["goal_id"]["id"].encode(), item["feedback"]["feedback"]) for item in found]
        assert {item["status"]["status"] for item in found} == {1}
    else:
        found = [decode(frame(2, "test_msgs/Fibonacci_FeedbackMessage"), item) for item in client.published(FEEDBACK)]
        told = [(bytes(item["goal_id"]["uuid"]), *item["feedback"]["sequence"]) for item in found]
        accepted = [answer.payload for service, _, answer in client.run.carrier.answers if service == SEND_GOAL]
        assert [payload and payload[4] for payload in accepted] == [1, 1, 1]
    assert told == [(client.id(goal), goal + 1) for goal in (5, 8, 3)]
    assert client.run.is_complete
    assert re.search("^count +3 +3 +0 +0 +0$", client.run.node.statistics.text(), re.MULTILINE)


def states(version: int, payload: bytes) -> list[tuple[bytes, int]]:
    name = "actionlib_msgs/GoalStatusArray" if version == 1 else "action_msgs/GoalStatusArray"
    listed = decode(frame(version, name), payload)["status_list"]
    if version == 1:
        return [(item["goal_id"]["id"].encode(), item["status"]) for item in listed]
    return [(bytes(item["goal_info"]["goal_id"]["uuid"]), item["status"]) for item in listed]


def test_the_states_of_goals_are_told(peer: Make) -> None:
    """Those of several goals in one message, of which the last ones wait."""
    client = peer(accept_limit=0.05)
    client.send(HELD)
    client.send(1)
    client.send(2)
    waiting, executing = {1: (0, 1), 2: (1, 2)}[client.version]
    expected = [(client.id(HELD), executing), (client.id(1), waiting), (client.id(2), waiting)]
    until(lambda: states(client.version, client.published(STATES)[-1]) == expected)
    client.cancel(HELD)
    ends = [client.number(state) for state in (CANCELED, SUCCEEDED, SUCCEEDED)]
    expected = [(client.id(goal), end) for goal, end in zip((HELD, 1, 2), ends, strict=True)]
    until(lambda: states(client.version, client.published(STATES)[-1]) == expected)
    client.run.stop()


def test_a_goal_that_is_canceled_while_it_waits_stays_away(peer: Make) -> None:
    client = peer(accept_limit=0.05)
    for goal in (HELD, 1, 2):
        client.send(goal)
    until(lambda: len(states(client.version, client.published(STATES)[-1])) == 3)
    client.cancel(1)
    # RECALLED, of actionlib
    assert client.result(1) == ((8, 0) if client.version == 1 else (client.number(CANCELED), None))
    client.cancel(HELD)
    assert client.result(2) == (client.number(SUCCEEDED), 2)
    client.run.stop()
    assert client.handed() == [HELD, 2]


def test_all_goals_are_canceled(peer: Make) -> None:
    client = peer(accept_limit=0.05)
    for goal in (HELD, 1, HELD + 1):
        client.send(goal)
    until(lambda: len(states(client.version, client.published(STATES)[-1])) == 3)
    client.cancel(None)
    assert client.result(HELD) == (client.number(CANCELED), HELD)
    client.run.stop()
    assert client.handed() == [HELD]
    assert client.run.node.statistics.actions["count"].canceled == 3


def test_a_cancellation_of_actionlib_may_come_before_its_goal(tmp_path: Path) -> None:
    client = Peer(tmp_path, 1)
    client.cancel(4)
    client.send(4)
    assert client.result(4) == (8, 0)
    client.send(5)
    assert client.result(5) == (3, 5)
    client.run.stop()
    assert client.handed() == [5]


def test_actionlib_learns_of_a_goal_before_its_feedback(tmp_path: Path) -> None:
    """A client gives up a goal that it cancels at its first feedback, if it does not know it yet."""
    client = Peer(tmp_path, 1)
    for goal in range(20):
        client.send(goal)
    client.result(19)
    client.run.stop()
    known: set[bytes] = set()
    for topic, payload in client.run.carrier.published:
        if topic == STATES:
            known |= {name for name, state in states(1, payload) if state}
        elif topic == FEEDBACK:
            message = decode(frame(1, "actionlib/TestActionFeedback"), payload)
            assert message["status"]["goal_id"]["id"].encode() in known
    assert len(client.published(FEEDBACK)) == 20


def test_a_cancellation_extends_the_time_limit(peer: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """Feedback extends it, too; the cancellation of a goal that waits concerns nothing in the hardware."""
    extended = []

    def extend(line: CallLine) -> None:
        extended.append(line)

    monkeypatch.setattr(CallLine, "extend", extend)
    client = peer(accept_limit=0.05)
    client.send(HELD)
    client.send(1)
    until(lambda: client.published(FEEDBACK) and len(states(client.version, client.published(STATES)[-1])) == 2)
    client.cancel(1)
    client.result(1)
    assert len(extended) == 1
    client.cancel(HELD)
    assert client.result(HELD) == (client.number(CANCELED), HELD)
    assert len(extended) == 2
    client.run.stop()


def test_cancellations_of_ros2_have_return_codes(tmp_path: Path) -> None:
    """No error, an unknown goal, and one that has ended (action_msgs/CancelGoal)."""
    client = Peer(tmp_path, 2)
    client.send(3)
    client.result(3)
    codes = []
    for goal in (3, 77):
        client.cancel(goal)
        codes.append(client.answer(client.count)[4])
    client.send(HELD)
    until(lambda: client.counter.held is not None and len(client.published(FEEDBACK)) == 2)
    client.cancel(HELD)
    found = client.answer(client.count)
    assert [*codes, found[4]] == [3, 2, 0]
    assert found[8:12] == b"\1\0\0\0"
    assert found[12:28] == client.id(HELD)
    client.run.stop()


def test_results_are_kept_for_late_clients_with_a_bound(tmp_path: Path) -> None:
    client = Peer(tmp_path, 2)
    goals = [16 * number + 1 for number in range(MOST_KEPT + 3) if 16 * number & HELD != HELD]
    goals += [(1 << 20) + 1 + number for number in range(MOST_KEPT + 3 - len(goals))]
    for goal in goals:
        client.send(goal)
    assert client.result(goals[-1]) == (4, goals[-1])
    assert [client.result(goal) for goal in goals[:3]] == [(0, None)] * 3
    assert client.result(goals[3]) == (4, goals[3])
    client.run.stop()


def test_a_known_id_is_refused(peer: Make) -> None:
    client = peer()
    client.send(HELD)
    client.send(HELD)
    until(lambda: client.published(FEEDBACK))
    if client.version == 2:
        assert client.answer(2)[4] == 0
    client.cancel(HELD)
    assert client.result(HELD) == (client.number(CANCELED), HELD)
    client.run.stop()
    assert client.handed() == [HELD]


def test_a_silent_goal_is_accepted_then_aborted(peer: Make) -> None:
    client = peer(accept_limit=0.02, time_limit=0.5)
    client.send(SILENT)
    if client.version == 2:
        assert client.answer(1)[4] == 1
    assert client.result(SILENT) == ((4, 0) if client.version == 1 else (6, None))
    client.send(1)
    assert client.result(1) == (client.number(SUCCEEDED), 1)
    client.run.stop()
    assert "a goal of 'count' is aborted: no answer within 0.5 s" in client.run.reports
    assert client.counter.hardware
    # The hardware was asked to give up.
    assert [item for item, _ in client.counter.hardware.sent] == [0, 1, 0]


def test_a_goal_in_hardware_that_is_restarted_is_aborted(peer: Make) -> None:
    client = peer(NodeSettings(restarts=True))
    client.send(HELD)
    until(lambda: client.published(FEEDBACK))
    assert client.counter.hardware
    client.counter.hardware.close()
    assert client.result(HELD) == ((4, 0) if client.version == 1 else (6, None))
    client.run.stop()
    assert "a goal of 'count' is aborted: the hardware was restarted" in client.run.reports


def test_goals_fail_when_the_node_ends(peer: Make) -> None:
    client = peer(NodeSettings(drain=0.2))
    client.send(HELD)
    client.send(1)
    until(lambda: client.published(FEEDBACK))
    client.run.stop()
    counts = client.run.node.statistics.actions["count"]
    assert (counts.goals, counts.aborted, counts.rejected) == (2, 1, 1)


def test_feedback_and_results_for_no_goal_are_counted(peer: Make) -> None:
    client = peer()
    hardware = client.counter.hardware
    assert hardware
    hardware._bursts.put(Burst(pack_frame(0, feedback_of(client.version, 1))))
    hardware._bursts.put(client.counter.result(1, SUCCEEDED))
    until(lambda: client.run.node.statistics.actions["count"].unasked == 2)
    client.run.stop()
    assert "feedback and results for no goal: 2" in client.run.node.statistics.text()


def test_broken_messages_harm_nobody(peer: Make) -> None:
    """Beginnings of goals and cancellations, and random bytes; goals between them are reached."""
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    source = random.Random(seed)
    client = peer()
    goal = b"\0" * 12 + b"\4\0\0\0here" + bytes(8) + b"\3\0\0\0one\7\0\0\0"
    for number in range(100):
        broken = source.choice([goal[: source.randrange(20)], source.randbytes(source.randrange(16))])
        ends = (GOAL, CANCEL) if client.version == 1 else (SEND_GOAL, CANCEL_GOAL, GET_RESULT)
        if client.version == 1:
            client.run.carrier.give(source.choice(ends), broken)
        else:
            client.ask(source.choice(ends), broken)
        if number % 10 == 0:
            client.send(number * 16 + 1 if number * 16 & HELD != HELD else 1)
            client.result(number * 16 + 1 if number * 16 & HELD != HELD else 1)
    client.run.stop()
    assert client.run.error is None


@pytest.mark.parametrize("version", [1, 2])
def test_the_generated_file_has_the_actions(tmp_path: Path, version: int) -> None:
    loaded = system(tmp_path, version)
    source = python_node(loaded, middleware_of(version), tmp_path / "arm.yaml", tmp_path)["arm_node.py"]
    names: dict[str, object] = {"__name__": "generated"}
    exec(compile(source, "arm_node.py", "exec"), names)
    assert names["NODE"] == describe(loaded)


@pytest.mark.check
def test_feedback_extends_the_time_limit(peer: Make) -> None:
    """A goal takes longer than the limit, but the hardware is never silent for so long."""
    client = peer(time_limit=2.0)
    client.send(HELD)
    hardware = client.counter.hardware
    assert hardware
    begin = time.monotonic()
    while time.monotonic() - begin < 3:
        until(lambda: client.published(FEEDBACK))
        hardware._bursts.put(Burst(pack_frame(0, feedback_of(client.version, HELD + 1))))
        time.sleep(0.1)
    client.cancel(HELD)
    assert client.result(HELD) == (client.number(CANCELED), HELD)
    client.run.stop()
