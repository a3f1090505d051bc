"""The smallest range of a scan."""

import math


def nearest(scan):
    best = math.inf
    for r in scan.ranges:
        if scan.range_min <= r <= scan.range_max and r < best:
            best = r
    return {"data": best}
