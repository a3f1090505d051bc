"""The nearest obstacle around a robot, and the nearest ones of eight sectors, in one pass over a scan."""

import math

import numpy as np

SECTORS = 8
NONE = np.float32(math.inf)


def scan_sectors(scan):
    """Return the smallest range and its angle, and the smallest range of each sector, in m and rad."""
    size = (len(scan.ranges) + SECTORS - 1) // SECTORS
    minima = [NONE] * SECTORS
    low, sector, count = NONE, 0, 0
    nearest, place = NONE, 0
    for i, r in enumerate(scan.ranges):
        if scan.range_min <= r <= scan.range_max:
            if r < low:
                low = r
            if r < nearest:
                nearest, place = r, i
        minima[sector] = low
        count += 1
        if count == size:
            low, sector, count = NONE, sector + 1, 0
    angle = scan.angle_min + place * scan.angle_increment
    return {"header": scan.header, "nearest": nearest, "angle": angle, "minima": minima}
