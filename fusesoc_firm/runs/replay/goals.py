"""The goals of an action in a replay: they reach the hardware as from a node, one at a time.

The hardware's messages for a goal are compared with those in the bag, except the parts that a node sets itself: ids,
headers, and the state in feedback. States of results are compared as a node interprets them.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from itertools import count
from typing import Any

from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.frame.defaults import completed, encode_used
from fusesoc_firm.message import ROS1
from fusesoc_firm.node.actions.action_messages import (
    NO_STAMP,
    Messages,
    Reference,
    Ros1Messages,
    Ros2Messages,
    Stamp,
    State,
)
from fusesoc_firm.runs.replay.hardware_run import Sent
from fusesoc_firm.system.derived.model import Action, Topic

# Sends a payload to a block at a stamp in ns, and returns whether the hardware accepted it without a fault. Before it
# returns, it passes the messages that the hardware has sent meanwhile to `GoalLine.take`.
Send = Callable[[str, bytes, int], bool]
# Fields of feedback and results: the header and the state in ROS 1, the id and the state in ROS 2.
SET_BY_NODE = ("header", "status", "goal_id")


class Verdict(Enum):
    """The verdict on a message for a goal; the values are the summary's words."""

    EQUAL = "as_recorded"
    DIFFERENT = "different"
    MISSING = "missing"
    NOT_RECORDED = "not_recorded"
    NO_GOAL = "without_goal"


# The state of a result, and its other fields as bytes.
_Content = tuple[State | None, bytes]


@dataclass
class _Pairs:
    """Pairs of messages: the hardware's n-th message for a goal belongs to the n-th one in the bag."""

    sent: deque[_Content] = field(default_factory=deque)
    recorded: deque[_Content] = field(default_factory=deque)
    counts: Counter[Verdict] = field(default_factory=Counter)

    def compare(self) -> None:
        """Compare the complete pairs."""
        while self.sent and self.recorded:
            is_equal = self.sent.popleft() == self.recorded.popleft()
            self.counts[Verdict.EQUAL if is_equal else Verdict.DIFFERENT] += 1

    def total(self, *, has_goal: bool) -> Counter[Verdict]:
        """Return the counts; the bag's remaining messages count as missing, or as `NO_GOAL` if it lacks the goal."""
        left = Verdict.MISSING if has_goal else Verdict.NO_GOAL
        return self.counts + Counter({left: len(self.recorded), Verdict.NOT_RECORDED: len(self.sent)})


@dataclass
class _Goal:
    """A goal, possibly known only from its feedback or result; the payload is kept until the goal is sent."""

    reference: Reference
    is_in_bag: bool = False
    payload: bytes = b""
    is_canceled: bool = False
    # Whether a node would have accepted it: there was feedback or a cancellation.
    is_accepted: bool = False
    has_recorded_result: bool = False
    feedback: _Pairs = field(default_factory=_Pairs)
    result: _Pairs = field(default_factory=_Pairs)


class GoalLine:
    """The goals of one action that the hardware serves.

    Simulated hardware has unlimited time. If a goal has no result when its recorded result is read, it will never have
    one: it is canceled like a goal at its time limit, and the next goal follows.
    """

    def __init__(self, action: Action, topics: Mapping[str, Topic], send: Send) -> None:
        """Prepare an action; `topics` are those of the system by their blocks."""
        self.action = action
        self._topics = topics
        self._send = send
        self._messages: Messages = Ros1Messages() if action.ros is ROS1 else Ros2Messages()
        self._goals: dict[bytes, _Goal] = {}
        self._waiting: deque[_Goal] = deque()
        self._current: _Goal | None = None
        self._nameless = count()
        # ROS 1 has separate topics for goals and cancellations, so a cancellation may be recorded first.
        self._early: set[bytes] = set()
        self._canceled_until: Stamp = NO_STAMP
        self._unasked: Counter[str] = Counter()

    # --- from the bag ----------------------------------------------------------------------------------------------

    def give(self, block: str, payload: bytes, stamp: int) -> None:
        """Give a goal or a cancellation to the hardware, or note it for later. `stamp` is in ns."""
        try:
            decode(self._topics[block].frame, payload)
        except CodecError:
            # Report the error as for any other message.
            self._send(block, payload, stamp)
            return
        if block == self.action.goal:
            self._add(payload, stamp)
        else:
            self._cancel(payload, stamp)
        self.advance(stamp)

    def _add(self, payload: bytes, stamp: int) -> None:
        found = self._messages.goal(payload)
        when = found.stamp if any(found.stamp) else divmod(stamp, 10**9)
        # A node assigns an id to a goal without one.
        reference = Reference(found.id or f"\0{next(self._nameless)}".encode(), when)
        goal = self._goals.setdefault(reference.id, _Goal(reference))
        if goal.is_in_bag:
            # Servers ignore a repeated goal, which clients may send.
            return
        goal.reference, goal.payload, goal.is_in_bag = reference, payload, True
        if self.action.ros is ROS1 and (reference.id in self._early or reference.stamp <= self._canceled_until):
            self._end_unsent(goal)
        else:
            self._waiting.append(goal)

    def _cancel(self, payload: bytes, stamp: int) -> None:
        wanted = self._messages.cancellation(payload)
        for goal in [item for item in self._waiting if wanted.means(item.reference)]:
            self._waiting.remove(goal)
            self._end_unsent(goal)
        if self._current and wanted.means(self._current.reference):
            self._cancel_current(self._current, stamp)
        self._canceled_until = max(self._canceled_until, wanted.stamp)
        if wanted.id not in self._goals:
            self._early.add(wanted.id)

    def _cancel_current(self, goal: _Goal, stamp: int) -> None:
        if not goal.is_canceled:
            goal.is_canceled = goal.is_accepted = True
            self._send(self.action.cancel, self._messages.cancel(goal.reference), stamp)

    def _end_unsent(self, goal: _Goal) -> None:
        """End a goal that was canceled before the hardware received it, with an empty result."""
        frame = self._topics[self.action.result].frame
        goal.result.sent.append((State.CANCELED, encode_used(frame, completed(frame, {}))))
        goal.result.compare()

    def tell(self, block: str, owner: bytes, payload: bytes | None, stamp: int) -> None:
        """Process recorded feedback or a recorded result; without `payload`, the goal was rejected.

        Raise `ValueError` or `CodecError` if the message is invalid.
        """
        reference = self._messages.goal(owner)
        content = (State.REJECTED, b"") if payload is None else self._content(block, payload)
        goal = self._goals.setdefault(reference.id, _Goal(reference))
        if block == self.action.feedback:
            goal.feedback.recorded.append(content)
            goal.feedback.compare()
            return
        # Each client of ROS 2 that asks for a result receives it.
        if not goal.has_recorded_result:
            goal.has_recorded_result = True
            goal.result.recorded.append(content)
            goal.result.compare()
        if goal is self._current:
            self._give_up(goal, stamp)
            self.advance(stamp)

    # --- to and from the hardware ----------------------------------------------------------------------------------

    def advance(self, stamp: int) -> bool:
        """Send the hardware the next goals if it has none; return whether a goal was waiting."""
        has_next = self._current is None and bool(self._waiting)
        while self._current is None and self._waiting:
            goal = self._current = self._waiting.popleft()
            payload, goal.payload = goal.payload, b""
            if not self._send(self.action.goal, payload, stamp) and goal is self._current:
                self._give_up(goal, stamp)
        return has_next

    def _give_up(self, goal: _Goal, stamp: int) -> None:
        """Cancel a goal without a result, since the hardware may still process it."""
        self._cancel_current(goal, stamp)
        if goal is self._current:
            self._current = None

    def take(self, sent: Sent) -> None:
        """Take a message that the hardware has sent."""
        block = sent.topic.block
        if block not in (self.action.feedback, self.action.result):
            return
        goal = self._current
        if goal is None:
            self._unasked[block] += 1
            return
        pairs = goal.feedback if block == self.action.feedback else goal.result
        pairs.sent.append(self._sent_content(goal, sent))
        pairs.compare()
        goal.is_accepted = True
        if block == self.action.result:
            self._current = None

    def _sent_content(self, goal: _Goal, sent: Sent) -> _Content:
        try:
            state, rest = self._content(sent.topic.block, sent.payload)
        except (CodecError, ValueError):
            return None, sent.payload
        if state is State.REJECTED:
            # If the hardware rejects a goal that the node has already accepted, the node reports it as aborted. ROS 2
            # has no result for a rejected goal.
            return (State.ABORTED, rest) if goal.is_accepted else (state, b"" if self.action.ros is not ROS1 else rest)
        return state, rest

    # --- the comparison --------------------------------------------------------------------------------------------

    def _content(self, block: str, payload: bytes) -> _Content:
        """Return the compared part of feedback or a result: the fields that the hardware sends and a node keeps."""
        frame = self._topics[block].frame
        message = decode(frame, payload)
        is_result = block == self.action.result
        state = self._messages.state(payload) if is_result else None
        kept: dict[str, Any] = {name: value for name, value in message.items() if name not in SET_BY_NODE}
        if is_result and self.action.ros is ROS1:
            kept["status"] = {"text": message["status"]["text"]}
        return state, encode_used(frame, completed(frame, kept))

    def counts(self) -> Iterator[tuple[str, Mapping[Verdict, int]]]:
        """Yield the words for feedback and for results, each with its verdicts."""
        for title, block in (("feedback", self.action.feedback), ("results", self.action.result)):
            total = Counter({Verdict.NO_GOAL: self._unasked[block]})
            for goal in self._goals.values():
                pairs = goal.feedback if block == self.action.feedback else goal.result
                total += pairs.total(has_goal=goal.is_in_bag)
            yield title, {verdict: total[verdict] for verdict in Verdict}

    @property
    def unfinished(self) -> str:
        """The fault of a goal without a result from the hardware for which further goals wait, or an empty text."""
        if self._current is None or not self._waiting:
            return ""
        name = self.action.block
        return f"the hardware has no result of a goal of '{name}', so {len(self._waiting)} more were not replayed"
