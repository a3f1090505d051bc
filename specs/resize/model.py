"""Bit-accurate model of the replica of RobotPerf's a5, with NumPy, which rosbags depends on.

`doubled` works on an array of rows and columns; `respond` adds the rules of the messages: an image that is not in rgb8
becomes an empty one, and the calibration of the camera becomes that of the larger image.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Message = dict[str, Any]
Pixels = npt.NDArray[np.uint8]

# The largest image that is supported.
MAX_COLUMNS = 2048
MAX_ROWS = 32767
CHANNELS = 3
# A longer frame_id is truncated.
FRAME_ID_BYTES = 256


def doubled(pixels: Pixels) -> Pixels:
    """Return an image, (rows, columns, channels), twice as high and wide, interpolated between the pixels' centers.

    Each channel is the exact value of a bilinear interpolation, rounded to the nearest integer, halves up. Outside the
    image, its border is repeated.
    """
    if not pixels.size:
        return np.zeros((2 * pixels.shape[0], 2 * pixels.shape[1], CHANNELS), np.uint8)
    sixteenfold = _between(_between(pixels.astype(np.uint16), 0), 1)
    return ((sixteenfold + 8) >> 4).astype(np.uint8)


def _between(values: npt.NDArray[np.uint16], axis: int) -> npt.NDArray[np.uint16]:
    """Return four times the values a quarter of the way before and after each value along an axis."""
    padding = [(0, 0)] * values.ndim
    padding[axis] = (1, 1)
    wide = np.pad(values, padding, mode="edge")
    count = values.shape[axis]
    before, after = (wide.take(range(first, first + count), axis) for first in (0, 2))
    found = np.stack((3 * values + before, 3 * values + after), axis + 1)
    return found.reshape([2 * size if number == axis else size for number, size in enumerate(values.shape)])


def resized_image(message: Message) -> Message:
    """Return the larger image; it is empty if the image is not in rgb8, too large, or has missing or excess data."""
    height, width, step, data = message["height"], message["width"], message["step"], bytes(message["data"])
    is_right = (
        message["encoding"] == "rgb8"
        and len(data) == height * step
        and step >= width * CHANNELS
        and height <= MAX_ROWS
        and width <= MAX_COLUMNS
    )
    shape = (height, width) if is_right else (0, 0)
    rows = np.frombuffer(data, np.uint8)[: shape[0] * step].reshape(shape[0], step if is_right else 0)
    result = doubled(rows[:, : shape[1] * CHANNELS].reshape((*shape, CHANNELS)))
    frame_id = message["header"]["frame_id"].encode()[:FRAME_ID_BYTES].decode(errors="surrogateescape")
    return {
        "header": {**message["header"], "frame_id": frame_id},
        "height": result.shape[0],
        "width": result.shape[1],
        "encoding": "rgb8",
        "is_bigendian": 0,
        "step": result.shape[1] * CHANNELS,
        "data": result.tobytes(),
    }


def resized_info(message: Message) -> Message:
    """Return the calibration of the larger image: sizes, region, and the rows of K and P in pixels double."""
    k, p = list(message["k"]), list(message["p"])
    roi = message["roi"]
    sizes = {name: _doubled_size(roi[name]) for name in ("x_offset", "y_offset", "height", "width")}
    return {
        **message,
        "height": _doubled_size(message["height"]),
        "width": _doubled_size(message["width"]),
        "k": [2 * value for value in k[:6]] + k[6:],
        "p": [2 * value for value in p[:8]] + p[8:],
        "roi": {**roi, **sizes},
    }


def _doubled_size(size: int) -> int:
    return 2 * size % 2**32


ACCELERATORS = {"resize_image": resized_image}


def respond(subscriber: str, message: Message) -> list[tuple[str, Message]]:
    """Return the messages that the system publishes when `subscriber` receives `message`."""
    if subscriber == "camera":
        return [("resized_image", resized_image(message))]
    if subscriber == "info":
        return [("resized_info", resized_info(message))]
    raise ValueError(f"unknown subscriber '{subscriber}', legal: 'camera', 'info'")
