"""The Frame model: the second stage, a message as bytes on the wire.

A frame is `id` (1 byte) | `length` (uint32, little-endian) | payload. All offsets here count bytes from the
payload's first byte; for ROS 2 that is the first byte of the CDR header.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from typing import Any

from fusesoc_firm.message.model import MessageName, RosVersion

ID_BYTES = 1
LENGTH_BYTES = 4


@dataclass(frozen=True)
class WireType:
    """How an element of a field is sent: its size in bytes and the `struct` code of its value."""

    name: str
    size: int
    code: str

    @property
    def bits(self) -> int:
        """Bits of an element at a converter's port: a bool is one bit there although it is a byte on the wire."""
        return 1 if self.name == "bool" else 8 * self.size


@dataclass(frozen=True)
class Step:
    """One name on the way from a message to a field; `count` is None unless an array of fixed size lies here."""

    name: str
    count: int | None = None


@dataclass(frozen=True)
class Run:
    """Elements of a field that lie without a gap from `offset` on."""

    offset: int
    count: int


@dataclass(frozen=True)
class FrameField:
    """A leaf of the message: every element of it has the same wire type.

    `path` leads from the message to the leaf; an array anywhere on it multiplies the elements, which are
    numbered in wire order. `runs` tell where they lie.
    """

    path: tuple[Step, ...]
    type: WireType
    runs: tuple[Run, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names on the path."""
        return tuple(step.name for step in self.path)

    @property
    def is_array(self) -> bool:
        """Whether an array, be it of one element, lies anywhere on the path."""
        return any(step.count is not None for step in self.path)

    @property
    def count(self) -> int:
        """Elements in all; 1 for a scalar."""
        return prod(step.count for step in self.path if step.count is not None)

    @property
    def offsets(self) -> Iterator[int]:
        """The offset of each element's first byte, element 0 first."""
        for run in self.runs:
            yield from range(run.offset, run.offset + run.count * self.type.size, self.type.size)


@dataclass(frozen=True)
class Frame:
    """The layout of a message of fixed size.

    `prefix` are the constant bytes in front of the first field, `checked_prefix` how many of them a
    receiver compares, `trailing_bytes` how many bytes behind the last field a sender may append.
    """

    message: MessageName
    ros: RosVersion
    prefix: bytes
    checked_prefix: int
    fields: tuple[FrameField, ...]
    payload_bytes: int
    trailing_bytes: int

    @property
    def frame_bytes(self) -> int:
        """Bytes of the whole frame, id and length included."""
        return ID_BYTES + LENGTH_BYTES + self.payload_bytes

    def description(self) -> dict[str, Any]:
        """The frame as plain data, for people and other programs."""
        return {
            "message": str(self.message),
            "ros": int(self.ros),
            "payload_bytes": self.payload_bytes,
            "prefix": self.prefix.hex(),
            "trailing_bytes": self.trailing_bytes,
            "fields": [
                {
                    "path": ".".join(field.names),
                    "type": field.type.name,
                    "count": field.count if field.is_array else None,
                    "runs": [{"offset": run.offset, "count": run.count} for run in field.runs],
                }
                for field in self.fields
            ],
        }
