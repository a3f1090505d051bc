"""The mapping between bits of a port and bytes of the payload."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from fusesoc_firm.converter.ports import FieldPort
from fusesoc_firm.converter.vhdl import bit, bits
from fusesoc_firm.frame.model import FrameField


@dataclass(frozen=True)
class Slice:
    """`width` bits of a port from bit `low`, and the payload bytes that contain them: `bytes` bytes from `offset`.

    A bool is one bit of the port and one byte of the payload. All other types have 8 bits in each byte.
    """

    port: FieldPort
    low: int
    width: int
    offset: int
    bytes: int

    @property
    def high(self) -> int:
        """The highest bit of the slice."""
        return self.low + self.width - 1

    @property
    def is_bit(self) -> bool:
        """Whether the slice is a bool."""
        return self.port.field.type.bits == 1

    @property
    def target(self) -> str:
        """The slice in VHDL: the whole port or a part of it."""
        if self.port.width is None or (self.width == self.port.width and not self.is_bit):
            return self.port.name
        return bit(self.port.name, self.low) if self.is_bit else bits(self.port.name, self.high, self.low)


def slices_of(port: FieldPort) -> Iterator[Slice]:
    """Yield the slices of a port that are contiguous in the payload, lowest bits first."""
    type_ = port.field.type
    low = 0
    for run in port.field.runs:
        # Adjacent bools of a port are one byte apart on the wire.
        pieces, elements = (run.count, 1) if type_.bits == 1 else (1, run.count)
        for piece in range(pieces):
            yield Slice(port, low, elements * type_.bits, run.offset + piece * type_.size, elements * type_.size)
            low += elements * type_.bits


def windows_of(fields: Iterable[FrameField]) -> list[tuple[int, int]]:
    """Return the sorted (first, end) ranges of fields in the payload, in bytes; adjacent ranges are merged."""
    windows: list[tuple[int, int]] = []
    for first, end in sorted(
        (run.offset, run.offset + run.count * field.type.size)
        for field in fields
        if field.is_used
        for run in field.runs
    ):
        if windows and windows[-1][1] == first:
            windows[-1] = (windows[-1][0], end)
        else:
            windows.append((first, end))
    return windows
