"""The goals that the hardware sends to an action of another node, in a replay: the bag replaces their server.

As with a node, the server has one goal of the hardware at a time. Its n-th goal corresponds to the n-th one in the bag,
and causes the recorded feedback and the recorded result.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.frame.defaults import completed, encode_used
from fusesoc_firm.frame.select import with_names_in_use
from fusesoc_firm.message import ROS1
from fusesoc_firm.node.actions.action_messages import (
    Messages,
    Reference,
    Ros1Messages,
    Ros2Messages,
    Stamp,
    State,
    Status,
)
from fusesoc_firm.runs.bags.goals import Told
from fusesoc_firm.runs.replay.goals import SET_BY_NODE, Send, Verdict
from fusesoc_firm.runs.replay.hardware_run import Sent
from fusesoc_firm.system.derived.model import Action, Topic


@dataclass
class _Recorded:
    """A goal of the bag, with the feedback and the result that the hardware has not received yet, by their blocks.

    Messages of different topics are not ordered, so a result may be read before its goal, whose content is then
    unknown. A rejected goal of ROS 2 has a result without payload.
    """

    reference: Reference
    content: bytes | None = None
    told: deque[tuple[str, bytes | None]] = field(default_factory=deque)
    has_result: bool = False
    is_canceled: bool = False

    @property
    def was_canceled(self) -> bool:
        """Whether its client canceled it; a node also cancels goals that it has lost."""
        return self.is_canceled and self.has_result


@dataclass
class _Goal:
    """A goal of the hardware, with its own id, and the corresponding goal in the bag.

    Cancellations refer to the goal as `named`, which always has a time.
    """

    own: Reference
    named: Reference
    content: bytes
    was_sent: bool = False
    is_canceled: bool = False
    recorded: _Recorded | None = None


class SentGoals:
    """The goals of the hardware for one action of another node.

    A recorded message for a goal is sent to the hardware when the message has been read and the server has its goal.
    """

    def __init__(self, action: Action, topics: Mapping[str, Topic], send: Send, ended: Iterable[bytes]) -> None:
        """Prepare an action; `topics` are those of the system by block, `ended` the ids of goals with results."""
        self.action = action
        self._topics = topics
        self._send = send
        self._ended = set(ended)
        self._stamp = 0
        self._messages: Messages = Ros1Messages(self._now) if action.ros is ROS1 else Ros2Messages()
        # The goals of the bag by id, and those without a goal of the hardware.
        self._recorded: dict[bytes, _Recorded] = {}
        self._free: deque[_Recorded] = deque()
        # The goals of the hardware, and the unfinished ones, of which the server has the first.
        self._goals: list[_Goal] = []
        self._open: deque[_Goal] = deque()

    def _now(self) -> Stamp:
        return divmod(self._stamp, 10**9)

    # --- from the bag ----------------------------------------------------------------------------------------------

    def tell(self, told: Told) -> None:
        """Process a message of the bag. Raise `ValueError` or `CodecError` if it is invalid."""
        if told.payload is not None:
            decode(self._topics[told.block].frame, told.payload)
        if told.block == self.action.cancel:
            self._cancel_recorded(self._messages.cancellation(told.owner))
            return
        reference = self._messages.goal(told.owner)
        goal = self._recorded.setdefault(reference.id, _Recorded(reference))
        if told.block == self.action.goal:
            # Clients may send a goal again until its server responds.
            if goal.content is None:
                self._add_recorded(goal, reference, told)
        # Each client of ROS 2 that asks for a result receives it; ROS may deliver feedback after the result.
        elif not goal.has_result:
            goal.has_result = told.block == self.action.result
            goal.told.append((told.block, told.payload))

    def _add_recorded(self, goal: _Recorded, reference: Reference, told: Told) -> None:
        assert told.payload is not None, "only results may be missing"
        goal.reference = _with_time(reference, told.recorded.stamp)
        goal.content = self._content(told.payload)
        self._free.append(goal)

    def _cancel_recorded(self, wanted: Reference) -> None:
        if any(wanted.id):
            goal = self._recorded.setdefault(wanted.id, _Recorded(wanted))
            goal.is_canceled |= not goal.has_result
        if any(wanted.stamp) or not any(wanted.id):
            for goal in self._recorded.values():
                goal.is_canceled |= not goal.has_result and wanted.means(goal.reference)

    # --- from and to the hardware ------------------------------------------------------------------------------------

    def take(self, sent: Sent) -> None:
        """Take a message that the hardware has sent. Raise `ValueError` or `CodecError` if it is invalid."""
        if sent.topic.block == self.action.goal:
            own = self._messages.goal(sent.payload)
            goal = _Goal(own, _with_time(own, sent.cause.stamp), self._content(sent.payload))
            self._goals.append(goal)
            self._open.append(goal)
            self._begin()
        elif sent.topic.block == self.action.cancel:
            wanted = self._messages.cancellation(sent.payload)
            for goal in self._open:
                goal.is_canceled |= wanted.means(goal.named)

    def _begin(self) -> None:
        """Pass the next goal to the server, unless the goal was canceled while it waited."""
        if self._open and not self._open[0].is_canceled:
            self._open[0].was_sent = True

    def advance(self, stamp: int) -> bool:
        """Send the hardware the next due message for its goals; return whether a message was due."""
        if not self._open:
            return False
        self._stamp = stamp
        goal = self._open[0]
        if not goal.was_sent:
            self._end(goal, self._result_of_node(goal, State.CANCELED))
            return True
        if goal.recorded is None:
            goal.recorded = self._free.popleft() if self._free else None
        recorded = goal.recorded
        if recorded and recorded.told:
            self._give(goal, *recorded.told.popleft())
            return True
        if recorded and self._free and recorded.reference.id not in self._ended:
            self._end(goal, self._result_of_node(goal, State.LOST))
            return True
        return False

    def _give(self, goal: _Goal, block: str, payload: bytes | None) -> None:
        if payload is None:
            self._end(goal, self._result_of_node(goal, State.REJECTED))
        elif block == self.action.feedback:
            self._send(block, self._messages.renamed(payload, goal.own), self._stamp)
        else:
            # Results of ROS 2 have no id.
            is_first = self.action.ros is ROS1
            self._end(goal, self._messages.renamed(payload, goal.own) if is_first else payload)

    def _end(self, goal: _Goal, result: bytes) -> None:
        self._open.popleft()
        self._begin()
        self._send(self.action.result, result, self._stamp)

    def _result_of_node(self, goal: _Goal, state: State) -> bytes:
        """Return the empty result that a node creates."""
        frame = self._topics[self.action.result].frame
        nothing = encode_used(with_names_in_use(frame, set()), {})
        return self._messages.result(Status(goal.own, state, goal.was_sent), nothing)

    # --- the comparison --------------------------------------------------------------------------------------------

    def _content(self, payload: bytes) -> bytes:
        """Return the compared part of a goal: the fields that the hardware sends and a node keeps."""
        frame = self._topics[self.action.goal].frame
        kept = {name: value for name, value in decode(frame, payload).items() if name not in SET_BY_NODE}
        return encode_used(frame, completed(frame, kept))

    def counts(self) -> Iterator[tuple[str, Mapping[Verdict, int]]]:
        """Yield the words for goals and for cancellations, each with its verdicts."""
        sent = [goal for goal in self._goals if goal.was_sent]
        # Goals that still wait for the server have no counterpart in the bag.
        waiting = [goal for goal in self._open if not goal.was_sent and not goal.is_canceled]
        goals = Counter(map(_verdict, (*sent, *waiting))) + Counter({Verdict.MISSING: len(self._free)})
        known = (Verdict.EQUAL, Verdict.DIFFERENT, Verdict.MISSING, Verdict.NOT_RECORDED)
        yield "goals", {verdict: goals[verdict] for verdict in known}
        canceled = [goal for goal in sent if goal.is_canceled]
        equal = sum(goal.recorded is not None and goal.recorded.is_canceled for goal in canceled)
        others = [goal.recorded for goal in sent if goal.recorded and not goal.is_canceled]
        missing = sum(goal.was_canceled for goal in (*others, *self._free))
        counts = (equal, missing, len(canceled) - equal)
        yield "cancellations", dict(zip((Verdict.EQUAL, Verdict.MISSING, Verdict.NOT_RECORDED), counts, strict=True))


def ended_goals(results: Iterable[Told], action: Action, topic: Topic) -> set[bytes]:
    """Return the ids of the goals of an action that have a valid result; `topic` is that of the results."""
    messages: Messages = Ros1Messages() if action.ros is ROS1 else Ros2Messages()
    found = set()
    for told in results:
        with suppress(CodecError, ValueError):
            if told.payload is not None:
                decode(topic.frame, told.payload)
            found.add(messages.goal(told.owner).id)
    return found


def _verdict(goal: _Goal) -> Verdict:
    if goal.recorded is None:
        return Verdict.NOT_RECORDED
    return Verdict.EQUAL if goal.content == goal.recorded.content else Verdict.DIFFERENT


def _with_time(goal: Reference, stamp: int) -> Reference:
    """Return a goal with its time or, if missing, the time of a stamp in ns."""
    return goal if any(goal.stamp) else goal._replace(stamp=divmod(stamp, 10**9))
