"""Signatures, by which two ends of a topic tell that they mean the same message: ROS 1's MD5 sum, ROS 2's RIHS01 hash.

The MD5 sum is that of genmsg 0.6.0 (`compute_md5_text`): of the constants with their values as written, then of the
fields, where a nested message stands as its own sum. The hash is that of REP-2011 and REP-2016 (`RIHS01`): SHA-256 of
the JSON of a type description, which lists the fields of the type and of all types within it, without their constants
and default values.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from typing import Any

from fusesoc_firm.message.model import (
    ArrayType,
    Definitions,
    FieldType,
    InterfaceKind,
    MessageName,
    MessageType,
    PrimitiveType,
    SequenceType,
    StringType,
    nested_message,
)

# type_description_interfaces/FieldType. `char` is rosidl_adapter's: it makes an IDL's uint8 of it, never a char.
_TYPE_IDS = {
    "int8": 2,
    "uint8": 3,
    "char": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
}
_NESTED, _STRING, _WIDE_STRING, _BOUNDED_STRING, _BOUNDED_WIDE_STRING = 1, 17, 18, 21, 22
# What an array adds to the type of its elements.
_ARRAY, _BOUNDED_SEQUENCE, _UNBOUNDED_SEQUENCE = 48, 96, 144

# An IDL has no empty struct, so rosidl_adapter gives it this field.
_ONLY_MEMBER = ("structure_needs_at_least_one_member", PrimitiveType("uint8"))


def signature(name: MessageName, definitions: Definitions, kind: InterfaceKind = InterfaceKind.MESSAGE) -> str:
    """The signature that the definitions' middleware has: `md5` and `rihs01` are those of ROS."""
    return next(iter(definitions.values())).ros.signature(name, definitions, kind)


def md5(name: MessageName, definitions: Definitions, kind: InterfaceKind = InterfaceKind.MESSAGE) -> str:
    """The MD5 sum of a message, service or action of ROS 1: 32 hexadecimal digits.

    `definitions` hold the message, or the messages of the service or action, and all within them (else KeyError). An
    action has no sum of its own; its `...Action` message, which holds the other six, stands for it.
    """

    @cache
    def sum_of(message: MessageName) -> str:
        return _md5_of(text_of(message))

    def text_of(message: MessageName) -> str:
        definition = definitions[message]
        lines = [f"{constant.type} {constant.name}={constant.text}" for constant in definition.constants]
        for field in definition.fields:
            # A nested message's sum stands without the brackets of an array.
            nested = nested_message(field.type)
            lines.append(f"{sum_of(nested) if nested else field.type} {field.name}")
        return "\n".join(lines)

    suffixes = {
        InterfaceKind.MESSAGE: ("",),
        InterfaceKind.SERVICE: ("Request", "Response"),  # one behind the other, without a line end between them
        InterfaceKind.ACTION: ("Action",),
    }
    return _md5_of("".join(text_of(_suffixed(name, suffix)) for suffix in suffixes[kind]))


def _md5_of(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def rihs01(name: MessageName, definitions: Definitions, kind: InterfaceKind = InterfaceKind.MESSAGE) -> str:
    """The hash of a message, service or action of ROS 2: `RIHS01_` and 64 hexadecimal digits.

    `definitions` hold the message, or the messages of the service or action, and all within them (else KeyError).
    """
    describer = _Describer(definitions)
    match kind:
        case InterfaceKind.MESSAGE:
            top = describer.message(name)
        case InterfaceKind.SERVICE:
            top = describer.service(name, kind)
        case InterfaceKind.ACTION:
            top = describer.action(name)
    described = describer.descriptions
    description = {
        "type_description": described[top],
        "referenced_type_descriptions": [described[other] for other in sorted(described) if other != top],
    }
    # The order of keys and the blanks behind ',' and ':' belong to the standard; they are json's own.
    return f"RIHS01_{hashlib.sha256(json.dumps(description).encode()).hexdigest()}"


class _Describer:
    """Describes a type and all types within it; every method gives the full name of what it described."""

    def __init__(self, definitions: Definitions) -> None:
        self.descriptions: dict[str, dict[str, Any]] = {}
        self._definitions = definitions

    def message(self, name: MessageName) -> str:
        definition = self._definitions[name]
        full_name = _full_name(name, definition.kind)
        if full_name not in self.descriptions:
            members = [(field.name, field.type) for field in definition.fields] or [_ONLY_MEMBER]
            self._describe(full_name, [self._field(member, kind) for member, kind in members])
        return full_name

    def service(self, name: MessageName, kind: InterfaceKind) -> str:
        """A service, or (by `kind`) one of the two that an action is made of."""
        members = {
            "request_message": self.message(_suffixed(name, "_Request")),
            "response_message": self.message(_suffixed(name, "_Response")),
            "event_message": self.message(_suffixed(name, "_Event")),
        }
        return self._interface(_full_name(name, kind), members)

    def action(self, name: MessageName) -> str:
        kind = InterfaceKind.ACTION
        members = {
            "goal": self.message(_suffixed(name, "_Goal")),
            "result": self.message(_suffixed(name, "_Result")),
            "feedback": self.message(_suffixed(name, "_Feedback")),
            "send_goal_service": self.service(_suffixed(name, "_SendGoal"), kind),
            "get_result_service": self.service(_suffixed(name, "_GetResult"), kind),
            "feedback_message": self.message(_suffixed(name, "_FeedbackMessage")),
        }
        return self._interface(_full_name(name, kind), members)

    def _interface(self, full_name: str, members: Mapping[str, str]) -> str:
        self._describe(full_name, [_described_field(member, _NESTED, nested) for member, nested in members.items()])
        return full_name

    def _describe(self, full_name: str, fields: list[dict[str, Any]]) -> None:
        self.descriptions[full_name] = {"type_name": full_name, "fields": fields}

    def _field(self, name: str, kind: FieldType) -> dict[str, Any]:
        element, increment, capacity = _array_of(kind)
        if isinstance(element, MessageType):
            return _described_field(name, increment + _NESTED, self.message(element.name), capacity)
        if isinstance(element, StringType):
            return _described_field(name, increment + _string_id(element), "", capacity, element.bound or 0)
        return _described_field(name, increment + _TYPE_IDS[element.name], "", capacity)


def _described_field(
    name: str, type_id: int, nested: str, capacity: int = 0, string_capacity: int = 0
) -> dict[str, Any]:
    kind = {
        "type_id": type_id,
        "capacity": capacity,
        "string_capacity": string_capacity,
        "nested_type_name": nested,
    }
    return {"name": name, "type": kind}


def _array_of(kind: FieldType) -> tuple[PrimitiveType | StringType | MessageType, int, int]:
    """The element of a type, what an array adds to the element's type id, and the array's size or bound."""
    if isinstance(kind, ArrayType):
        return kind.element, _ARRAY, kind.length
    if isinstance(kind, SequenceType):
        return kind.element, _UNBOUNDED_SEQUENCE if kind.bound is None else _BOUNDED_SEQUENCE, kind.bound or 0
    return kind, 0, 0


def _string_id(kind: StringType) -> int:
    if kind.bound is None:
        return _WIDE_STRING if kind.is_wide else _STRING
    return _BOUNDED_WIDE_STRING if kind.is_wide else _BOUNDED_STRING


def _full_name(name: MessageName, kind: InterfaceKind) -> str:
    return f"{name.package}/{kind}/{name.name}"


def _suffixed(name: MessageName, suffix: str) -> MessageName:
    return MessageName(name.package, f"{name.name}{suffix}")
