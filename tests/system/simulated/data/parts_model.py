"""What the system of parts.yaml answers: only the fields that publishers get."""

from __future__ import annotations

from collections import deque
from typing import Any

Message = dict[str, Any]
PARTS: deque[Message] = deque()
OTHERS: deque[Message] = deque()


def respond(subscriber: str, message: Message) -> list[tuple[str, Message]]:
    position, orientation = message["position"], message["orientation"]
    if subscriber == "pose_sub":
        return [("pose_pub", {**message, "position": {**position, "x": position["y"], "y": position["x"]}})]
    if subscriber == "part_sub":
        PARTS.append(position)
        answers = [("turn_pub", {"orientation": orientation}), ("w_pub", {"orientation": {"w": orientation["w"]}})]
    else:
        OTHERS.append(position)
        # What it has no port for does not count.
        answers = [("place_pub", message)]
    if PARTS and OTHERS:
        answers.append(("swapped_pub", {"position": {"x": OTHERS.popleft()["y"], "y": PARTS.popleft()["x"]}}))
    return answers
