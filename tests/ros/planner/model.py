"""What hardware sends that is a client of an action, in both versions of ROS."""

from __future__ import annotations

from typing import Any

# The field of a goal, and a cancellation; the tests write the names of ROS 2 for the other version.
FIELD = "goal"
CANCEL = {"stamp": {"sec": 0, "nsec": 0}}
HELD = 0x70
FEEDBACK = 0xFF
orders: list[int] = []
canceled: list[int] = []


def respond(subscriber: str, message: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """A goal, a cancellation, or what the hardware tells."""
    if subscriber == "order":
        orders.append(message["data"])
        return [("count_goal", {"goal": {FIELD: orders[-1]}})]
    order = orders[-1]
    if subscriber == "count_feedback":
        found = [told(order, FEEDBACK, number_of(message["feedback"]))]
        if order & HELD == HELD and order not in canceled:
            canceled.append(order)
            found.append(("count_cancel", CANCEL))
        return found
    state = message["status"] if isinstance(message["status"], int) else message["status"]["status"]
    return [told(order, state, number_of(message["result"]))]


def number_of(fields: dict[str, Any]) -> int:
    """The number in feedback or a result, which may have none."""
    (value,) = fields.values()
    return int(value if isinstance(value, int) else next(iter(value), 0))


def told(order: int, kind: int, number: int) -> tuple[str, dict[str, Any]]:
    """What the hardware tells."""
    return "told", {"data": (order & 0xFFFFFF) << 40 | kind << 32 | number & 0xFFFFFFFF}
