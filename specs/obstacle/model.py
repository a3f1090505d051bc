"""Model of the obstacle alarm, with Python's own comparisons."""

from __future__ import annotations

import math
from typing import Any

Message = dict[str, Any]

NEAR = 0.5


def respond(_: str, message: Message) -> list[tuple[str, Message]]:
    """Whether the distance of a sensor_msgs/Range is near."""
    distance: float = message["range"]
    is_near = distance == -math.inf or (distance >= 0.0 and message["min_range"] <= distance < NEAR)
    return [("alarm", {"data": is_near})]
