"""The messages of actions as bytes, in both versions of ROS: ids, states, and the envelopes of feedback and results.

A goal's id is the UUID of ROS 2, or the text of ROS 1. A stamp is in seconds and nanoseconds. Functions that read raise
`ValueError` for a payload that is too short.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterable
from enum import Enum
from typing import NamedTuple, Protocol

Stamp = tuple[int, int]
NO_STAMP: Stamp = (0, 0)

_CDR = b"\0\1\0\0"
_UUID_BYTES = 16
# CDR, UUID; the state of a result is after the CDR header.
_ID = slice(len(_CDR), len(_CDR) + _UUID_BYTES)
_STATE_BYTE = len(_CDR)


class State(Enum):
    """The state of a goal: `WAITING` for the hardware, or after its end."""

    WAITING = "waiting"
    EXECUTING = "executing"
    CANCELING = "canceling"
    SUCCEEDED = "succeeded"
    CANCELED = "canceled"
    ABORTED = "aborted"
    REJECTED = "rejected"
    # The server does not report the end of the hardware's goal.
    LOST = "lost"

    @property
    def has_ended(self) -> bool:
        """Whether the goal has a result."""
        return self not in (State.WAITING, State.EXECUTING, State.CANCELING)


# The states in actionlib_msgs/GoalStatus and action_msgs/GoalStatus, and those with which hardware ends a goal.
_ROS1_STATES = {
    State.EXECUTING: 1,
    State.CANCELING: 6,
    State.SUCCEEDED: 3,
    State.ABORTED: 4,
    State.REJECTED: 5,
    State.LOST: 9,
}
_ROS1_ENDS = {2: State.CANCELED, 3: State.SUCCEEDED, 4: State.ABORTED, 5: State.REJECTED, 8: State.CANCELED}
_ROS1_PENDING, _ROS1_PREEMPTED, _ROS1_RECALLED = 0, 2, 8
_ROS2_STATES = {
    State.WAITING: 1,
    State.EXECUTING: 2,
    State.CANCELING: 3,
    State.SUCCEEDED: 4,
    State.CANCELED: 5,
    State.ABORTED: 6,
    State.REJECTED: 0,
    State.LOST: 0,
}
_ROS2_ENDS = {0: State.REJECTED, 4: State.SUCCEEDED, 5: State.CANCELED, 6: State.ABORTED}


class Reference(NamedTuple):
    """The goal of a message; both values may be zero in a cancellation."""

    id: bytes
    stamp: Stamp

    def means(self, goal: Reference) -> bool:
        """Return whether a cancellation includes a goal: by id, by time, or as one of all."""
        if not any(self.id) and not any(self.stamp):
            return True
        is_named = any(self.id) and goal.id == self.id
        return is_named or (any(self.stamp) and goal.stamp <= self.stamp)


class Status(NamedTuple):
    """The state of a goal for all clients; `was_taken` is set if the hardware has ever received the goal."""

    goal: Reference
    state: State
    was_taken: bool = True
    text: bytes = b""


class Messages(Protocol):
    """The messages of a version of ROS."""

    def goal(self, payload: bytes) -> Reference:
        """Return the id and the stamp of a goal, or of the goal in feedback or a result of ROS 1."""

    def renamed(self, payload: bytes, goal: Reference) -> bytes:
        """Return a goal, feedback or a result of ROS 1 with another id."""

    def cancellation(self, payload: bytes) -> Reference:
        """Return the goals that a cancellation concerns."""

    def cancel(self, goal: Reference) -> bytes:
        """Return the cancellation of one goal, for the hardware."""

    def feedback(self, status: Status, payload: bytes) -> bytes:
        """Return the hardware's feedback, as feedback for a goal."""

    def state(self, payload: bytes) -> State:
        """Return the state in the hardware's result; a state that does not end a goal counts as aborted."""

    def result(self, status: Status, payload: bytes) -> bytes:
        """Return the hardware's result, as the result of a goal."""

    def states(self, goals: Iterable[Status]) -> bytes:
        """Return the states of all goals."""

    def listed(self, payload: bytes) -> set[bytes]:
        """Return the ids of the goals whose states a message contains."""


class Ros1Messages:
    """The messages of actionlib (ROS 1)."""

    def __init__(self, clock: Callable[[], Stamp] | None = None) -> None:
        """Prepare headers with the time of a clock, by default that of this machine."""
        self._clock = clock or now
        self._count = 0

    def goal(self, payload: bytes) -> Reference:
        """Return the id and the stamp of a goal, or of the goal in feedback or a result."""
        return _goal_id(payload, _after_header(payload))[0]

    def renamed(self, payload: bytes, goal: Reference) -> bytes:
        """Return a goal, feedback or a result with another id."""
        place = _after_header(payload)
        return payload[:place] + self.cancel(goal) + payload[_goal_id(payload, place)[1] :]

    def cancellation(self, payload: bytes) -> Reference:
        """Return the goals that a cancellation concerns."""
        return _goal_id(payload, 0)[0]

    def cancel(self, goal: Reference) -> bytes:
        """Return the cancellation of one goal, for the hardware."""
        return struct.pack("<II", *goal.stamp) + _text(goal.id)

    def feedback(self, status: Status, payload: bytes) -> bytes:
        """Return the hardware's feedback, as feedback for a goal."""
        _, _, body = self._parts(payload)
        return self._header() + self._status(status) + body

    def state(self, payload: bytes) -> State:
        """Return the state in the hardware's result; a state that does not end a goal counts as aborted."""
        number, _, _ = self._parts(payload)
        return _ROS1_ENDS.get(number, State.ABORTED)

    def result(self, status: Status, payload: bytes) -> bytes:
        """Return the hardware's result, as the result of a goal."""
        _, text, body = self._parts(payload)
        return self._header() + self._status(status._replace(text=text or status.text)) + body

    def states(self, goals: Iterable[Status]) -> bytes:
        """Return the states of all goals."""
        found = [self._status(status) for status in goals]
        return self._header() + struct.pack("<I", len(found)) + b"".join(found)

    def listed(self, payload: bytes) -> set[bytes]:
        """Return the ids of the goals whose states a message contains."""
        place, found = _after_header(payload) + 4, set()
        for _ in range(_number(payload, place - 4)):
            goal, end = _goal_id(payload, place)
            found.add(goal.id)
            place = _text_at(payload, end + 1)[1]
        return found

    def _header(self) -> bytes:
        self._count += 1
        return struct.pack("<I", self._count & 0xFFFFFFFF) + struct.pack("<II", *self._clock()) + _text(b"")

    def _status(self, status: Status) -> bytes:
        number = _ROS1_STATES.get(status.state, _ROS1_PENDING)
        if status.state is State.CANCELED:
            number = _ROS1_PREEMPTED if status.was_taken else _ROS1_RECALLED
        return self.cancel(status.goal) + bytes([number]) + _text(status.text)

    def _parts(self, payload: bytes) -> tuple[int, bytes, bytes]:
        """Return the state, its text and the following bytes, from feedback or a result."""
        _, place = _goal_id(payload, _after_header(payload))
        text, end = _text_at(payload, place + 1)
        return payload[place], text, payload[end:]


class Ros2Messages:
    """The messages of actions in ROS 2, in CDR."""

    def goal(self, payload: bytes) -> Reference:
        """Return the id of a goal, or of the goal in feedback."""
        return Reference(_uuid(payload), NO_STAMP)

    def renamed(self, payload: bytes, goal: Reference) -> bytes:
        """Return a goal or feedback with another id."""
        _uuid(payload)
        return payload[: _ID.start] + goal.id + payload[_ID.stop :]

    def cancellation(self, payload: bytes) -> Reference:
        """Return the goals that a cancellation concerns."""
        return Reference(_uuid(payload), _numbers("<iI", payload, _ID.stop))

    def cancel(self, goal: Reference) -> bytes:
        """Return the cancellation of one goal, for the hardware."""
        return _CDR + self._info(goal)

    def feedback(self, status: Status, payload: bytes) -> bytes:
        """Return the hardware's feedback, as feedback for a goal."""
        return self.renamed(payload, status.goal)

    def state(self, payload: bytes) -> State:
        """Return the state in the hardware's result; a state that does not end a goal counts as aborted."""
        return _ROS2_ENDS.get(_byte(payload, _STATE_BYTE), State.ABORTED)

    def result(self, status: Status, payload: bytes) -> bytes:
        """Return the hardware's result, as the result of a goal."""
        _byte(payload, _STATE_BYTE)
        return payload[:_STATE_BYTE] + bytes([_ROS2_STATES[status.state]]) + payload[_STATE_BYTE + 1 :]

    def states(self, goals: Iterable[Status]) -> bytes:
        """Return the states of all goals."""
        known, found = [*goals], bytearray()
        for status in known:
            found += status.goal.id
            found += bytes(-len(found) % 4) + struct.pack("<iIb", *status.goal.stamp, _ROS2_STATES[status.state])
        return _CDR + struct.pack("<I", len(known)) + bytes(found)

    def listed(self, payload: bytes) -> set[bytes]:
        """Return the ids of the goals whose states a message contains."""
        place, found = _ID.start + 4, set()
        for _ in range(_number(payload, _ID.start)):
            end = place + _UUID_BYTES
            # Padding and a stamp are before the state.
            state = end + -end % 4 + 8
            _byte(payload, state)
            found.add(payload[place:end])
            place = state + 1
        return found

    def accepted(self, stamp: Stamp | None) -> bytes:
        """Return the response to a goal; without a stamp, it is rejected."""
        return _CDR + struct.pack("<?3xiI", stamp is not None, *(stamp or NO_STAMP))

    def canceling(self, code: int, goals: Iterable[Reference]) -> bytes:
        """Return the response to a cancellation: a return code of action_msgs/CancelGoal, and the goals."""
        found = [self._info(goal) for goal in goals]
        return _CDR + struct.pack("<b3xI", code, len(found)) + b"".join(found)

    def is_accepted(self, payload: bytes) -> bool:
        """Return whether a response to a goal accepts it."""
        return bool(_byte(payload, _STATE_BYTE))

    def request(self, goal: Reference) -> bytes:
        """Return the request for the result of a goal."""
        return _CDR + goal.id

    def is_unknown(self, payload: bytes) -> bool:
        """Return whether a result is that of an unknown goal."""
        return not _byte(payload, _STATE_BYTE)

    def requested(self, payload: bytes) -> bytes:
        """Return the id of the goal whose result a client requests."""
        return _uuid(payload)

    def unknown(self, payload: bytes) -> bytes:
        """Return a result without contents, with the state of an unknown goal."""
        return payload[:_STATE_BYTE] + b"\0" + payload[_STATE_BYTE + 1 :]

    def _info(self, goal: Reference) -> bytes:
        return goal.id + struct.pack("<iI", *goal.stamp)


def now() -> Stamp:
    """Return the current time as a stamp."""
    return divmod(time.time_ns(), 10**9)


def _numbers(form: str, payload: bytes, place: int) -> tuple[int, int]:
    try:
        first, second = struct.unpack_from(form, payload, place)
    except struct.error:
        raise ValueError("the message is too short") from None
    return first, second


def _number(payload: bytes, place: int) -> int:
    _byte(payload, place + 3)
    return int.from_bytes(payload[place : place + 4], "little")


def _byte(payload: bytes, place: int) -> int:
    if place >= len(payload):
        raise ValueError("the message is too short")
    return payload[place]


def _uuid(payload: bytes) -> bytes:
    _byte(payload, _ID.stop - 1)
    return payload[_ID]


def _text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def _text_at(payload: bytes, place: int) -> tuple[bytes, int]:
    """Return a text of ROS 1, and the place after it."""
    begin = place + 4
    end = begin + int.from_bytes(payload[place:begin], "little")
    if end > len(payload) or begin > len(payload):
        raise ValueError("the message is too short")
    return payload[begin:end], end


def _after_header(payload: bytes) -> int:
    """Return the place after a Header of ROS 1: number, stamp, text."""
    return _text_at(payload, 12)[1]


def _goal_id(payload: bytes, place: int) -> tuple[Reference, int]:
    """Return a GoalID of ROS 1 and the place after it, where a byte follows unless the payload ends."""
    stamp = _numbers("<II", payload, place)
    text, end = _text_at(payload, place + 8)
    return Reference(text, stamp), end
