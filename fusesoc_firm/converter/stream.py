"""The positions of a frame's bytes on a stream of a given width, and the registers that store the fields.

A subscriber's stream carries the frame without the id. An 8-bit stream starts with the length. On wider streams, the
id's lane (the lowest lane of the first beat) remains, but its content is invalid (docs/explanation/design.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES

# Larger stores are split, since a simulator copies a whole store on each accepted beat; each split costs an enable.
_MOST_BITS = 2048
WIDTHS = (8, 16, 32, 64, 128, 256, 512)


@dataclass(frozen=True)
class Stream:
    """A stream of `width` bits, with one byte in each lane."""

    width: int

    @property
    def lanes(self) -> int:
        """The number of bytes in a beat."""
        return self.width // 8

    @property
    def length_start(self) -> int:
        """The number of bytes before the length on a subscriber's stream."""
        return 0 if self.lanes == 1 else ID_BYTES

    @property
    def payload_start(self) -> int:
        """The number of bytes before the payload on a subscriber's stream."""
        return self.length_start + LENGTH_BYTES

    def beat(self, byte: int) -> int:
        """The beat of a byte, both counted from 0."""
        return byte // self.lanes

    def lane(self, byte: int) -> int:
        """The lane of a byte."""
        return byte % self.lanes


@dataclass(frozen=True)
class Store:
    """A shift register for the bytes of `lanes` in each of `beats`; the first beat's bytes end up in the lowest bits.

    Lanes that hold field bytes in the same beats share a store, so a field costs only registers and wires.
    """

    lanes: tuple[int, ...]
    beats: tuple[int, ...]

    @property
    def bits(self) -> int:
        """The width of the register."""
        return 8 * len(self.lanes) * len(self.beats)

    @property
    def beat_bits(self) -> int:
        """The number of bits that a beat adds."""
        return 8 * len(self.lanes)


def stores_of(stream: Stream, windows: Sequence[tuple[int, int]]) -> list[Store]:
    """The stores for the `windows` of the payload, which are (first, end) offsets."""
    beats: dict[int, list[int]] = {}
    for first, end in windows:
        for byte in range(stream.payload_start + first, stream.payload_start + end):
            beats.setdefault(stream.lane(byte), []).append(stream.beat(byte))
    lanes: dict[tuple[int, ...], list[int]] = {}
    for lane in sorted(beats):
        lanes.setdefault(tuple(beats[lane]), []).append(lane)
    return [
        Store(tuple(found), part)
        for key, found in lanes.items()
        for part in _parts(key, max(1, _MOST_BITS // (8 * len(found))))
    ]


def _parts(beats: tuple[int, ...], most: int) -> Iterator[tuple[int, ...]]:
    for start in range(0, len(beats), most):
        yield beats[start : start + most]


@dataclass(frozen=True)
class StoredBytes:
    """`count` bytes of the payload that are contiguous in store number `store`, starting at bit `low`."""

    store: int
    low: int
    count: int

    @property
    def high(self) -> int:
        """The highest bit."""
        return self.low + 8 * self.count - 1


class StoreMap:
    """Maps bytes of the payload to the stores."""

    def __init__(self, stream: Stream, stores: Sequence[Store]) -> None:
        self._stream = stream
        self._place: dict[tuple[int, int], tuple[int, int]] = {}
        for number, store in enumerate(stores):
            for row, beat in enumerate(store.beats):
                for column, lane in enumerate(store.lanes):
                    self._place[beat, lane] = number, row * store.beat_bits + 8 * column

    def pieces(self, offset: int, count: int) -> list[StoredBytes]:
        """The payload's bytes `offset` to `offset + count - 1`, in order; adjacent bytes in a store are merged."""
        found: list[StoredBytes] = []
        for byte in range(self._stream.payload_start + offset, self._stream.payload_start + offset + count):
            store, low = self._place[self._stream.beat(byte), self._stream.lane(byte)]
            if found and found[-1].store == store and found[-1].high + 1 == low:
                found[-1] = StoredBytes(store, found[-1].low, found[-1].count + 1)
            else:
                found.append(StoredBytes(store, low, 1))
        return found


def ranges(numbers: Sequence[int]) -> list[tuple[int, int]]:
    """Ascending numbers as a pair (first, last) for each run without a gap."""
    found: list[tuple[int, int]] = []
    for number in numbers:
        if found and found[-1][1] + 1 == number:
            found[-1] = (found[-1][0], number)
        else:
            found.append((number, number))
    return found
