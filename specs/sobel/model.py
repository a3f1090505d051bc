"""Bit-accurate model of the Sobel filter, with NumPy, which rosbags depends on.

`edges` works on an array of rows and columns; `respond` adds the rules of the message: a message that is not an image
in mono8 becomes an empty one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Message = dict[str, Any]
Pixels = npt.NDArray[np.uint8]

# The largest image that is supported.
MAX_COLUMNS = 2048
MAX_ROWS = 65535
# A longer frame_id is truncated.
FRAME_ID_BYTES = 256


def edges(pixels: Pixels) -> Pixels:
    """|Gx| + |Gy|, 255 at most; outside the image, its outermost pixels are repeated."""
    if not pixels.size:
        return pixels
    wide = np.pad(pixels.astype(np.int32), 1, mode="edge")
    smooth = wide[:-2] + 2 * wide[1:-1] + wide[2:]
    difference = wide[2:] - wide[:-2]
    x = smooth[:, 2:] - smooth[:, :-2]
    y = difference[:, :-2] + 2 * difference[:, 1:-1] + difference[:, 2:]
    return np.minimum(abs(x) + abs(y), 255).astype(np.uint8)


def filtered(message: Message) -> Message:
    """The accelerator's response to an image.

    The response is empty if the image is not in mono8, or is larger than the accelerator supports, or if the length of
    its data does not match its height and step.
    """
    height, width, step, data = message["height"], message["width"], message["step"], bytes(message["data"])
    is_right = (
        message["encoding"] == "mono8"
        and len(data) == height * step
        and width <= min(step, MAX_COLUMNS)
        and height <= MAX_ROWS
    )
    if not is_right:
        height = width = step = 0
    result = edges(np.frombuffer(data, np.uint8)[: height * step].reshape(height, step)[:, :width])
    frame_id = message["header"]["frame_id"].encode()[:FRAME_ID_BYTES].decode(errors="surrogateescape")
    return {
        "header": {**message["header"], "frame_id": frame_id},
        "height": height,
        "width": width,
        "encoding": "mono8",
        "is_bigendian": 0,
        "step": width,
        "data": result.tobytes(),
    }


ACCELERATORS = {"sobel": filtered}


def respond(subscriber: str, message: Message) -> list[tuple[str, Message]]:
    """The messages that the system publishes when `subscriber` receives `message`."""
    if subscriber != "camera":
        raise ValueError(f"unknown subscriber '{subscriber}', legal: 'camera'")
    return [("edges", filtered(message))]
