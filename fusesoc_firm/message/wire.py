"""The serialisation rules of a middleware: types, alignment and the bytes around a message.

A single `WireRules` value contains all rules that the layout and the codec need.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class WireType:
    """The serialised form of a field's element: its size in bytes and the `struct` code of its value."""

    name: str
    size: int
    code: str

    @property
    def bits(self) -> int:
        """The width in bits of an element at a converter's port.

        A bool has one bit at a port, but one byte on the wire.
        """
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

# Texts are UTF-8 or UTF-16; a UTF-16 unit takes four bytes in ROS 2, like `wchar_t` on Linux.
CHARACTER = WireType("character", 1, "B")
WIDE_CHARACTER = WireType("wide character", 4, "I")


@dataclass(frozen=True)
class WireRules:
    """The layout rules of a serialisation.

    `scalars` maps each primitive with one value to its wire type; `compounds` lists the named parts of a primitive with
    several values (ROS 1's `time`). `max_alignment` is 1 if values are not aligned; positions for alignment count from
    the end of `prefix`. `empty_bytes` is the serialised form of a message without fields. `string_terminator` is the
    number of zeros that end a string; the count includes them (a wstring has none).
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
        """Return the alignment in bytes of a value of `size` bytes."""
        return min(size, self.max_alignment)
