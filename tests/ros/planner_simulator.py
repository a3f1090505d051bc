"""A simulator's end of the pipe before a model of hardware that sends goals, as in planner/planner.yaml.

    python planner_simulator.py patient|eager 1|2 [--width BITS ...]

The patient hardware is that of planner/asking.vhd. The eager one sends a goal for each order at once, and cancels all
goals at the order 0; it tells only results. The rest is that of tests/node/model_simulator.py.
"""

from __future__ import annotations

import heapq
import sys
from collections import deque
from functools import cache
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
from tests.ros.action_simulator import HERE
from tests.ros.planner import model

SUBSCRIBERS = ("order", "count_feedback", "count_result")
PUBLISHERS = ("count_goal", "count_cancel", "told")
# The package, the name and the fields that the hardware uses; those of the action for each version of ROS.
_MESSAGES: dict[str, tuple[str, str, set[Names]]] = {
    "order": ("std_msgs", "UInt32", {("data",)}),
    "told": ("std_msgs", "UInt64", {("data",)}),
}
_OF_ACTION: dict[int, dict[str, tuple[str, str, set[Names]]]] = {
    1: {
        "count_feedback": ("actionlib", "TestActionFeedback", {("feedback", "feedback")}),
        "count_result": ("actionlib", "TestActionResult", {("status", "status"), ("result", "result")}),
        "count_goal": ("actionlib", "TestActionGoal", {("goal", "goal")}),
        "count_cancel": ("actionlib_msgs", "GoalID", set()),
    },
    2: {
        "count_feedback": ("test_msgs", "Fibonacci_FeedbackMessage", {("feedback", "sequence")}),
        "count_result": ("test_msgs", "Fibonacci_GetResult_Response", {("status",), ("result", "sequence")}),
        "count_goal": ("test_msgs", "Fibonacci_SendGoal_Request", {("goal", "order")}),
        "count_cancel": ("action_msgs", "GoalInfo", set()),
    },
}


@cache
def frame(version: int, block: str) -> Frame:
    """The frame of a converter, with the fields that the hardware uses."""
    package, name, used = (_MESSAGES | _OF_ACTION[version])[block]
    library = MessageLibrary(middleware_of(version), [HERE / "arm/msg"])
    return with_names_in_use(frame_of(MessageName(package, name), library.closure(MessageName(package, name))), used)


class PlannerSimulator(model_simulator.Simulator):
    """The patient model; `version` is that of ROS."""

    version = 1
    is_busy = False
    sent = 0

    def __init__(self, *arguments: Any, **values: Any) -> None:
        super().__init__(*arguments, **values)
        self.orders: deque[dict[str, Any]] = deque()

    def take(self, now: int) -> bytes:
        taken = self.waiting.popleft()
        self.begun = self.moved = now
        begin = max(now - self.beats(taken) + 1, 0)
        block = SUBSCRIBERS[taken[0]]
        self.react(now, block, decode(frame(self.version, block), taken[5:]))
        return b"T" + begin.to_bytes(8, "little") + now.to_bytes(8, "little")

    def react(self, now: int, block: str, message: dict[str, Any]) -> None:
        """Answer a message; an order waits for the result of the goal before."""
        if block == "order":
            self.orders.append(message)
        else:
            self.respond(now, block, message)
            self.is_busy = block != "count_result"
        if self.orders and not self.is_busy:
            self.is_busy = True
            self.respond(now, "order", self.orders.popleft())

    def respond(self, now: int, block: str, message: dict[str, Any]) -> None:
        for publisher, answer in model.respond(block, message):
            self.send(now, publisher, answer)

    def send(self, now: int, block: str, message: dict[str, Any]) -> None:
        packed = pack_frame(PUBLISHERS.index(block), encode_used(frame(self.version, block), message))
        self.out_free = max(now + self.latency, self.out_free) + self.beats(packed)
        self.sent += 1
        heapq.heappush(self.events, (self.out_free, self.sent, packed))


class EagerSimulator(PlannerSimulator):
    """Hardware that does not wait for its goals."""

    def react(self, now: int, block: str, message: dict[str, Any]) -> None:
        if block == "order" and message["data"] == 0:
            self.send(now, "count_cancel", model.CANCEL)
        elif block != "count_feedback":
            self.respond(now, block, message)


if __name__ == "__main__":
    kind = {"patient": PlannerSimulator, "eager": EagerSimulator}[sys.argv.pop(1)]
    PlannerSimulator.version = int(sys.argv.pop(1))
    if PlannerSimulator.version == 2:
        model.FIELD, model.CANCEL = "order", {"stamp": {"sec": 0, "nanosec": 0}}
    model_simulator.Simulator = kind  # type: ignore[misc]
    model_simulator.main()
