"""The usual sizes of large messages, from which a new project without a bag takes its `maxLength`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from fusesoc_firm.message.model import MessageName


class Usual(NamedTuple):
    """The bytes that a message usually needs at most, and an example for users."""

    bytes: int
    example: str


_SIZES: Mapping[MessageName, Usual] = {
    MessageName("sensor_msgs", "Image"): Usual(2**22, "an image of 1280 x 720 pixels of 4 bytes"),
    MessageName("sensor_msgs", "CompressedImage"): Usual(2**20, "a JPEG of 1920 x 1080 pixels"),
    MessageName("sensor_msgs", "PointCloud"): Usual(2**22, "200,000 points"),
    MessageName("sensor_msgs", "PointCloud2"): Usual(2**23, "200,000 points of 32 bytes"),
    MessageName("nav_msgs", "OccupancyGrid"): Usual(2**22, "a map of 2,000 x 2,000 cells"),
}


def usual_size(messages: Iterable[MessageName]) -> Usual | None:
    """Return the usual size of a message that consists of these messages, or None if none of them is large."""
    found = [_SIZES[name] for name in messages if name in _SIZES]
    if not found:
        return None
    return Usual(1 << (sum(item.bytes for item in found) - 1).bit_length(), ", ".join(item.example for item in found))
