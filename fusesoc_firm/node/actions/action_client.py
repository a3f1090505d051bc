"""Actions of other nodes, to which the hardware sends goals: the server has one of them at a time, in their order.

Each goal of the hardware ends with exactly one result. The node assigns each goal an id that is unique among all
clients; messages to the hardware contain the hardware's own id.
"""

from __future__ import annotations

import math
import threading
import time
from abc import abstractmethod
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from uuid import uuid4

from fusesoc_firm.node.actions.action_end import ActionEnd, GoalCounts, Put, Report, Ways
from fusesoc_firm.node.actions.action_messages import (
    NO_STAMP,
    Messages,
    Reference,
    Ros1Messages,
    Ros2Messages,
    State,
    Status,
    now,
)
from fusesoc_firm.node.engine.calls import CallLine, Start
from fusesoc_firm.node.engine.carrier import Answer, Call
from fusesoc_firm.node.engine.queues import ClosedError
from fusesoc_firm.node.interface.action_types import (
    CANCEL,
    CANCEL_GOAL,
    FEEDBACK,
    GET_RESULT,
    GOAL,
    SEND_GOAL,
    STATES,
    NodeAction,
)

# s; messages that a server has not received are repeated.
_AGAIN_SECONDS = 0.5
# Lost goals that a server may accept late.
MOST_LATE = 100
# s; after this time without states, a server of actionlib is missing.
_HEARD_SECONDS = 2.0


@dataclass
class _Request:
    """A call of a goal (ROS 2): the number of the last attempt, and the time of the next one after a failure."""

    payload: bytes
    number: int
    again: float | None = None


@dataclass
class _Goal:
    """A goal: the number of its call in the line, the hardware's id, and the id for the server.

    With `is_known`, the server has reported the goal. `fault` is the reason for the last failed attempt.
    """

    number: int
    own: Reference
    sent: Reference
    payload: bytes
    state: State = State.WAITING
    was_sent: bool = False
    is_known: bool = False
    is_canceled: bool = False
    cancel_was_sent: bool = False
    is_forgotten: bool = False
    tried: float = -math.inf
    fault: str = ""
    requests: dict[int, _Request] = field(default_factory=dict)

    @property
    def named(self) -> Reference:
        """The goal as named in cancellations of the hardware; without its own time, the arrival time is used."""
        return self.own if any(self.own.stamp) else self.own._replace(stamp=self.sent.stamp)


class ActionClient(ActionEnd):
    """The goals of the hardware for one action; any thread may call the methods.

    A goal is repeated until the server reports it. If the server does not report it within the time limit, it is lost,
    and canceled, since the server may still execute it.
    """

    messages: Messages

    def __init__(self, action: NodeAction, counts: GoalCounts, put: Put, report: Report, start: Start) -> None:
        super().__init__(action, counts, put, report)
        self._numbers = count()
        # A message to the hardware must not be sent with the first lock: the hardware may wait for `take`.
        self._lock, self._sending = threading.RLock(), threading.Lock()
        # The condition for `wait_until_canceled`.
        self._progress = threading.Condition(self._lock)
        # The goals that have not ended; the one that the server has.
        self._goals: dict[int, _Goal] = {}
        self._current: _Goal | None = None
        self._is_ending = False
        self._line = CallLine(action.time_limit, self._hand_over, self._handed_back, start, from_hardware=True)

    def start(self, ways: Ways) -> None:
        """Begin to send goals."""
        self._publish, self._call = ways.publish, ways.call

    # --- from the hardware -----------------------------------------------------------------------------------------

    def take(self, block: str, payload: bytes) -> bool:
        """Take a goal or a cancellation."""
        if block not in (self.action.goal, self.action.cancel):
            return False
        with self._reporting():
            if block == self.action.goal:
                self._add(payload)
            else:
                self._cancel(self.messages.cancellation(payload))
        return True

    def _add(self, payload: bytes) -> None:
        own = self.messages.goal(payload)
        with self._lock:
            number = next(self._numbers)
            sent = Reference(self._new_id(), now())
            goal = _Goal(number, own, sent, self.messages.renamed(payload, sent), is_canceled=self._is_ending)
            self._goals[number] = goal
            self.counts.goals += 1
        self._line.put(Call(number, payload))

    def _cancel(self, wanted: Reference) -> None:
        """Cancel goals; a waiting goal ends at its turn."""
        with self._lock:
            for goal in self._goals.values():
                if wanted.means(goal.named) and not goal.is_canceled:
                    goal.is_canceled = True
                    if goal is self._current:
                        # The time limit for a cancellation begins when it is sent.
                        self._line.extend()
                        self._cancel_current(goal)

    def refuse(self, block: str, reason: str) -> None:
        """Do nothing: no goal depends on a faulty frame."""

    def forget(self, reason: str) -> None:
        """Cancel all goals: the hardware has lost them, and receives no results."""
        with self._lock:
            for goal in self._goals.values():
                goal.is_forgotten = True
        self._cancel(Reference(b"", NO_STAMP))

    def rest(self) -> None:
        """Do nothing: the server, not the hardware, has the goals."""

    # --- to and from the server ------------------------------------------------------------------------------------

    def _hand_over(self, call: Call) -> None:
        with self._lock:
            goal = self._goals[call.number]
            if not goal.is_canceled:
                self._current, goal.was_sent = goal, True
                self._begin(goal)
                return
            self._settle(goal, State.CANCELED)

    def _take_feedback(self, payload: bytes) -> None:
        goal = self._named(payload)
        if goal is None:
            return
        with self._sending:
            if goal is self._current and not goal.is_forgotten:
                self._put(self.action.feedback, self.messages.renamed(payload, goal.own))

    def _named(self, payload: bytes) -> _Goal | None:
        """Return the hardware's goal in feedback or a result of ROS 1; None for the goals of other clients."""
        name = self.messages.goal(payload).id
        with self._lock:
            goal = self._current
            return self._told(goal) if goal and goal.sent.id == name else None

    def _take_states(self, payload: bytes) -> None:
        with self._lock:
            if self._current and self._current.sent.id in self.messages.listed(payload):
                self._told(self._current)

    def _told(self, goal: _Goal) -> _Goal:
        """Record that the server has reported a goal."""
        goal.is_known, goal.fault = True, ""
        self._line.extend()
        return goal

    def _finish(self, goal: _Goal, payload: bytes) -> None:
        """Take the result for the hardware; raise `ValueError` if it is invalid."""
        self._settle(goal, self.messages.state(payload), payload)

    def _settle(self, goal: _Goal, state: State, payload: bytes = b"") -> None:
        """End a goal with a state, unless it has ended; without a payload, the node creates the result."""
        with self._lock:
            # The line returns the goal when the lock is free.
            if goal.number in self._goals and self._line.settle(Answer(payload), goal.number):
                goal.state = state

    def _handed_back(self, call: Call, answer: Answer) -> None:
        with self._lock:
            goal = self._goals.pop(call.number)
            if self._current is goal:
                self._current = None
            if answer.payload is None:
                goal.state = State.LOST
                if goal.was_sent and not goal.cancel_was_sent:
                    self._give_up(goal)
            setattr(self.counts, goal.state.value, getattr(self.counts, goal.state.value) + 1)
            reason = f"{answer.reason}: {goal.fault}" if goal.fault else answer.reason
            status = Status(goal.own, goal.state, goal.was_sent, reason.encode())
            self._progress.notify_all()
        if status.state is State.LOST:
            self._report(f"a goal of '{self.action.block}' is lost: {reason}")
        result = answer.payload or self.messages.result(status, self.action.no_result)
        if not goal.is_forgotten:
            with self._sending, suppress(ClosedError):
                self._put(self.action.result, result)

    # --- times -----------------------------------------------------------------------------------------------------

    def tick(self) -> None:
        """Repeat messages that the server has not received."""
        with self._lock:
            if self._current:
                self._repeat(self._current)

    @property
    def is_idle(self) -> bool:
        """Whether the node can end without waiting for a goal: goals are canceled then."""
        return True

    def give_up(self) -> None:
        """Cancel all current and later goals."""
        with self._lock:
            self._is_ending = True
            self._cancel(Reference(b"", NO_STAMP))
            if self._current and not self._current.cancel_was_sent:
                self._cancel_early(self._current)

    def wait_until_canceled(self, seconds: float) -> None:
        """Wait for the answer of a server that has a goal and may not have accepted it yet."""
        with self._lock:
            self._progress.wait_for(lambda: not (self._current and self._is_being_sent(self._current)), seconds)

    def close(self) -> None:
        """End all goals."""
        self._line.close()

    # --- what differs between the versions of ROS, with the lock -----------------------------------------------------

    @abstractmethod
    def _new_id(self) -> bytes:
        """Return an id for the server."""

    @abstractmethod
    def _begin(self, goal: _Goal) -> None:
        """Send a goal to the server."""

    @abstractmethod
    def _repeat(self, goal: _Goal) -> None:
        """Repeat the messages that are due."""

    @abstractmethod
    def _cancel_current(self, goal: _Goal) -> None:
        """Cancel the goal that the server has, as soon as the server knows it."""

    @abstractmethod
    def _cancel_early(self, goal: _Goal) -> None:
        """Cancel the goal that the server has, if the server permits this before it knows the goal."""

    @abstractmethod
    def _is_being_sent(self, goal: _Goal) -> bool:
        """Return whether an answer must arrive before the goal can be canceled."""

    @abstractmethod
    def _give_up(self, goal: _Goal) -> None:
        """Cancel a lost goal."""


class Ros1Client(ActionClient):
    """A client of actionlib. Its server publishes the states of all goals at intervals.

    No goal is sent before the first states: the carrier passes them on when the other topics are also connected. An
    earlier result would be lost.
    """

    def __init__(self, action: NodeAction, counts: GoalCounts, put: Put, report: Report, start: Start) -> None:
        self.messages: Ros1Messages = Ros1Messages()
        self._heard = -math.inf
        super().__init__(action, counts, put, report, start)

    def taken(self, topic: int, payload: bytes) -> None:
        """Take states, feedback or a result."""
        with self._reporting():
            if topic == STATES:
                self._heard = time.monotonic()
                self._take_states(payload)
            elif topic == FEEDBACK:
                self._take_feedback(payload)
            elif goal := self._named(payload):
                self._finish(goal, self.messages.renamed(payload, goal.own))

    def _new_id(self) -> bytes:
        return f"{self.action.block}-{uuid4().hex}".encode()

    def _begin(self, goal: _Goal) -> None:
        goal.fault = "no server has told of it"
        self._repeat(goal)

    def _repeat(self, goal: _Goal) -> None:
        if goal.is_known:
            if goal.is_canceled and not goal.cancel_was_sent:
                self._give_up(goal)
        elif time.monotonic() - goal.tried >= _AGAIN_SECONDS and time.monotonic() - self._heard < _HEARD_SECONDS:
            # Servers ignore a known goal.
            goal.tried = time.monotonic()
            self._publish(GOAL, goal.payload)

    def _cancel_current(self, goal: _Goal) -> None:
        if goal.is_known:
            self._give_up(goal)

    def _cancel_early(self, goal: _Goal) -> None:
        # A server of actionlib keeps the cancellation of a goal that has not arrived.
        if goal.tried > -math.inf:
            self._give_up(goal)

    def _is_being_sent(self, goal: _Goal) -> bool:
        return False

    def _give_up(self, goal: _Goal) -> None:
        goal.cancel_was_sent = True
        self._publish(CANCEL, self.messages.cancel(Reference(goal.sent.id, NO_STAMP)))


class Ros2Client(ActionClient):
    """A client of an action of ROS 2, which calls three services for each goal."""

    def __init__(self, action: NodeAction, counts: GoalCounts, put: Put, report: Report, start: Start) -> None:
        self.messages: Ros2Messages = Ros2Messages()
        self._call_numbers = count()
        # Lost goals by the numbers of their last attempts: the server may accept them late.
        self._late: dict[int, _Goal] = {}
        super().__init__(action, counts, put, report, start)

    def taken(self, topic: int, payload: bytes) -> None:
        """Take states or feedback."""
        with self._reporting():
            if topic == STATES:
                self._take_states(payload)
            else:
                self._take_feedback(payload)

    def answered(self, service: int, number: int, answer: Answer) -> None:
        """Take the answer to a goal, a cancellation or a request for a result."""
        with self._lock:
            goal = self._current
            request = goal.requests.get(service) if goal else None
            if goal is None or request is None or request.number != number:
                self._take_late(service, number, answer)
            elif answer.payload is None:
                request.again = time.monotonic() + _AGAIN_SECONDS
                goal.fault = answer.reason
            else:
                with self._reporting():
                    self._take_answer(goal, service, answer.payload)
            self._progress.notify_all()

    def _take_answer(self, goal: _Goal, service: int, payload: bytes) -> None:
        self._told(goal)
        if service == SEND_GOAL:
            if self.messages.is_accepted(payload):
                self._request(goal, GET_RESULT, self.messages.request(goal.sent))
                if goal.is_canceled:
                    self._cancel_current(goal)
            else:
                self._settle(goal, State.REJECTED)
        elif service == GET_RESULT:
            if self.messages.is_unknown(payload):
                self._line.settle(Answer(reason="the server does not know it"), goal.number)
            else:
                self._finish(goal, payload)

    def _take_late(self, service: int, number: int, answer: Answer) -> None:
        """Cancel a lost goal that is accepted late."""
        goal = self._late.pop(number, None) if service == SEND_GOAL else None
        if goal and answer.payload is not None:
            with self._reporting():
                if self.messages.is_accepted(answer.payload):
                    self._request_cancel(goal)

    def _new_id(self) -> bytes:
        return uuid4().bytes

    def _begin(self, goal: _Goal) -> None:
        self._request(goal, SEND_GOAL, goal.payload)

    def _repeat(self, goal: _Goal) -> None:
        for service, request in [*goal.requests.items()]:
            if request.again is not None and time.monotonic() >= request.again:
                self._request(goal, service, request.payload)

    def _cancel_current(self, goal: _Goal) -> None:
        # A server cancels only goals that it has accepted.
        if GET_RESULT in goal.requests:
            self._give_up(goal)

    def _cancel_early(self, goal: _Goal) -> None:
        # See `_is_being_sent`.
        pass

    def _is_being_sent(self, goal: _Goal) -> bool:
        send = goal.requests.get(SEND_GOAL)
        return send is not None and send.again is None and GET_RESULT not in goal.requests

    def _give_up(self, goal: _Goal) -> None:
        goal.cancel_was_sent = True
        if goal.state is State.LOST and self._is_being_sent(goal):
            self._late[goal.requests[SEND_GOAL].number] = goal
            if len(self._late) > MOST_LATE:
                del self._late[next(iter(self._late))]
        self._request_cancel(goal)

    def _request_cancel(self, goal: _Goal) -> None:
        self._request(goal, CANCEL_GOAL, self.messages.cancel(Reference(goal.sent.id, NO_STAMP)))

    def _request(self, goal: _Goal, service: int, payload: bytes) -> None:
        number = next(self._call_numbers)
        goal.requests[service] = _Request(payload, number)
        self._call(service, Call(number, payload))
