"""What a middleware decides about the wire: types, alignment and the bytes around a message.

One `WireRules` value says it all; the layout and the codec ask nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType


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


INTEGER_AND_FLOAT = MappingProxyType(
    {
        name: WireType(name, size, code)
        for name, size, code in (
            ("bool", 1, "?"),
            ("int8", 1, "b"),
            ("uint8", 1, "B"),
            ("int16", 2, "h"),
            ("uint16", 2, "H"),
            ("int32", 4, "i"),
            ("uint32", 4, "I"),
            ("int64", 8, "q"),
            ("uint64", 8, "Q"),
            ("float32", 4, "f"),
            ("float64", 8, "d"),
        )
    }
)

# Texts are UTF-8 and UTF-16; a unit of the latter takes four bytes in ROS 2, as `wchar_t` does on Linux.
CHARACTER = WireType("character", 1, "B")
WIDE_CHARACTER = WireType("wide character", 4, "I")


@dataclass(frozen=True)
class WireRules:
    """The layout rules of one serialisation.

    `scalars` gives the wire type of every primitive of one value; `compounds` the named parts of a primitive
    that is sent as several values (ROS 1's `time`). `max_alignment` is 1 where nothing is aligned; offsets for
    alignment count from behind `prefix`. `empty_bytes` is what a message without fields is sent as,
    `string_terminator` how many zeros close a string and are part of its count (a wstring has none).
    """

    scalars: MappingProxyType[str, WireType]
    compounds: MappingProxyType[str, tuple[tuple[str, WireType], ...]]
    max_alignment: int
    prefix: bytes
    checked_prefix: int
    empty_bytes: int
    string_terminator: int
    trailing_bytes: int

    def alignment(self, size: int) -> int:
        """What the offset of a value of `size` bytes is a multiple of."""
        return min(size, self.max_alignment)
