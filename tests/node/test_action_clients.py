"""Goals of hardware for servers of actions: what servers see, and what the hardware learns, in both versions of ROS."""

from __future__ import annotations

import random
import re
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.frame.codec import decode, encode, pack_frame
from fusesoc_firm.frame.defaults import completed
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.node.engine.calls import MOST_WAITING, CallLine
from fusesoc_firm.node.engine.carrier import Answer, Call
from fusesoc_firm.node.engine.queues import Overflow
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
from fusesoc_firm.node.interface.description import describe
from fusesoc_firm.node.node import HardwareListener, NodeSettings
from fusesoc_firm.node.package.python_node import python_node
from fusesoc_firm.node.transport.transport import Burst
from fusesoc_firm.system.system_core import LoadedSystem, load_system
from tests.node.fake_node import FakeHardware, Run, until
from tests.node.test_actions import LIBRARIES, frame
from tests.ros.action_simulator import HERE, in_ros2

# The states of goals in results, by the version of ROS: succeeded, canceled, aborted, rejected, lost.
SUCCEEDED, CANCELED, ABORTED, REJECTED, LOST = {1: 3, 2: 4}, {1: 2, 2: 5}, {1: 4, 2: 6}, {1: 5, 2: 0}, {1: 9, 2: 0}
# A goal that has not been sent to its server (actionlib).
RECALLED = {1: 8, 2: 5}
IDS: dict[int, bytes] = {1: b"mine", 2: b"0123456789abcdef"}
NAMES = {
    1: ("actionlib/TestActionGoal", "actionlib/TestActionFeedback", "actionlib/TestActionResult"),
    2: tuple(f"test_msgs/Fibonacci_{end}" for end in ("SendGoal_Request", "FeedbackMessage", "GetResult_Response")),
}


def system(folder: Path, version: int) -> LoadedSystem:
    text = (HERE / "planner/planner.yaml").read_text(encoding="utf-8")
    text = in_ros2(text) if version == 2 else text
    spec = folder / "planner.yaml"
    spec.write_text(text.replace("paths: ../arm/msg", f"paths: {HERE / 'arm/msg'}"), encoding="utf-8")
    return load_system(spec, LIBRARIES, needs_sources=False)


def filled(form: Frame, message: dict[str, Any]) -> bytes:
    """A message with some fields; the others are zero or empty."""
    return encode(form, completed(form, message))


class Asker:
    """Hardware that sends what a test tells it to, and keeps what it receives."""

    def __init__(self) -> None:
        self.hardware: FakeHardware | None = None

    def open(self, listener: HardwareListener) -> FakeHardware:
        self.hardware = FakeHardware(lambda _, __: [], listener)
        return self.hardware

    def send(self, publisher: int, payload: bytes) -> None:
        assert self.hardware
        self.hardware._bursts.put(Burst(pack_frame(publisher, payload)))


class Peer:
    """The server of the hardware's action, by the fake carrier."""

    def __init__(self, folder: Path, version: int, settings: NodeSettings | None = None, **changes: Any) -> None:
        self.version = version
        self.asker = Asker()
        found = describe(system(folder, version))
        (action,) = found.actions
        self.description = replace(found, actions=(replace(action, **changes),))
        self.run = Run(self.description, self.asker.open, settings)
        self.goal_frame, self.feedback_frame, self.result_frame = (frame(version, name) for name in NAMES[version])
        self.first_topic = len(found.subscribers)
        self.first_published = len(found.publishers)

    # --- the hardware ---

    def order(self, goal: int, identity: bytes = b"") -> None:
        """Let the hardware send a goal; its server is there."""
        if self.version == 1:
            self.tell_states()
        message: dict[str, Any] = {"goal": {"goal" if self.version == 1 else "order": goal}}
        if identity:
            message["goal_id"] = {"id": identity.decode()} if self.version == 1 else {"uuid": list(identity)}
        self.asker.send(0, filled(self.goal_frame, message))

    def order_cancel(self, identity: bytes = b"") -> None:
        if self.version == 1:
            self.asker.send(1, struct.pack("<III", 0, 0, len(identity)) + identity)
        else:
            self.asker.send(1, b"\0\1\0\0" + (identity or bytes(16)) + bytes(8))

    def received(self) -> list[tuple[int, bytes]]:
        """What the hardware has received: feedback has the id 1, results have 2."""
        assert self.asker.hardware
        return [*self.asker.hardware.sent]

    def results(self) -> list[tuple[int, int | None]]:
        """The states and numbers of the results that the hardware has received."""
        found = [decode(self.result_frame, payload) for item, payload in self.received() if item == 2]
        if self.version == 1:
            return [(item["status"]["status"], item["result"]["result"]) for item in found]
        return [(item["status"], next(iter(item["result"]["sequence"]), None)) for item in found]

    # --- the server ---

    def goals(self) -> list[dict[str, Any]]:
        """The goals that the server has received, each once."""
        if self.version == 1:
            items = [
                payload for topic, payload in [*self.run.carrier.published] if topic == self.first_published + GOAL
            ]
        else:
            items = [call.payload for service, call in [*self.run.carrier.calls] if service == SEND_GOAL]
        return [decode(self.goal_frame, item) for item in dict.fromkeys(items)]

    def goal(self, number: int = 0) -> bytes:
        """The id of a goal that the server has received."""
        until(lambda: len(self.goals()) > number)
        identity = self.goals()[number]["goal_id"]
        return identity["id"].encode() if self.version == 1 else bytes(identity["uuid"])

    def call(self, service: int, number: int = 0) -> Call:
        """A call of the node."""
        until(lambda: len([item for item in self.run.carrier.calls if item[0] == service]) > number)
        return [call for item, call in self.run.carrier.calls if item == service][number]

    def accept(self, number: int = 0, *, is_accepted: bool = True) -> bytes:
        """Accept a goal; return its id."""
        identity = self.goal(number)
        if self.version == 1:
            self.tell_states(identity)
        else:
            self.run.carrier.reply(
                SEND_GOAL, self.call(SEND_GOAL, number).number, Answer(b"\0\1\0\0%c\0\0\0" % is_accepted + bytes(8))
            )
        return identity

    def tell_states(self, *identities: bytes) -> None:
        if self.version == 1:
            states = [struct.pack("<III", 1, 2, len(item)) + item + b"\1" + bytes(4) for item in identities]
            payload = bytes(16) + struct.pack("<I", len(states)) + b"".join(states)
        else:
            items = [{"goal_info": {"goal_id": {"uuid": [*item]}}, "status": 2} for item in identities]
            payload = filled(frame(2, "action_msgs/GoalStatusArray"), {"status_list": items})
        self.run.carrier.give(self.first_topic + STATES, payload)

    def feed(self, identity: bytes, number: int) -> None:
        self.run.carrier.give(
            self.first_topic + FEEDBACK, self._told(self.feedback_frame, identity, {"feedback": number})
        )

    def _told(self, form: Frame, identity: bytes, fields: dict[str, int], state: int = 1) -> bytes:
        ((name, number),) = fields.items()
        if self.version == 1:
            status = {"goal_id": {"stamp": {"sec": 9}, "id": identity.decode()}, "status": state, "text": "why"}
            return filled(form, {"header": {"seq": 4}, "status": status, name: {name: number}})
        return filled(form, {"goal_id": {"uuid": list(identity)}, name: {"sequence": [number]}})

    def finish(self, identity: bytes, state: int, number: int, goal: int = 0) -> None:
        """Send the result of a goal."""
        if self.version == 1:
            self.run.carrier.give(
                self.first_topic + RESULT, self._told(self.result_frame, identity, {"result": number}, state)
            )
        else:
            payload = filled(self.result_frame, {"status": state, "result": {"sequence": [number]}})
            call = self.call(GET_RESULT, goal)
            assert call.payload == b"\0\1\0\0" + identity
            self.run.carrier.reply(GET_RESULT, call.number, Answer(payload))

    def canceled(self) -> list[bytes]:
        """The cancellations that the server has received."""
        if self.version == 1:
            return [item for topic, item in [*self.run.carrier.published] if topic == self.first_published + CANCEL]
        return [call.payload for service, call in [*self.run.carrier.calls] if service == CANCEL_GOAL]

    def cancellation(self, identity: bytes) -> bytes:
        """The cancellation of one goal: without a time, which would mean the goals of others, too."""
        if self.version == 1:
            return struct.pack("<III", 0, 0, len(identity)) + identity
        return b"\0\1\0\0" + identity + bytes(8)


Make = Callable[..., Peer]


@pytest.fixture(params=[1, 2])
def peer(request: pytest.FixtureRequest, tmp_path: Path) -> Make:
    return lambda *arguments, **changes: Peer(tmp_path, request.param, *arguments, **changes)


def test_goals_are_sent_one_after_another(peer: Make) -> None:
    """The server receives ids of the node, the hardware its own; what concerns other clients is ignored."""
    server = peer()
    own = IDS[server.version]
    server.order(5, own)
    server.order(6)
    identity = server.accept()
    assert identity != own
    server.feed(b"x" * 16, 99)
    server.tell_states(b"y" * 16)
    server.feed(identity, 7)
    if server.version == 1:
        server.finish(b"x" * 16, 3, 98)
    assert len(server.goals()) == 1
    server.finish(identity, SUCCEEDED[server.version], 5)
    second = server.accept(1)
    assert second != identity
    server.feed(identity, 97)
    server.finish(second, ABORTED[server.version], 8, 1)
    until(lambda: len(server.results()) == 2)
    server.run.stop()
    assert server.results() == [(SUCCEEDED[server.version], 5), (ABORTED[server.version], 8)]
    (feedback,) = [decode(server.feedback_frame, item) for number, item in server.received() if number == 1]
    if server.version == 1:
        assert (feedback["status"]["goal_id"]["id"], feedback["feedback"]["feedback"]) == (own.decode(), 7)
        first, _ = (decode(server.result_frame, item) for number, item in server.received() if number == 2)
        assert (first["header"]["seq"], first["status"]["goal_id"]["id"], first["status"]["text"]) == (4, "mine", "why")
    else:
        assert (bytes(feedback["goal_id"]["uuid"]), feedback["feedback"]["sequence"]) == (own, [7])
    assert [item["goal"] for item in server.goals()] == [
        {"goal" if server.version == 1 else "order": n} for n in (5, 6)
    ]
    assert server.canceled() == []
    assert re.search("^count +2 +1 +0 +1 +0$", server.run.node.statistics.text(), re.MULTILINE)


def test_a_result_does_not_overtake_feedback(tmp_path: Path) -> None:
    """The hardware takes nothing for a while, so feedback and the result wait in the node."""
    server = Peer(tmp_path, 1)
    server.order(5)
    identity = server.accept()
    assert server.asker.hardware
    gate = server.asker.hardware._gate = threading.Event()
    for number in range(5):
        server.feed(identity, number)
    server.finish(identity, 3, 5)
    until(lambda: server.run.node._offered == 6)
    gate.set()
    until(server.results)
    server.run.stop()
    assert [item for item, _ in server.received()] == [1, 1, 1, 1, 1, 2]


@pytest.mark.parametrize("overflow", Overflow)
def test_a_full_queue_loses_no_result(peer: Make, overflow: Overflow) -> None:
    """The hardware takes nothing while feedback of three goals comes; only feedback is lost, and counted as its own."""
    server = peer(NodeSettings(depth=2, overflow=overflow))
    gate = threading.Event()
    for number in range(3):
        server.order(number)
    for number in range(3):
        identity = server.accept(number)
        assert server.asker.hardware
        server.asker.hardware._gate = gate
        for step in range(0 if overflow is Overflow.BLOCK else 4):
            server.feed(identity, step)
        server.finish(identity, SUCCEEDED[server.version], number, number)
    until(lambda: server.run.node.statistics.actions["count"].succeeded == 3)
    gate.set()
    until(lambda: len(server.results()) == 3)
    server.run.stop()
    assert server.results() == [(SUCCEEDED[server.version], number) for number in range(3)]
    inputs = server.run.node.statistics.inputs
    (action,) = server.description.actions
    assert inputs[action.result].dropped == 0
    assert (inputs[action.feedback].dropped > 0) == (overflow is not Overflow.BLOCK)


def test_hardware_cancels_its_goal(peer: Make) -> None:
    """Without an id or with that of the goal; another id has no effect."""
    server = peer()
    for number, name in enumerate((b"", IDS[server.version])):
        server.order(number, name)
        identity = server.accept(number)
        server.feed(identity, 1)
        until(lambda: [item for item, _ in server.received()].count(1) == number + 1)  # noqa: B023
        server.order_cancel(b"another one's id")
        server.order_cancel(name)
        until(lambda: len(server.canceled()) == number + 1)  # noqa: B023
        assert server.canceled()[number] == server.cancellation(identity)
        if server.version == 2:
            server.run.carrier.reply(
                CANCEL_GOAL, server.call(CANCEL_GOAL, number).number, Answer(b"\0\1\0\0" + bytes(8))
            )
        server.finish(identity, CANCELED[server.version], number, number)
        until(lambda: len(server.results()) == number + 1)  # noqa: B023
    server.run.stop()
    assert server.results() == [(CANCELED[server.version], 0), (CANCELED[server.version], 1)]
    assert server.run.node.statistics.actions["count"].canceled == 2


def test_a_goal_that_is_canceled_while_it_waits_is_not_sent(peer: Make) -> None:
    """Its result comes in its turn, since results of ROS 2 have no ids."""
    server = peer()
    server.order(1, IDS[server.version][::-1])
    server.order(2, IDS[server.version])
    identity = server.accept()
    until(lambda: server.run.node.statistics.actions["count"].goals == 2)
    server.order_cancel(IDS[server.version])
    server.order(3)
    until(lambda: server.run.node.statistics.actions["count"].goals == 3)
    server.finish(identity, SUCCEEDED[server.version], 1)
    third = server.accept(1)
    server.finish(third, SUCCEEDED[server.version], 3, 1)
    until(lambda: len(server.results()) == 3)
    server.run.stop()
    nothing = 0 if server.version == 1 else None
    succeeded = SUCCEEDED[server.version]
    assert server.results() == [(succeeded, 1), (RECALLED[server.version], nothing), (succeeded, 3)]
    assert server.canceled() == []


def test_a_goal_is_sent_again_until_its_server_is_there(peer: Make) -> None:
    """It has one id, so a server that receives it twice pursues it once."""
    server = peer()
    server.order(4)
    if server.version == 1:
        goals = server.run.carrier.published
        for number in range(1, 4):
            server.tell_states()
            until(lambda: len([1 for topic, _ in goals if topic == server.first_published + GOAL]) == number)  # noqa: B023
        identity = server.accept()
    else:
        for number in range(2):
            server.run.carrier.reply(SEND_GOAL, server.call(SEND_GOAL, number).number, Answer(reason="no server"))
        identity = server.goal()
        accepted = Answer(b"\0\1\0\0\1\0\0\0" + bytes(8))
        server.run.carrier.reply(SEND_GOAL, server.call(SEND_GOAL, 2).number, accepted)
        # Its services are not found at once.
        server.run.carrier.reply(GET_RESULT, server.call(GET_RESULT).number, Answer(reason="no server"))
    assert len(server.goals()) == 1
    server.finish(identity, SUCCEEDED[server.version], 4, 0 if server.version == 1 else 1)
    until(lambda: server.results() == [(SUCCEEDED[server.version], 4)])
    server.run.stop()


def test_a_goal_waits_for_states_of_actionlib(tmp_path: Path) -> None:
    """What a server publishes before the node is connected to it is lost."""
    server = Peer(tmp_path, 1, time_limit=0.5)
    server.asker.send(0, filled(server.goal_frame, {"goal": {"goal": 4}}))
    until(server.results)
    assert server.goals() == []
    assert "a goal of 'count' is lost: no answer within 0.5 s: no server has told of it" in server.run.reports
    server.order(5)
    server.finish(server.goal(), 3, 5)
    until(lambda: len(server.results()) == 2)
    server.run.stop()
    assert [item["goal"] for item in server.goals()] == [{"goal": 5}]


def test_a_goal_of_a_silent_server_is_lost_and_canceled(peer: Make) -> None:
    server = peer(time_limit=0.3)
    server.order(4)
    identity = server.accept()
    until(server.results)
    until(server.canceled)
    server.order(5)
    second = server.accept(1)
    server.finish(second, SUCCEEDED[server.version], 5, 1)
    until(lambda: len(server.results()) == 2)
    server.run.stop()
    nothing = 0 if server.version == 1 else None
    assert server.results() == [(LOST[server.version], nothing), (SUCCEEDED[server.version], 5)]
    assert server.canceled() == [server.cancellation(identity)]
    assert "a goal of 'count' is lost: no answer within 0.3 s" in server.run.reports
    assert "lost goals: 1" in server.run.node.statistics.text()


def test_states_feedback_and_a_cancellation_extend_the_time_limit(peer: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of another client's goal do not."""
    extended: list[CallLine] = []

    def extend(line: CallLine) -> None:
        extended.append(line)

    monkeypatch.setattr(CallLine, "extend", extend)
    server = peer()
    server.order(4)
    identity = server.accept()
    # The answer to the goal in ROS 2, and its state in ROS 1.
    until(lambda: len(extended) == 1)
    server.tell_states(b"z" * 16)
    server.feed(b"z" * 16, 1)
    server.tell_states(b"z" * 16, identity)
    until(lambda: len(extended) == 2)
    server.feed(identity, 2)
    until(server.received)
    assert len(extended) == 3
    server.order_cancel()
    until(server.canceled)
    assert len(extended) == 4
    server.finish(identity, CANCELED[server.version], 4)
    until(server.results)
    server.run.stop()


def test_a_rejected_goal_has_a_result(peer: Make) -> None:
    server = peer()
    server.order(4)
    if server.version == 1:
        server.finish(server.goal(), REJECTED[1], 0)
    else:
        server.accept(is_accepted=False)
    until(server.results)
    server.run.stop()
    assert server.results() == [(REJECTED[server.version], 0 if server.version == 1 else None)]
    assert server.run.node.statistics.actions["count"].rejected == 1


def test_a_server_that_does_not_know_a_goal_loses_it(tmp_path: Path) -> None:
    """It was restarted; the state of such a result is 0."""
    server = Peer(tmp_path, 2)
    server.order(4)
    server.finish(server.accept(), 0, 0)
    until(lambda: server.results() == [(0, None)])
    server.run.stop()
    assert "a goal of 'count' is lost: the server does not know it" in server.run.reports


def test_goals_that_are_accepted_late_are_canceled(tmp_path: Path) -> None:
    """Each of them, in any order, also if others have followed."""
    server = Peer(tmp_path, 2, time_limit=0.2)
    identities = []
    for number in range(3):
        server.order(number)
        identities.append(server.goal(number))
        until(lambda: len(server.results()) == number + 1)  # noqa: B023
    server.order(3)
    server.goal(3)
    for number in (1, 0):
        server.accept(number)
    server.accept(2, is_accepted=False)
    until(lambda: len(server.canceled()) >= 5)
    server.run.stop()
    late = [server.canceled().count(server.cancellation(identity)) for identity in identities]
    assert late == [2, 2, 1]


def test_restarted_hardware_gets_no_result_of_goals_before(peer: Make) -> None:
    server = peer(NodeSettings(restarts=True))
    server.order(4)
    server.order(5)
    identity = server.accept()
    server.feed(identity, 1)
    until(server.received)
    assert server.asker.hardware
    server.asker.hardware.close()
    until(lambda: server.canceled() == [server.cancellation(identity)])
    server.feed(identity, 2)
    server.finish(identity, CANCELED[server.version], 4)
    until(lambda: server.run.node.statistics.actions["count"].canceled == 2)
    server.order(6)
    third = server.accept(1)
    server.finish(third, SUCCEEDED[server.version], 6, 1)
    until(lambda: server.results() == [(SUCCEEDED[server.version], 6)])
    server.run.stop()
    # The hardware that was restarted receives nothing of the goals before.
    assert [item for item, _ in server.received()] == [2]


def canceled_before_the_end(server: Peer, monkeypatch: pytest.MonkeyPatch) -> list[list[bytes]]:
    """The list to which the node adds what is canceled while ROS still takes messages."""
    canceled: list[list[bytes]] = []

    def stop() -> None:
        canceled.append(server.canceled())
        stop_carrier()

    stop_carrier = server.run.carrier.stop
    monkeypatch.setattr(server.run.carrier, "stop", stop)
    return canceled


def test_goals_are_canceled_when_the_node_ends(peer: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """While ROS still takes messages."""
    server = peer()
    canceled = canceled_before_the_end(server, monkeypatch)
    server.order(4)
    identity = server.accept()
    server.feed(identity, 1)
    until(server.received)
    server.run.stop()
    assert canceled == [[server.cancellation(identity)]]
    assert server.canceled() == canceled[0]
    assert server.run.is_complete


def test_a_goal_that_is_not_accepted_yet_is_canceled_when_the_node_ends(
    peer: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While ROS still takes messages. In ROS 2, its server has to accept it before."""
    server = peer()
    canceled = canceled_before_the_end(server, monkeypatch)
    server.order(4)
    identity = server.goal()
    server.run.node.stop()
    if server.version == 2:
        until(lambda: server.run.node._actions._ends[0]._is_ending)  # type: ignore[union-attr]
        server.accept()
    server.run.wait()
    assert canceled == [[server.cancellation(identity)]]


def test_a_server_that_does_not_answer_does_not_hold_the_end(tmp_path: Path) -> None:
    server = Peer(tmp_path, 2)
    server.order(4)
    server.goal()
    server.run.stop()
    assert server.run.is_complete


def test_goals_until_a_time_are_canceled(peer: Make) -> None:
    """Those of which the node has learned before; the goals of the hardware may lack ids and times."""
    server = peer()
    server.order(1)
    first = server.accept()
    seconds = int(time.time()) + 1
    until(lambda: time.time() > seconds + 0.1)
    server.order(2)
    until(lambda: server.run.node.statistics.actions["count"].goals == 2)
    stamp = struct.pack("<II", seconds, 0)
    server.asker.send(1, stamp + bytes(4) if server.version == 1 else b"\0\1\0\0" + bytes(16) + stamp)
    until(lambda: server.canceled() == [server.cancellation(first)])
    server.finish(first, CANCELED[server.version], 1)
    second = server.accept(1)
    server.finish(second, SUCCEEDED[server.version], 2, 1)
    until(lambda: len(server.results()) == 2)
    server.run.stop()
    assert server.results() == [(CANCELED[server.version], 1), (SUCCEEDED[server.version], 2)]


def test_a_result_after_the_time_limit_does_not_change_the_state(peer: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """The thread that takes it has found the goal before; it goes on while the lost goal is being reported."""
    server = peer(time_limit=0.2)
    end: Any = server.run.node._actions._ends[0]
    report = server.run.reports.append
    state = SUCCEEDED[server.version]
    found: list[Any] = []

    def late(text: str) -> None:
        report(text)
        (goal,) = found
        if server.version == 1:
            payload = server._told(server.result_frame, goal.sent.id, {"result": 5}, state)
        else:
            payload = filled(server.result_frame, {"status": state, "result": {"sequence": [5]}})
        end._finish(goal, payload)

    def begun(goal: Any) -> None:
        found.append(goal)
        begin(goal)

    begin = end._begin
    monkeypatch.setattr(end, "_begin", begun)
    monkeypatch.setattr(end, "_report", late)
    server.order(4)
    server.accept()
    until(server.results)
    server.run.stop()
    assert server.results() == [(LOST[server.version], 0 if server.version == 1 else None)]
    counts = server.run.node.statistics.actions["count"]
    assert (counts.lost, counts.succeeded) == (1, 0)


def test_too_many_goals_are_lost(peer: Make) -> None:
    """Their results come in their turn."""
    server = peer()
    server.order(0)
    identity = server.accept()
    for number in range(1, MOST_WAITING + 2):
        server.order(number)
    until(lambda: server.run.node.statistics.actions["count"].goals == MOST_WAITING + 2)
    assert server.results() == []
    server.order_cancel()
    # After the result, the next goal would be at the server.
    until(server.canceled)
    server.finish(identity, SUCCEEDED[server.version], 5)
    until(lambda: len(server.results()) == MOST_WAITING + 2)
    server.run.stop()
    nothing = 0 if server.version == 1 else None
    recalled = [(RECALLED[server.version], nothing)] * MOST_WAITING
    assert server.results() == [(SUCCEEDED[server.version], 5), *recalled, (LOST[server.version], nothing)]
    assert server.run.node.statistics.actions["count"].lost == 1


@pytest.mark.parametrize("place", ["tick", "line"])
def test_a_fault_in_a_thread_of_an_action_ends_the_run(peer: Make, monkeypatch: pytest.MonkeyPatch, place: str) -> None:
    fault = RuntimeError("a fault")

    def fail(*_: object) -> None:
        raise fault

    server = peer()
    end = server.run.node._actions._ends[0]
    monkeypatch.setattr(end, *(("tick", fail) if place == "tick" else ("_begin", fail)))
    server.order(4)
    server.run.wait()
    assert server.run.error is fault


def test_broken_messages_harm_nobody(peer: Make) -> None:
    """Beginnings of messages and random bytes from both sides; goals between them end."""
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    source = random.Random(seed)
    server = peer()
    for number in range(20):
        server.asker.send(source.randrange(2), source.randbytes(source.randrange(12)))
        server.order(number)
        identity = server.goal(number)
        for topic in (STATES, FEEDBACK, RESULT)[: 4 - server.version]:
            server.run.carrier.give(server.first_topic + topic, source.randbytes(source.randrange(40)))
        if server.version == 2:
            server.run.carrier.reply(source.randrange(3), source.randrange(100), Answer(source.randbytes(3)))
        server.accept(number)
        server.finish(identity, SUCCEEDED[server.version], number, number)
        until(lambda: len(server.results()) == number + 1)  # noqa: B023
    server.run.stop()
    assert server.run.error is None
    assert server.results() == [(SUCCEEDED[server.version], number) for number in range(20)]


@pytest.mark.parametrize("version", [1, 2])
def test_the_generated_file_has_the_actions(tmp_path: Path, version: int) -> None:
    loaded = system(tmp_path, version)
    source = python_node(loaded, middleware_of(version), tmp_path / "planner.yaml", tmp_path)["planner_node.py"]
    names: dict[str, object] = {"__name__": "generated"}
    exec(compile(source, "planner_node.py", "exec"), names)
    assert names["NODE"] == describe(loaded)
