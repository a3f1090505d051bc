"""Frames on a link that carries bytes (UART, SPI): COBS of the frame and its CRC-32, and a zero byte at the end.

    coded = encode(pack_frame(0, payload))

    decoder = LinkDecoder()
    for frame in decoder.push(received):                # whole frames, and None for each broken one
        ...
    decoder.counts                                      # Counts(good=..., broken=...)

A zero byte ends each frame and occurs nowhere else (S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing",
1999). The CRC-32 is that of Ethernet and zlib, lowest byte first. A lost, additional or wrong byte costs the frame in
which it occurs, and the next frame if it was the zero byte between them.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES

_HEADER_BYTES = ID_BYTES + LENGTH_BYTES
_CHECKSUM_BYTES = 4
# The longest block of bytes other than zero. If a block has this size, no zero follows it.
_BLOCK_BYTES = 254
_FULL_BLOCK = _BLOCK_BYTES + 1


@dataclass
class Counts:
    """The frames that a link delivered, and those that it dropped because of their code, length or checksum."""

    good: int = 0
    broken: int = 0


def encode(frame: bytes) -> bytes:
    """Return a frame as it is sent, with its checksum and the zero byte at its end."""
    return _stuffed(frame + zlib.crc32(frame).to_bytes(_CHECKSUM_BYTES, "little")) + b"\0"


class LinkDecoder:
    """Finds the frames in received bytes, and counts broken ones; payloads have at most `longest` bytes.

    Bytes before the first zero byte may be the rest of a frame. They are not counted unless they are a whole frame.
    """

    def __init__(self, longest: int = 2**26) -> None:
        """Begin anywhere in the bytes."""
        # Each full block adds one byte, and the last block one.
        whole = _HEADER_BYTES + longest + _CHECKSUM_BYTES
        self._most = whole + whole // _BLOCK_BYTES + 1
        self._begun = bytearray()
        self._is_synchronised = False
        self.counts = Counts()

    def push(self, data: bytes) -> list[bytes | None]:
        """Return the frames that end within `data`, which follows the data of earlier calls; None is a broken one."""
        *ends, begun = data.split(b"\0")
        frames: list[bytes | None] = []
        for end in ends:
            self._keep(end)
            if self._begun:
                self._end_frame(frames)
            self._is_synchronised = True
        self._keep(begun)
        return frames

    def _keep(self, begun: bytes) -> None:
        """Append to the incomplete coded frame, up to the size that proves it too long."""
        self._begun += begun[: self._most + 1 - len(self._begun)]

    def _end_frame(self, frames: list[bytes | None]) -> None:
        frame = _checked(bytes(self._begun)) if len(self._begun) <= self._most else None
        self._begun.clear()
        if frame is not None:
            self.counts.good += 1
        elif self._is_synchronised:
            self.counts.broken += 1
        else:
            return
        frames.append(frame)


def _stuffed(data: bytes) -> bytes:
    coded = bytearray()
    rows = data.split(b"\0")
    for place, row in enumerate(rows):
        full = len(row) // _BLOCK_BYTES
        for start in range(0, full * _BLOCK_BYTES, _BLOCK_BYTES):
            coded.append(_FULL_BLOCK)
            coded += row[start : start + _BLOCK_BYTES]
        rest = row[full * _BLOCK_BYTES :]
        # At the end of the data, no block need follow a full block.
        if rest or not full or place < len(rows) - 1:
            coded.append(len(rest) + 1)
            coded += rest
    return bytes(coded)


def _checked(coded: bytes) -> bytes | None:
    """Return the frame of a code without zero bytes, or None if code, length or checksum is wrong."""
    data = bytearray()
    place = 0
    while place < len(coded):
        code = coded[place]
        place += code
        if place > len(coded):
            return None
        data += coded[place - code + 1 : place]
        if code != _FULL_BLOCK and place < len(coded):
            data.append(0)
    frame, checksum = bytes(data[:-_CHECKSUM_BYTES]), data[-_CHECKSUM_BYTES:]
    if len(frame) < _HEADER_BYTES or zlib.crc32(frame) != int.from_bytes(checksum, "little"):
        return None
    length = int.from_bytes(frame[ID_BYTES:_HEADER_BYTES], "little")
    return frame if len(frame) == _HEADER_BYTES + length else None
