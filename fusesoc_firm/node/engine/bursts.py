"""Join the bursts from a preemptive Manager into frames (docs/reference/manager.md, 'Bursts').

    joiner = BurstJoiner(publishers=4, width=64)
    for burst in bursts:                    # the bytes between two `tlast` that `tkeep` marks as valid
        if frame := joiner.push(burst):
            deliver(frame.id, frame.payload)
    joiner.close()

Without preemption, each frame is one burst, so the class also supports a Manager without preemption.
`cpp/firm/bursts.hpp` is the C++ version.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES

WIDTHS = (8, 16, 32, 64, 128, 256, 512)
MOST_PUBLISHERS = 256
_HEADER_BYTES = ID_BYTES + LENGTH_BYTES


class BurstError(ValueError):
    """A burst that a Manager never sends; the received part of the burst's frame is dropped."""


class AbortedFrameError(BurstError):
    """The hardware aborted a frame, whose received part is dropped."""


@dataclass(frozen=True)
class JoinedFrame:
    """A complete frame: the id of its publisher and its payload."""

    id: int
    payload: bytes


class BurstJoiner:
    """A joiner of bursts by id, until a frame has the length in its header; each stream needs a separate joiner."""

    def __init__(self, publishers: int, width: int, longest: int | None = None) -> None:
        """Create a joiner for a Manager with `publishers` (1 to 256) and a stream of `width` bits.

        A frame that announces a payload of more than `longest` bytes is rejected as soon as its header is complete,
        before the joiner allocates memory for the payload.
        """
        if not 1 <= publishers <= MOST_PUBLISHERS:
            raise ValueError(f"publishers is {publishers}; legal: 1 to {MOST_PUBLISHERS}")
        _check_width(width)
        self._publishers = publishers
        self._beat_bytes = width // 8
        self._longest = longest
        self._begun: dict[int, bytearray] = {}

    @property
    def unfinished(self) -> tuple[int, ...]:
        """Return the ids of incomplete frames in ascending order."""
        return tuple(sorted(self._begun))

    def push(self, burst: bytes, tid: int | None = None, *, is_aborted: bool = False) -> JoinedFrame | None:
        """Take a burst and return the frame that it completes, if any.

        `tid` is the stream's `tid`, if the transport has one; it must equal the id. `is_aborted` if the burst aborts
        its frame. May raise `BurstError`.
        """
        identifier = self._id(burst, tid)
        begun = self._begun.pop(identifier, None)
        if is_aborted:
            raise AbortedFrameError(f"the frame with id {identifier} was aborted")
        if begun is None:
            frame = bytearray(burst)
        else:
            if len(burst) <= self._beat_bytes:
                raise BurstError(f"the burst that resumes the frame with id {identifier} contains nothing but the id")
            # The first beat of the burst is inserted and not part of the frame; the following bytes stay in their
            # lanes.
            frame = begun
            frame += memoryview(burst)[self._beat_bytes :]
        whole = self._frame_bytes(identifier, frame)
        if whole == len(frame):
            return JoinedFrame(identifier, bytes(memoryview(frame)[_HEADER_BYTES:]))
        if len(burst) % self._beat_bytes:
            raise BurstError(
                f"a burst with id {identifier} ends within a beat: {len(burst)} bytes at {self._beat_bytes} per beat,"
                f" and the frame is incomplete"
            )
        self._begun[identifier] = frame
        return None

    def close(self) -> None:
        """End the stream. Raise `BurstError` if a frame is incomplete."""
        if not self._begun:
            return
        parts = ", ".join(
            f"{len(self._begun[identifier])} bytes with id {identifier}" for identifier in self.unfinished
        )
        self._begun.clear()
        raise BurstError(f"the stream ends within frames: {parts}")

    def _id(self, burst: bytes, tid: int | None) -> int:
        if not burst:
            raise BurstError("the burst is empty")
        identifier = burst[0]
        if identifier >= self._publishers:
            raise BurstError(f"the id is {identifier}, but the publishers are 0 to {self._publishers - 1}")
        if tid is not None and tid != identifier:
            raise BurstError(f"tid is {tid}, but the burst begins with id {identifier}")
        return identifier

    def _frame_bytes(self, identifier: int, frame: bytearray) -> int | None:
        """Return the number of bytes in the whole frame, or None while its header is incomplete."""
        if len(frame) < _HEADER_BYTES:
            return None
        length = int.from_bytes(frame[ID_BYTES:_HEADER_BYTES], "little")
        if self._longest is not None and length > self._longest:
            raise BurstError(
                f"the frame with id {identifier} announces {length} bytes of payload;"
                f" the longest payload has {self._longest} bytes"
            )
        beyond = len(frame) - _HEADER_BYTES - length
        if beyond > 0:
            raise BurstError(f"the frame with id {identifier} is {beyond} bytes longer than its header announces")
        return _HEADER_BYTES + length


def split_frame(frame: bytes, width: int, runs: Iterable[int]) -> list[bytes]:
    """Split a frame into bursts, as the Manager does; `runs` lists the beats in each burst except the last.

    The function serves tests and models of the Manager. The unused bits of an extra beat are zero.
    Raise `ValueError` if a run has no beats, or if the runs have more beats than the frame.
    """
    _check_width(width)
    beat_bytes = width // 8
    bursts: list[bytes] = []
    first = 0
    for beats in runs:
        last = first + beats * beat_bytes
        if beats < 1 or last >= len(frame):
            raise ValueError(f"run {len(bursts)} has {beats} beats; legal: 1 or more, but fewer than remain")
        bursts.append(_burst(frame, first, last, beat_bytes))
        first = last
    return [*bursts, _burst(frame, first, len(frame), beat_bytes)]


def _burst(frame: bytes, first: int, last: int, beat_bytes: int) -> bytes:
    inserted = frame[:ID_BYTES].ljust(beat_bytes, b"\0") if first else b""
    return inserted + frame[first:last]


def _check_width(width: int) -> None:
    if width not in WIDTHS:
        raise ValueError(f"width is {width}; legal: {', '.join(map(str, WIDTHS))}")
