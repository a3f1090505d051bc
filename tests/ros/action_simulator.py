"""A simulator's end of the pipe before a model of the action in arm/arm.yaml.

    python action_simulator.py 1|2 GATE [--width BITS ...]

A goal g leads to g % 4 messages of feedback, g + 1, g + 2 and so on, and to the result g. If bits 4 to 6 of g are set,
there is one message of feedback, and the result follows a cancellation. Negative goals: see `Goal`; GATE is a file. The
rest is that of tests/node/model_simulator.py.
"""

from __future__ import annotations

import heapq
import sys
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any

from fusesoc_firm.frame.codec import decode, pack_frame
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import Names, with_names_in_use
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.model import MessageName
from tests.node import model_simulator

HERE = Path(__file__).resolve().parent
GOAL, CANCEL = range(2)
FEEDBACK, RESULT = range(2)
HELD = 0x70


class Goal(IntEnum):
    """A rejected frame, a result that rejects the goal, one that aborts it, silence, and a wait until a file exists."""

    REFUSED = -1
    REJECTED = -2
    ABORTED = -3
    SILENT = -4
    GATED = -5


# The states of the results, for each version of ROS: succeeded, canceled, aborted, rejected.
NUMBERS = {1: (3, 2, 4, 5), 2: (4, 5, 6, 0)}


# The messages of ROS 2 in place of those of ROS 1.
_TRANSLATION = [
    ("    maxLength: 4096\n", ""),
    ("middleware: ROS", "middleware: ROS2"),
    ("counter.vhd", "ros2/counter.vhd"),
    ("actionlib/TestActionGoal", "test_msgs/Fibonacci_SendGoal_Request"),
    ("goal.goal", "goal.order"),
    ("actionlib_msgs/GoalID", "action_msgs/GoalInfo"),
    ("actionlib/TestActionFeedback", "test_msgs/Fibonacci_FeedbackMessage"),
    ("feedback.feedback", "feedback.sequence"),
    ("actionlib/TestActionResult", "test_msgs/Fibonacci_GetResult_Response"),
    ("status.status, result.result", "status, result.sequence"),
    ("actionlib/Test", "test_msgs/Fibonacci"),
    ("{goal: {goal:", "{goal: {order:"),
    ('FIELD = "goal"', 'FIELD = "order"'),
    ('"nsec": 0', '"nanosec": 0'),
    ("planning.vhd", "ros2/planning.vhd"),
]


def in_ros2(text: str) -> str:
    """The specification or the stimuli of arm/ for ROS 2."""
    for ours, theirs in _TRANSLATION:
        text = text.replace(ours, theirs)
    return text


@cache
def frames(version: int) -> tuple[Frame, Frame, Frame]:
    """The goal, the feedback and the result, with the fields that the accelerator uses."""
    library = MessageLibrary(middleware_of(version), [HERE / "arm/msg"])
    kinds: list[tuple[str, str, set[Names] | None]] = [
        ("actionlib", "TestActionGoal", None),
        ("actionlib", "TestActionFeedback", {("feedback", "feedback")}),
        ("actionlib", "TestActionResult", {("status", "status"), ("result", "result")}),
    ]
    if version == 2:
        kinds = [
            ("test_msgs", "Fibonacci_SendGoal_Request", None),
            ("test_msgs", "Fibonacci_FeedbackMessage", {("feedback", "sequence")}),
            ("test_msgs", "Fibonacci_GetResult_Response", {("status",), ("result", "sequence")}),
        ]
    found = []
    for package, name, used in kinds:
        frame = frame_of(MessageName(package, name), library.closure(MessageName(package, name)))
        found.append(with_names_in_use(frame, used) if used else frame)
    goal, feedback, result = found
    return goal, feedback, result


def number_of(version: int, payload: bytes) -> int:
    goal: dict[str, Any] = decode(frames(version)[0], payload)["goal"]
    return int(goal["goal" if version == 1 else "order"])


def feedback_of(version: int, value: int) -> bytes:
    fields = {"feedback": value} if version == 1 else {"sequence": [value]}
    return encode_used(frames(version)[1], {"feedback": fields})


def result_of(version: int, state: int, value: int) -> bytes:
    number = NUMBERS[version][state]
    if version == 1:
        return encode_used(frames(1)[2], {"status": {"status": number}, "result": {"result": value}})
    return encode_used(frames(2)[2], {"status": number, "result": {"sequence": [value]}})


class ActionSimulator(model_simulator.Simulator):
    """The model; `version` is that of ROS."""

    version = 1
    gate = model_simulator.Gate(Path())
    held: int | None = None
    sent = 0

    def take(self, now: int) -> bytes:
        frame = self.waiting.popleft()
        self.begun = self.moved = now
        begin = max(now - self.beats(frame) + 1, 0)
        report = b"T" + begin.to_bytes(8, "little") + now.to_bytes(8, "little")
        if frame[0] == CANCEL:
            if self.held is not None:
                self.send(now, RESULT, result_of(self.version, 1, self.held))
            self.held = None
            return report
        number = number_of(self.version, frame[5:])
        if number == Goal.REFUSED:
            return report + b"E\0\0\1" + now.to_bytes(8, "little")
        if number == Goal.SILENT:
            return report
        if number == Goal.GATED:
            self.gate.wait()
        if number == Goal.REJECTED:
            self.send(now, RESULT, result_of(self.version, 3, 0))
        elif number == Goal.ABORTED:
            self.send(now, FEEDBACK, feedback_of(self.version, 0))
            self.send(now, RESULT, result_of(self.version, 2, 7))
        elif number > 0 and number & HELD == HELD:
            self.held = number
            self.send(now, FEEDBACK, feedback_of(self.version, number + 1))
        else:
            for step in range(1, number % 4 + 1):
                self.send(now, FEEDBACK, feedback_of(self.version, number + step))
            self.send(now, RESULT, result_of(self.version, 0, number))
        return report

    def send(self, now: int, publisher: int, payload: bytes) -> None:
        frame = pack_frame(publisher, payload)
        self.out_free = max(now + self.latency, self.out_free) + self.beats(frame)
        self.sent += 1
        heapq.heappush(self.events, (self.out_free, self.sent, frame))


if __name__ == "__main__":
    ActionSimulator.version, ActionSimulator.gate = int(sys.argv.pop(1)), model_simulator.Gate(Path(sys.argv.pop(1)))
    # The first goal is to take no longer than others.
    frames(ActionSimulator.version)
    model_simulator.Simulator = ActionSimulator  # type: ignore[misc]
    model_simulator.main()
