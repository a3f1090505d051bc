"""Roll, pitch and yaw of a quaternion, by the formulas of textbooks."""

import math


def quat2euler_python(q):
    """Return roll, pitch and yaw in rad as x, y and z for a unit quaternion."""
    roll = math.atan2(2.0 * (q.w * q.x + q.y * q.z), 1.0 - 2.0 * (q.x**2 + q.y**2))
    sine = max(min(2.0 * (q.w * q.y - q.z * q.x), 1.0), -1.0)
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
    return {"x": roll, "y": math.asin(sine), "z": yaw}
