"""A scan of eight sectors with the nearest range of each, and the nearest range of all, in one pass."""

import math

import numpy as np

SECTORS = 8
NONE = np.float32(math.inf)


def scan_sectors(scan):
    """Return the scan of sectors, of which each has the angle of its first range in rad, and the nearest range in m."""
    size = (len(scan.ranges) + SECTORS - 1) // SECTORS
    minima = [NONE] * SECTORS
    low, sector, count = NONE, 0, 0
    nearest = NONE
    for r in scan.ranges:
        if scan.range_min <= r <= scan.range_max:
            if r < low:
                low = r
            if r < nearest:
                nearest = r
        minima[sector] = low
        count += 1
        if count == size:
            low, sector, count = NONE, sector + 1, 0
    step = size * scan.angle_increment
    kept = {"header": scan.header, "range_min": scan.range_min, "range_max": scan.range_max}
    angles = {"angle_min": scan.angle_min, "angle_max": scan.angle_max, "angle_increment": step}
    return {**kept, **angles, "ranges": minima}, {"data": nearest}
