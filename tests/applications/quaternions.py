"""Bags of unit quaternions, and how far the angles that come back are from those of Python's `math`."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

from tests.runs.replay.replays import payload, read, store_of, write

QUATERNION, POINT = "geometry_msgs/msg/Quaternion", "geometry_msgs/msg/Point"
TOPIC = "/imu/orientation"


def quaternion_bag(path: Path, count: int, seed: int) -> Path:
    """A bag of ROS 1 with random orientations at 100 Hz."""
    chance = random.Random(seed)
    items = []
    for number in range(count):
        parts = [chance.gauss(0, 1) for _ in range(4)]
        length = math.hypot(*parts)
        data = payload("ros1", QUATERNION, *(part / length for part in parts))
        items.append((TOPIC, QUATERNION, 10**18 + number * 10**7, data))
    return write(path, "ros1", items)


def worst_error(quaternions: Path, angles: Path) -> float:
    """The largest error of all angles, rad. Both bags have as many messages with the same stamps."""
    store = store_of("ros1")
    worst = 0.0
    for (_, _, stamp, data), (_, type_, other_stamp, answer) in zip(read(quaternions), read(angles), strict=True):
        assert (stamp, type_) == (other_stamp, POINT)
        found: Any = store.deserialize_ros1(answer, POINT)
        wanted = _angles(store.deserialize_ros1(data, QUATERNION))
        # 3.14... is next to -3.14...
        errors = (math.remainder(a - b, math.tau) for a, b in zip(wanted, (found.x, found.y, found.z), strict=True))
        worst = max(worst, *map(abs, errors))
    return worst


def _angles(q: Any) -> tuple[float, float, float]:
    """Roll, pitch and yaw."""
    return (
        math.atan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x**2 + q.y**2)),
        math.asin(max(-1.0, min(1.0, 2 * (q.w * q.y - q.z * q.x)))),
        math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2)),
    )
