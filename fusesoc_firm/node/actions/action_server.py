"""Actions that the hardware serves: it has one goal of an action at a time, further goals wait in their order.

Clients send and cancel goals, and request results; the hardware only has its current goal. The node keeps the ids,
states and results, and publishes them in the form of each version of ROS: topics of actionlib (ROS 1), or services and
topics (ROS 2).
"""

from __future__ import annotations

import math
import threading
import time
from abc import abstractmethod
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count, islice

from fusesoc_firm.node.actions.action_end import ActionEnd, GoalCounts, Put, Report, Ways
from fusesoc_firm.node.actions.action_messages import (
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
    CANCEL_GOAL,
    FEEDBACK,
    GET_RESULT,
    GOAL,
    RESULT,
    SEND_GOAL,
    STATES,
    NodeAction,
)

# The limits of ended goals of one action, with their results (ROS 2) or only their states (ROS 1), and of clients that
# wait for one goal's result. A client of actionlib must see the end of its goal, so in ROS 1 as many goals are kept as
# may wait.
MOST_KEPT = 100
MOST_KEPT_ROS1 = 1000
MOST_ASKERS = 100
# Early cancellations of actionlib, which arrive before their goals.
MOST_EARLY = 100
# s; the interval of actionlib's states is 0.2 s.
_STATES_SECONDS = 0.2
# s; changes within this time are published together, since each message contains all goals.
_TOGETHER_SECONDS = 0.02
# Return codes of action_msgs/CancelGoal.
_NO_ERROR, _UNKNOWN_GOAL, _ENDED_GOAL = 0, 2, 3


@dataclass
class _Goal:
    """A goal; `asker` is the call that sent it, `askers` are the calls that wait for its result (ROS 2)."""

    reference: Reference
    payload: bytes
    asker: int | None = None
    state: State = State.WAITING
    is_accepted: bool = False
    was_taken: bool = False
    text: bytes = b""
    result: bytes = b""
    changed: float = field(default_factory=time.monotonic)
    askers: list[int] = field(default_factory=list)

    @property
    def status(self) -> Status:
        return Status(self.reference, self.state, self.was_taken, self.text)


class ActionServer(ActionEnd):
    """The goals of one action; any thread may call the methods.

    A goal is accepted at the hardware's first feedback or result, at the latest after `accept_limit`. If it fails
    before acceptance, it is rejected, otherwise aborted.
    """

    # s
    _kept_seconds: float
    _most_kept: int
    # Whether a goal is accepted even before the hardware has it.
    _accepts_waiting: bool
    messages: Messages

    def __init__(self, action: NodeAction, counts: GoalCounts, put: Put, report: Report, start: Start) -> None:
        super().__init__(action, counts, put, report)
        self._numbers = count()
        self._lock, self._sending = threading.RLock(), threading.Lock()
        # All goals that clients may know, in order, and the goals that are still in the line.
        self._goals: dict[bytes, _Goal] = {}
        self._calls: dict[int, _Goal] = {}
        self._current: _Goal | None = None
        self._line = CallLine(action.time_limit, self._hand_over, self._handed_back, start, from_hardware=False)

    def start(self, ways: Ways) -> None:
        """Begin to report goals to clients."""
        self._publish, self._reply = ways.publish, ways.reply
        self._tell_states()

    # --- from clients ----------------------------------------------------------------------------------------------

    def _add(self, payload: bytes, asker: int | None = None) -> None:
        """Take a goal; one with a known id is rejected."""
        with self._lock:
            goal = _Goal(self._reference(payload), payload, asker)
            is_known = goal.reference.id in self._goals
            if is_known:
                self._turn_down(goal)
                return
            self.counts.goals += 1
            self._goals[goal.reference.id] = goal
            number = next(self._numbers)
            self._calls[number] = goal
            if self._is_canceled(goal):
                self._end(goal, State.CANCELED)
            else:
                self._tell_states()
        self._line.put(Call(number, payload))

    def _cancel(self, wanted: Reference) -> tuple[list[Reference], bool]:
        """Cancel goals; return the goals being canceled, and whether the goal in the message is known."""
        with self._lock:
            found = [goal for goal in self._goals.values() if self._is_meant(goal, wanted)]
            for goal in found:
                if not goal.was_taken:
                    self._end(goal, State.CANCELED, text=b"the goal was canceled while it waited")
            begun = [goal for goal in found if goal.was_taken and goal.state is not State.CANCELING]
            for goal in begun:
                self._accept(goal)
                goal.state = State.CANCELING
                # The time limit for a cancellation begins when it is sent.
                self._line.extend()
            self._tell_states()
            named = self._goals.get(wanted.id)
        for goal in begun:
            self._send_cancel(goal)
        return [goal.reference for goal in found], named is not None

    def _is_meant(self, goal: _Goal, wanted: Reference) -> bool:
        """Return whether a cancellation includes a goal."""
        is_known = goal.is_accepted or not self._accepts_waiting
        return is_known and not goal.state.has_ended and wanted.means(goal.reference)

    # --- to and from the hardware ----------------------------------------------------------------------------------

    def _hand_over(self, call: Call) -> None:
        with self._sending:
            with self._lock:
                goal = self._calls[call.number]
                is_over = goal.state.has_ended
                if not is_over:
                    self._current, goal.was_taken = goal, True
                    goal.changed = time.monotonic()
                    if goal.is_accepted:
                        goal.state = State.EXECUTING
                        self._tell_states()
            if not is_over:
                self._put(self.action.goal, goal.payload)
        if is_over:
            self._line.settle(Answer(b""))

    def take(self, block: str, payload: bytes) -> bool:
        """Take feedback or a result."""
        if block == self.action.feedback:
            self._take_feedback(payload)
        elif block == self.action.result:
            if not self._line.settle(Answer(payload)):
                self._take_unasked("a result")
        else:
            return False
        return True

    def _take_feedback(self, payload: bytes) -> None:
        with self._lock:
            goal = self._current
            if goal is None:
                self._take_unasked("feedback")
                return
            self._line.extend()
            self._accept(goal)
            self._before_feedback()
            with self._reporting():
                self._publish(FEEDBACK, self.messages.feedback(goal.status, payload))

    def _take_unasked(self, what: str) -> None:
        with self._lock:
            self.counts.unasked += 1
        self._report(f"the hardware sent {what} of '{self.action.block}' for no goal")

    def refuse(self, block: str, reason: str) -> None:
        """Fail the goal with a fault of the hardware; after a fault in a goal, a result may follow."""
        if block in (self.action.goal, self.action.result):
            self._line.settle(Answer(reason=reason), is_final=block == self.action.result)

    def forget(self, reason: str) -> None:
        """Fail the hardware's current goal."""
        self._line.settle(Answer(reason=reason))

    def rest(self) -> None:
        """Handle the report that the hardware is idle."""
        self._line.rest()

    @property
    def is_idle(self) -> bool:
        """Whether all goals have ended."""
        return self._line.is_idle

    def give_up(self) -> None:
        """Do nothing: the hardware completes its goals."""

    def close(self) -> None:
        """Fail all goals that have not ended."""
        self._line.close()

    def _handed_back(self, call: Call, answer: Answer) -> None:
        with self._lock:
            goal = self._calls.pop(call.number)
            if self._current is goal:
                self._current = None
            if goal.state.has_ended:
                return
            if answer.payload is None:
                self._fail(goal, answer.reason)
            else:
                self._finish(goal, answer.payload)
        if answer.payload is None and goal.was_taken:
            # The hardware may still work.
            self._send_cancel(goal)

    def _send_cancel(self, goal: _Goal) -> None:
        with self._sending, suppress(ClosedError):
            self._put(self.action.cancel, self.messages.cancel(goal.reference))

    # --- the states of a goal, with the lock -------------------------------------------------------------------------

    def _accept(self, goal: _Goal) -> None:
        if goal.is_accepted:
            return
        goal.is_accepted = True
        if goal.was_taken:
            goal.state = State.EXECUTING
        self._accepted(goal)
        self._tell_states()

    def _fail(self, goal: _Goal, reason: str) -> None:
        state = State.ABORTED if goal.is_accepted else State.REJECTED
        self._report(f"a goal of '{self.action.block}' is {state.value}: {reason}")
        self._end(goal, state, text=reason.encode())

    def _finish(self, goal: _Goal, payload: bytes) -> None:
        try:
            state = self.messages.state(payload)
        except ValueError as error:
            self._fail(goal, f"the hardware sent an invalid result: {error}")
            return
        if state is State.REJECTED and goal.is_accepted:
            state = State.ABORTED
        if state is not State.REJECTED:
            self._accept(goal)
        self._end(goal, state, payload)

    def _end(self, goal: _Goal, state: State, payload: bytes = b"", text: bytes = b"") -> None:
        goal.state, goal.text, goal.changed = state, text, time.monotonic()
        goal.result = self.messages.result(goal.status, payload or self.action.no_result)
        setattr(self.counts, state.value, getattr(self.counts, state.value) + 1)
        self._ended(goal)
        self._tell_states()
        self._forget_old()

    def _forget_old(self) -> None:
        ended = [goal for goal in self._goals.values() if goal.state.has_ended]
        latest = time.monotonic() - self._kept_seconds
        for number, goal in enumerate(reversed(ended)):
            if number >= self._most_kept or goal.changed < latest:
                del self._goals[goal.reference.id]

    def tick(self) -> None:
        """Accept goals in time, and delete old results; called about every 0.1 s."""
        with self._lock:
            latest = time.monotonic() - self.action.accept_limit
            for goal in self._goals.values():
                is_ready = goal.was_taken or self._accepts_waiting
                if is_ready and not goal.state.has_ended and goal.changed < latest:
                    self._accept(goal)
            self._forget_old()

    def _tell_states(self) -> None:
        known = [goal.status for goal in self._goals.values() if goal.is_accepted or not self._accepts_waiting]
        self._publish(STATES, self.messages.states(known))

    # --- what differs between the versions of ROS --------------------------------------------------------------------

    @abstractmethod
    def _reference(self, payload: bytes) -> Reference:
        """Return the id of a goal, and its time."""

    @abstractmethod
    def _is_canceled(self, goal: _Goal) -> bool:
        """Return whether a goal was canceled before it arrived."""

    @abstractmethod
    def _turn_down(self, goal: _Goal) -> None:
        """Reject a goal whose id is known."""

    @abstractmethod
    def _accepted(self, goal: _Goal) -> None:
        """Report the acceptance to the client."""

    @abstractmethod
    def _before_feedback(self) -> None:
        """Report the state of the goal to clients first."""

    @abstractmethod
    def _ended(self, goal: _Goal) -> None:
        """Send the result to the clients."""


class Ros1Server(ActionServer):
    """An action of actionlib. The states of goals are published at intervals; clients watch them."""

    # actionlib's own.
    _kept_seconds = 5.0
    _most_kept = MOST_KEPT_ROS1
    _accepts_waiting = False

    def __init__(self, action: NodeAction, counts: GoalCounts, put: Put, report: Report, start: Start) -> None:
        self.messages: Ros1Messages = Ros1Messages()
        # Goals and cancellations have separate topics, so a cancellation may arrive first.
        self._early: dict[bytes, None] = {}
        self._canceled_until = (0, 0)
        self._told = -math.inf
        self._has_news = False
        super().__init__(action, counts, put, report, start)

    def taken(self, topic: int, payload: bytes) -> None:
        """Take a goal or a cancellation."""
        with self._reporting():
            if topic == GOAL:
                self._add(payload)
                return
            wanted = self.messages.cancellation(payload)
            _, is_known = self._cancel(wanted)
            with self._lock:
                self._canceled_until = max(self._canceled_until, wanted.stamp)
                if wanted.id and not is_known:
                    self._early[wanted.id] = None
                    for old in [*islice(self._early, max(0, len(self._early) - MOST_EARLY))]:
                        del self._early[old]

    def tick(self) -> None:
        """Publish the states."""
        super().tick()
        self._tell_news(_STATES_SECONDS)

    def close(self) -> None:
        """Fail all goals that have not ended, and publish their states."""
        super().close()
        self._tell_news()

    def _tell_news(self, seconds: float = math.inf) -> None:
        """Publish the states after a change, or after this time."""
        with self._lock:
            if self._has_news or time.monotonic() - self._told >= seconds:
                self._told = -math.inf
                self._tell_states()

    def _tell_states(self) -> None:
        self._has_news = time.monotonic() - self._told < _TOGETHER_SECONDS
        if not self._has_news:
            self._told = time.monotonic()
            super()._tell_states()

    def _reference(self, payload: bytes) -> Reference:
        found = self.messages.goal(payload)
        stamp = found.stamp if any(found.stamp) else now()
        own = f"{self.action.block}-{next(self._numbers)}-{stamp[0]}.{stamp[1]:09}".encode()
        return Reference(found.id or own, stamp)

    def _is_canceled(self, goal: _Goal) -> bool:
        is_early = goal.reference.id in self._early
        self._early.pop(goal.reference.id, None)
        return is_early or goal.reference.stamp <= self._canceled_until

    def _turn_down(self, goal: _Goal) -> None:
        # actionlib ignores such a goal, too.
        self._report(f"a goal of '{self.action.block}' with a known id is ignored")

    def _accepted(self, goal: _Goal) -> None:
        # The states report it.
        pass

    def _before_feedback(self) -> None:
        # A client of actionlib loses a goal that it cancels before it knows the goal's state.
        self._tell_news()

    def _ended(self, goal: _Goal) -> None:
        self._publish(RESULT, goal.result)


class Ros2Server(ActionServer):
    """An action of ROS 2. Clients request the result of a goal, also after its end."""

    _kept_seconds = 60.0
    _most_kept = MOST_KEPT
    _accepts_waiting = True

    def __init__(self, action: NodeAction, counts: GoalCounts, put: Put, report: Report, start: Start) -> None:
        self.messages: Ros2Messages = Ros2Messages()
        super().__init__(action, counts, put, report, start)

    def taken(self, topic: int, payload: bytes) -> None:
        """Do nothing: goals are calls."""

    def called(self, service: int, call: Call) -> None:
        """Take a goal, a cancellation, or a request for a result."""
        with self._reporting():
            if service == SEND_GOAL:
                self._add(call.payload, call.number)
            elif service == CANCEL_GOAL:
                self._answer_cancel(call)
            else:
                self._answer_result(call)

    def _answer_cancel(self, call: Call) -> None:
        wanted = self.messages.cancellation(call.payload)
        found, is_known = self._cancel(wanted)
        is_missing = any(wanted.id) and not any(goal.id == wanted.id for goal in found)
        code = (_ENDED_GOAL if is_known else _UNKNOWN_GOAL) if is_missing else _NO_ERROR
        self._reply(CANCEL_GOAL, call.number, self.messages.canceling(code, found))

    def _answer_result(self, call: Call) -> None:
        with self._lock:
            goal = self._goals.get(self.messages.requested(call.payload))
            if goal and not goal.state.has_ended and len(goal.askers) < MOST_ASKERS:
                goal.askers.append(call.number)
                return
            has_result = goal is not None and goal.state.has_ended
            found = goal.result if goal and has_result else self.messages.unknown(self.action.no_result)
        self._reply(GET_RESULT, call.number, found)

    def _reference(self, payload: bytes) -> Reference:
        return self.messages.goal(payload)

    def _is_canceled(self, goal: _Goal) -> bool:
        return False

    def _turn_down(self, goal: _Goal) -> None:
        if goal.asker is not None:
            self._reply(SEND_GOAL, goal.asker, self.messages.accepted(None))

    def _accepted(self, goal: _Goal) -> None:
        goal.reference = goal.reference._replace(stamp=now())
        if goal.asker is not None:
            self._reply(SEND_GOAL, goal.asker, self.messages.accepted(goal.reference.stamp))

    def _before_feedback(self) -> None:
        # The states are published at each change.
        pass

    def _ended(self, goal: _Goal) -> None:
        if goal.state is State.REJECTED:
            del self._goals[goal.reference.id]
            self._turn_down(goal)
        for asker in goal.askers:
            self._reply(GET_RESULT, asker, goal.result)
        goal.askers.clear()
