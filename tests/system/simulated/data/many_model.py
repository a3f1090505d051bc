"""What the system of many.yaml answers."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field


@dataclass
class Waiting:
    """Messages that wait at the two inputs of `joined`."""

    points: deque[dict[str, float]] = field(default_factory=deque)
    vectors: deque[dict[str, float]] = field(default_factory=deque)


WAITING = Waiting()


def respond(subscriber: str, message: dict[str, float]) -> list[tuple[str, dict[str, float]]]:
    if subscriber == "pose_sub":
        return [("pose_pub", message)]
    answers = []
    if subscriber == "point_sub":
        WAITING.points.append(message)
    else:
        x, y, z = message["x"], message["y"], message["z"]
        WAITING.vectors.append(message)
        answers = [("vector_pub", message), ("rotated_pub", {"x": y, "y": z, "z": x})]
    if WAITING.points and WAITING.vectors:
        point, vector = WAITING.points.popleft(), WAITING.vectors.popleft()
        answers.append(("left_pub", {"x": point["x"], "y": vector["y"], "z": point["z"]}))
        answers.append(("right_pub", {"x": vector["x"], "y": point["y"], "z": vector["z"]}))
    return answers
