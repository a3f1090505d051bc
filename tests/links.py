"""Links between host and system by implementations of others: the package `cobs`, and zlib's CRC-32."""

from __future__ import annotations

import random
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cobs import cobs

from tests.hdl.frames import Frame

_KINDS = ("lost", "doubled", "flipped")


def coded(frame: bytes) -> bytes:
    """A frame as it is on the link."""
    return bytes(cobs.encode(frame + zlib.crc32(frame).to_bytes(4, "little"))) + b"\0"


def decoded(data: bytes) -> Iterator[bytes | None]:
    """The frames in the bytes of a link; None for a broken one. What follows the last zero is ignored."""
    for row in data.split(b"\0")[:-1]:
        if row:
            yield _decoded(row)


def _decoded(row: bytes) -> bytes | None:
    try:
        whole = cobs.decode(row)
    except cobs.DecodeError:
        return None
    frame = whole[:-4]
    is_whole = len(frame) >= 5 and len(frame) == 5 + int.from_bytes(frame[1:5], "little")
    return frame if is_whole and zlib.crc32(frame).to_bytes(4, "little") == whole[-4:] else None


@dataclass(frozen=True)
class FaultyRow:
    """Bytes of a link with faults: of every three frames, one byte of the first is lost, doubled or changed."""

    frames: Sequence[bytes]
    data: bytes

    def check(self, received: Sequence[bytes]) -> None:
        """Assert that each fault costs at most the frame that it hits and the next one, and that no other is there."""
        left = iter(received)
        found = next(left, None)
        for number, frame in enumerate(self.frames):
            if found == frame:
                found = next(left, None)
            else:
                assert number % 3 < 2 and frame != self.frames[-1], f"frame {number} is lost, two frames after a fault"
        assert found is None, f"no such frame was sent: {found.hex()}"


def right_row(faults: int, longest: int, seed: int) -> FaultyRow:
    """A row of frames with payloads of 4 to `longest` bytes, many of them zero, before the faults; prints the seed."""
    print(f"frames from seed {seed}")
    source = random.Random(seed)
    frames = []
    for number in range(3 * faults + 1):
        # The number tells a frame from all others.
        payload = bytes(source.choices((0, 1, 255, source.randrange(256)), k=source.randint(0, longest - 4)))
        frames.append(Frame(source.randrange(256), number.to_bytes(4, "big") + payload).to_bytes())
    return FaultyRow(frames, b"\0" + b"".join(map(coded, frames)))


def faulty_row(faults: int, longest: int, seed: int) -> FaultyRow:
    """The row of these frames with so many faults."""
    row = right_row(faults, longest, seed)
    source = random.Random(seed + 1)
    pieces = [coded(frame) for frame in row.frames]
    for number in range(0, 3 * faults, 3):
        pieces[number] = _spoiled(pieces[number], source)
    return FaultyRow(row.frames, b"\0" + b"".join(pieces))


def _spoiled(piece: bytes, source: random.Random) -> bytes:
    place = source.randrange(len(piece))
    kind = source.choice(_KINDS)
    inner = {
        "lost": b"",
        "doubled": 2 * piece[place : place + 1],
        "flipped": bytes([piece[place] ^ source.choice([1 << source.randrange(8), source.randrange(1, 256)])]),
    }[kind]
    return piece[:place] + inner + piece[place + 1 :]
