"""Values for any message, drawn from its definition: empty, typical, and extreme ones."""

from __future__ import annotations

import random
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.message.model import (
    ArrayType,
    FieldType,
    MessageDefinition,
    MessageName,
    MessageType,
    PrimitiveType,
    RosVersion,
    SequenceType,
    StringType,
)

EMPTY, TYPICAL, EXTREME = "empty", "typical", "extreme"
KINDS = (EMPTY, TYPICAL, EXTREME)

_INTEGERS = {f"{sign}int{bits}": (sign, bits) for sign in ("", "u") for bits in (8, 16, 32, 64)}
_EXTREME_FLOATS = (0.0, -0.0, float("inf"), float("-inf"), float("nan"))
_LARGEST = {"float32": 3.4028234663852886e38, "float64": 1.7976931348623157e308}
_SMALLEST = {"float32": 1.401298464324817e-45, "float64": 5e-324}
_LETTERS = "ab_/ Z9"
# Two, three and four bytes of UTF-8; the last takes two units of UTF-16.
_WIDE_LETTERS = "\x00é€語🤖\u200b"
_LONGEST_BOUND = 300


@dataclass(frozen=True)
class Stimuli:
    """Draws values. The variable parts of a typical one have up to `longest` elements, of an empty one none."""

    definitions: Mapping[MessageName, MessageDefinition]
    ros: RosVersion
    chance: random.Random
    longest: int = 4

    def message(self, name: MessageName, kind: str) -> dict[str, Any]:
        """A value of a message, or of ROS 1's `time` as dictionaries have it."""
        return {field.name: self._value(field.type, kind) for field in self.definitions[name].fields}

    def _value(self, type_: FieldType, kind: str) -> Any:
        match type_:
            case SequenceType(PrimitiveType(name), bound) if self._is_octet(name):
                return self.chance.randbytes(self._count(bound, kind))
            case SequenceType(element, bound):
                return [self._value(element, kind) for _ in range(self._count(bound, kind))]
            case ArrayType(element, length):
                return [self._value(element, kind) for _ in range(length)]
            case MessageType(name):
                return self.message(name, kind)
            case StringType():
                return self._text(type_, kind)
            case PrimitiveType("time"):
                return {half: self._number("uint32", kind) for half in ("sec", "nsec")}
            case PrimitiveType("duration"):
                return {half: self._number("int32", kind) for half in ("sec", "nsec")}
            case PrimitiveType(name):
                return self._number(self._plain(name), kind)
        raise AssertionError(type_)

    def _is_octet(self, name: str) -> bool:
        return self._plain(name) == "uint8"

    def _plain(self, name: str) -> str:
        byte = "int8" if self.ros is RosVersion.ROS1 else "uint8"
        return {"byte": byte, "char": "uint8"}.get(name, name)

    def _count(self, bound: int | None, kind: str) -> int:
        if kind == EMPTY:
            return 0
        if kind == EXTREME and bound is not None and bound <= _LONGEST_BOUND:
            return bound
        return self.chance.randint(0, self.longest if bound is None else min(bound, self.longest))

    def _text(self, type_: StringType, kind: str) -> str:
        if kind == EMPTY:
            return ""
        length = self.chance.randint(0, 12) if type_.bound is None else self._count(type_.bound, kind)
        letters = _LETTERS if kind == TYPICAL or type_.bound is not None else _LETTERS + _WIDE_LETTERS
        return "".join(self.chance.choices(letters, k=length))

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
