"""What the action of the tests answers, in both versions of ROS."""

from __future__ import annotations

from typing import Any

HELD = 0x70
goals: list[int] = []


def respond(subscriber: str, message: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The feedback and results that follow a goal or a cancellation."""
    if subscriber.endswith("cancel"):
        return [result(goals.pop(), is_canceled=True, is_first="id" in message)]
    ((field, goal),) = message["goal"].items()
    is_first = field == "goal"
    is_held = goal & HELD == HELD
    steps = [feedback(goal + step, is_first) for step in range(1, (1 if is_held else goal % 4) + 1)]
    if is_held:
        goals.append(goal)
        return steps
    return [*steps, result(goal, is_canceled=False, is_first=is_first)]


def feedback(number: int, is_first: bool) -> tuple[str, dict[str, Any]]:
    """A message of feedback."""
    return "count_feedback", {"feedback": {"feedback": number} if is_first else {"sequence": [number]}}


def result(goal: int, *, is_canceled: bool, is_first: bool) -> tuple[str, dict[str, Any]]:
    """A result with its state."""
    if is_first:
        return "count_result", {"status": {"status": 2 if is_canceled else 3}, "result": {"result": goal}}
    return "count_result", {"status": 5 if is_canceled else 4, "result": {"sequence": [goal]}}
