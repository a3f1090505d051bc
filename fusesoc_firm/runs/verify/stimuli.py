"""Draw values for any message from its definition: empty, typical and extreme values, and single elements."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain, cycle, islice
from typing import Any

from fusesoc_firm.message import ROS1
from fusesoc_firm.message.middleware import Definitions, Middleware
from fusesoc_firm.message.model import (
    ArrayType,
    FieldType,
    MessageName,
    MessageType,
    PrimitiveType,
    SequenceType,
    StringType,
)

EMPTY, TYPICAL, EXTREME, ONE = "empty", "typical", "extreme", "one"
KINDS = (EMPTY, TYPICAL, EXTREME, ONE)

_INTEGERS = {f"{sign}int{bits}": (sign, bits) for sign in ("", "u") for bits in (8, 16, 32, 64)}
_EXTREME_FLOATS = (0.0, -0.0, float("inf"), float("-inf"), float("nan"))
_LARGEST = {"float32": 3.4028234663852886e38, "float64": 1.7976931348623157e308}
_SMALLEST = {"float32": 1.401298464324817e-45, "float64": 5e-324}
_LETTERS = "ab_/ Z9"
# Two, three and four bytes in UTF-8; the second-to-last character has two UTF-16 units.
_WIDE_LETTERS = "\x00é€語🤖\u200b"
_LONGEST_TEXT = 12
# The variable parts of a message share this number of values, so that a stimulus does not exceed a few kilobytes. A
# part does not reach a bound beyond its share, and nested arrays are short.
_MOST_VALUES = 1000


def kinds(count: int) -> Iterator[str]:
    """Yield the kinds of a message's first `count` stimuli: each kind once, then the random kinds in turn."""
    return islice(chain(KINDS, cycle((TYPICAL, EXTREME))), count)


@dataclass(frozen=True)
class Stimuli:
    """A source of random values for messages.

    A variable part has no elements in an empty value, one element in a value of kind `ONE`, and 1 to `longest` elements
    in a typical value. In an extreme value, variable parts are at their bounds, or have 0 to `longest` elements if
    unbounded. The numbers in an extreme value are the limits of their ranges, NaN or infinite, and the texts contain
    characters of up to four bytes.
    """

    definitions: Definitions
    ros: Middleware
    chance: random.Random
    longest: int = 4
    _sizes: dict[MessageName, int] = field(default_factory=dict, compare=False, repr=False)
    _part_counts: dict[MessageName, int] = field(default_factory=dict, compare=False, repr=False)

    def message(self, name: MessageName, kind: str) -> dict[str, Any]:
        """Return a value of a message, or of `time` in ROS 1, as nested dictionaries."""
        return self._message(name, kind, max(1, _MOST_VALUES // max(1, self._parts(name))))

    def _message(self, name: MessageName, kind: str, most: int) -> dict[str, Any]:
        return {field.name: self._value(field.type, kind, most) for field in self.definitions[name].fields}

    def _value(self, type_: FieldType, kind: str, most: int) -> Any:
        match type_:
            case SequenceType(PrimitiveType(name), bound) if self._is_octet(name):
                return self.chance.randbytes(self._count(bound, kind, most))
            case SequenceType(element, bound):
                count = self._count(bound, kind, most // max(1, self._size(element)))
                return [self._value(element, kind, most // max(1, count)) for _ in range(count)]
            case ArrayType(element, length):
                return [self._value(element, kind, most // max(1, length)) for _ in range(length)]
            case MessageType(name):
                return self._message(name, kind, most)
            case StringType():
                return self._text(type_, kind, most)
            case PrimitiveType("time"):
                return {half: self._number("uint32", kind) for half in ("sec", "nsec")}
            case PrimitiveType("duration"):
                return {half: self._number("int32", kind) for half in ("sec", "nsec")}
            case PrimitiveType(name):
                return self._number(self._plain(name), kind)
        raise AssertionError(type_)

    def _size(self, type_: FieldType) -> int:
        """Return the number of values in a message whose variable parts contain one element each."""
        match type_:
            case SequenceType(element):
                return self._size(element)
            case ArrayType(element, length):
                return length * self._size(element)
            case MessageType(name):
                if name not in self._sizes:
                    self._sizes[name] = sum(self._size(field.type) for field in self.definitions[name].fields)
                return self._sizes[name]
        return 1

    def _parts(self, name: MessageName) -> int:
        """Return the number of variable parts in a message; the parts of an array's elements count once."""
        if name not in self._part_counts:
            types = [field.type for field in self.definitions[name].fields]
            elements = [type_.element if isinstance(type_, ArrayType | SequenceType) else type_ for type_ in types]
            self._part_counts[name] = sum(isinstance(type_, SequenceType) for type_ in types)
            self._part_counts[name] += sum(isinstance(element, StringType) for element in elements)
            self._part_counts[name] += sum(
                self._parts(element.name) for element in elements if isinstance(element, MessageType)
            )
        return self._part_counts[name]

    def _is_octet(self, name: str) -> bool:
        return self._plain(name) == "uint8"

    def _plain(self, name: str) -> str:
        byte = "int8" if self.ros is ROS1 else "uint8"
        return {"byte": byte, "char": "uint8"}.get(name, name)

    def _count(self, bound: int | None, kind: str, most: int) -> int:
        """Return the number of elements to draw for a variable part; one element is always allowed."""
        if kind in (EMPTY, ONE):
            return int(kind == ONE)
        if kind == EXTREME and bound is not None and bound <= most:
            return bound
        # A typical part is not empty, otherwise nested parts deep within arrays would rarely occur. In a giant message,
        # half of the parts are enough.
        fewest = int(kind == TYPICAL and most > 1)
        return self.chance.randint(fewest, max(1, min(self.longest, most, self.longest if bound is None else bound)))

    def _text(self, type_: StringType, kind: str, most: int) -> str:
        """Return a text; the bound of a `string` counts bytes, and the bound of a `wstring` counts UTF-16 units."""
        if kind == EMPTY:
            return ""
        if type_.bound is None and kind != ONE:
            length = self.chance.randint(int(kind == TYPICAL), _LONGEST_TEXT)
        else:
            length = self._count(type_.bound, kind, most)
        encoding, unit = ("utf-16-le", 2) if type_.is_wide else ("utf-8", 1)
        text = ""
        while length > 0:
            wide = (
                "" if kind == TYPICAL else "".join(c for c in _WIDE_LETTERS if len(c.encode(encoding)) <= unit * length)
            )
            letter = self.chance.choice(_LETTERS + wide)
            length -= len(letter.encode(encoding)) // unit
            text += letter
        return text

    def _number(self, name: str, kind: str) -> bool | int | float:
        if name == "bool":
            return kind != EMPTY and self.chance.random() < 0.5
        if name in _INTEGERS:
            sign, bits = _INTEGERS[name]
            low, high = (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
            if kind == EXTREME:
                return self.chance.choice((low, high))
            return 0 if kind == EMPTY else self.chance.randint(low, high)
        if kind == EXTREME:
            ends = (_LARGEST[name], -_LARGEST[name], _SMALLEST[name])
            return self.chance.choice((*_EXTREME_FLOATS, *ends))
        drawn = 0.0 if kind == EMPTY else self.chance.gauss(0, 1) * 10.0 ** self.chance.randint(-30, 30)
        code = "<f" if name == "float32" else "<d"
        return float(struct.unpack(code, struct.pack(code, drawn))[0])
