"""Angles of an arm's turning base, shoulder and elbow for a point."""

import math

HEIGHT = 0.12  # of the shoulder above the base, in m
UPPER = 0.25  # from the shoulder to the elbow, in m
LOWER = 0.2  # from the elbow to the tool, in m
SCALE = 1.0 / (2.0 * UPPER * LOWER)


def inverse_kinematics(target):
    """Return the angles in rad for a point in m, or nothing if the arm does not reach it."""
    point = target.point
    across = math.sqrt(point.x**2 + point.y**2)
    up = point.z - HEIGHT
    bend = (across**2 + up**2 - (UPPER**2 + LOWER**2)) * SCALE  # the cosine of the elbow's angle
    if not -1.0 <= bend <= 1.0:
        return None
    side = math.sqrt(1.0 - bend**2)
    base = math.atan2(point.y, point.x)
    shoulder = math.atan2(up, across) - math.atan2(LOWER * side, UPPER + LOWER * bend)
    elbow = math.atan2(side, bend)
    return {"data": [base, shoulder, elbow]}
