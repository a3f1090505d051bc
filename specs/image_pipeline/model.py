"""Bit-accurate model of the image pipeline: the response of each accelerator to a message.

It uses NumPy, which rosbags depends on. `gray`, `scaled` and `integral` work on arrays of rows and columns; `respond`
adds the rules of the message: a message that is not an image of the right encoding becomes an empty one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

Message = dict[str, Any]
Pixels = npt.NDArray[np.uint8]

# Scaling keeps 1 of 3 columns and 4 of 9 rows.
COLUMNS = (1, 3)
ROWS = (4, 9)
# The widest image that the integral supports.
MAX_COLUMNS = 2048
# A longer frame_id is truncated.
FRAME_ID_BYTES = 256
_LARGEST_SIZE = 65535


def gray(pixels: Pixels) -> Pixels:
    """An image in rgb8, (rows, columns, 3), as (77 R + 150 G + 29 B + 128) / 256."""
    weighted = pixels.astype(np.uint32) @ np.array([77, 150, 29], np.uint32)
    return ((weighted + 128) >> 8).astype(np.uint8)


def scaled(pixels: Pixels, columns: tuple[int, int] = COLUMNS, rows: tuple[int, int] = ROWS) -> Pixels:
    """The nearest pixels of an image; `columns` and `rows` are pairs (kept, total)."""
    return pixels[_nearest(pixels.shape[0], *rows)][:, _nearest(pixels.shape[1], *columns)]


def _nearest(size: int, out: int, of: int) -> npt.NDArray[np.int64]:
    """The source indices of a dimension's pixels, whose number is rounded up."""
    return np.arange(-(-size * out // of)) * of // out


def integral(pixels: Pixels) -> npt.NDArray[np.uint32]:
    """The sum of all pixels above and to the left of each, itself included, modulo 2**32."""
    return pixels.cumsum(0, dtype=np.uint32).cumsum(1, dtype=np.uint32)


def filtered(
    message: Message,
    encodings: tuple[str, str],
    work: Callable[[Pixels], npt.NDArray[Any]],
    max_columns: int = _LARGEST_SIZE,
) -> Message:
    """Return an accelerator's response to a message; `work` processes its pixels, `encodings` are (input, output).

    The response is empty if the image is not in the encoding, or is larger than the accelerator supports, or if the
    length of its data does not match its height and step.
    """
    height, width, step, data = message["height"], message["width"], message["step"], bytes(message["data"])
    channels = 3 if encodings[0] == "rgb8" else 1
    is_right = (
        message["encoding"] == encodings[0]
        and len(data) == height * step
        and step >= width * channels
        and height <= _LARGEST_SIZE
        and width <= max_columns
    )
    shape = (height, width) if is_right else (0, 0)
    rows = np.frombuffer(data, np.uint8)[: shape[0] * step].reshape(shape[0], step if is_right else 0)
    pixels = rows[:, : shape[1] * channels].reshape((*shape, 3) if channels == 3 else shape)
    result = work(pixels)
    frame_id = message["header"]["frame_id"].encode()[:FRAME_ID_BYTES].decode(errors="surrogateescape")
    return {
        "header": {**message["header"], "frame_id": frame_id},
        "height": result.shape[0],
        "width": result.shape[1],
        "encoding": encodings[1],
        "is_bigendian": 0,
        "step": result.shape[1] * result.itemsize,
        "data": result.astype(result.dtype.newbyteorder("<")).tobytes(),
    }


# The response of each accelerator to a message.
ACCELERATORS: dict[str, Callable[[Message], Message]] = {
    "rgb_to_gray": lambda message: filtered(message, ("rgb8", "mono8"), gray),
    "scale_down": lambda message: filtered(message, ("mono8", "mono8"), scaled),
    "integral_image": lambda message: filtered(message, ("mono8", "32SC1"), integral, MAX_COLUMNS),
}


def respond(subscriber: str, message: Message) -> list[tuple[str, Message]]:
    """The messages that the system publishes when `subscriber` receives `message`."""
    if subscriber != "camera":
        raise ValueError(f"unknown subscriber '{subscriber}', legal: 'camera'")
    gray_image = ACCELERATORS["rgb_to_gray"](message)
    small_image = ACCELERATORS["scale_down"](gray_image)
    # Inputs of an accelerator only matter if it is in software.
    return [
        ("small_in", gray_image),
        ("integral_in", small_image),
        ("sums", ACCELERATORS["integral_image"](small_image)),
    ]
