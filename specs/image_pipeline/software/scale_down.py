"""The accelerator `scale_down` in software: NumPy code equivalent to rtl/scale_down.vhd."""

from __future__ import annotations

from typing import Any

import numpy as np

Message = dict[str, Any]

# (kept, total)
COLUMNS = (1, 3)
ROWS = (4, 9)
FRAME_ID_BYTES = 256


def scale_down(message: Message) -> Message:
    """Return the nearest pixels of an image in `mono8`; any other message gives an empty image."""
    height, width, step = message["height"], message["width"], message["step"]
    data = np.frombuffer(message["data"], np.uint8)
    if message["encoding"] != "mono8" or data.size != height * step or not width <= step or max(height, width) > 65535:
        height = width = step = 0
        data = data[:0]
    pixels = data.reshape(height, step)[:, :width][_kept(height, ROWS)][:, _kept(width, COLUMNS)]
    header = message["header"]
    return {
        "header": {**header, "frame_id": header["frame_id"].encode()[:FRAME_ID_BYTES].decode(errors="surrogateescape")},
        "height": pixels.shape[0],
        "width": pixels.shape[1],
        "encoding": "mono8",
        "is_bigendian": 0,
        "step": pixels.shape[1],
        "data": pixels.tobytes(),
    }


def _kept(size: int, ratio: tuple[int, int]) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """The kept rows or columns; their number is rounded up."""
    out, of = ratio
    return np.arange((size * out + of - 1) // of) * of // out
