"""Compute signatures, which the two ends of a topic compare: the MD5 sum in ROS 1, the RIHS01 hash in ROS 2.

The MD5 sum follows genmsg 0.6.0 (`compute_md5_text`). The sum covers the constants, with their values as written, then
the fields; each nested message is represented by its own sum. The hash follows REP-2011 and REP-2016 (`RIHS01`):
SHA-256 of the JSON of a type description, which lists the fields of the type and of all nested types, without constants
and default values.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from typing import Any

from fusesoc_firm.message.middleware import Definitions
from fusesoc_firm.message.model import (
    ArrayType,
    FieldType,
    InterfaceKind,
    MessageName,
    MessageType,
    PrimitiveType,
    SequenceType,
    StringType,
    nested_message,
)

# Source: type_description_interfaces/FieldType. rosidl_adapter converts `char` to an IDL uint8; only the `char` of an
# `.idl` file is a character.
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
_CHARACTER = 13
_NESTED, _STRING, _WIDE_STRING, _BOUNDED_STRING, _BOUNDED_WIDE_STRING = 1, 17, 18, 21, 22
# The offsets that arrays add to the type ids of their elements.
_ARRAY, _BOUNDED_SEQUENCE, _UNBOUNDED_SEQUENCE = 48, 96, 144

# A struct in IDL cannot be empty, so rosidl_adapter adds this field to a message without fields.
ONLY_MEMBER = ("structure_needs_at_least_one_member", PrimitiveType("uint8"))


def signature(name: MessageName, definitions: Definitions, kind: InterfaceKind = InterfaceKind.MESSAGE) -> str:
    """Return the signature that the definitions' middleware defines; for ROS, see `md5` and `rihs01`."""
    return next(iter(definitions.values())).ros.signature(name, definitions, kind)


def md5(name: MessageName, definitions: Definitions, kind: InterfaceKind = InterfaceKind.MESSAGE) -> str:
    """Return the MD5 sum of a ROS 1 message, service or action: 32 hexadecimal digits.

    `definitions` must contain the message, or the messages of the service or action, and all nested messages. Raise
    `KeyError` if one is missing. ROS 1 defines no sum for an action; the result is then the sum of the `...Action`
    message, which contains the other six messages.
    """

    @cache
    def sum_of(message: MessageName) -> str:
        return _md5_of(text_of(message))

    def text_of(message: MessageName) -> str:
        definition = definitions[message]
        lines = [f"{constant.type} {constant.name}={constant.text}" for constant in definition.constants]
        for field in definition.fields:
            # The sum of a nested message omits an array's brackets.
            nested = nested_message(field.type)
            lines.append(f"{sum_of(nested) if nested else field.type} {field.name}")
        return "\n".join(lines)

    suffixes = {
        InterfaceKind.MESSAGE: ("",),
        InterfaceKind.SERVICE: ("Request", "Response"),  # concatenated without a line end
        InterfaceKind.ACTION: ("Action",),
    }
    return _md5_of("".join(text_of(_suffixed(name, suffix)) for suffix in suffixes[kind]))


def _md5_of(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def rihs01(name: MessageName, definitions: Definitions, kind: InterfaceKind = InterfaceKind.MESSAGE) -> str:
    """Return the hash of a ROS 2 message, service or action: `RIHS01_` and 64 hexadecimal digits.

    With the kind of an action, `name` may also be one of its services, such as `Fibonacci_SendGoal`.
    `definitions` must contain the message, or the messages of the service or action, and all nested messages. Raise
    `KeyError` if one is missing.
    """
    describer = _Describer(definitions)
    match kind:
        case InterfaceKind.MESSAGE:
            top = describer.message(name)
        case InterfaceKind.SERVICE:
            top = describer.service(name, kind)
        case InterfaceKind.ACTION:
            is_service = _suffixed(name, "_Request") in definitions
            top = describer.service(name, kind) if is_service else describer.action(name)
    described = describer.descriptions
    description = {
        "type_description": described[top],
        "referenced_type_descriptions": [described[other] for other in sorted(described) if other != top],
    }
    # The standard prescribes the order of keys and the blanks after ',' and ':', which are json's defaults.
    return f"RIHS01_{hashlib.sha256(json.dumps(description).encode()).hexdigest()}"


class _Describer:
    """A description of a type and its nested types; each method adds a type and returns its full name."""

    def __init__(self, definitions: Definitions) -> None:
        self.descriptions: dict[str, dict[str, Any]] = {}
        self._definitions = definitions

    def message(self, name: MessageName) -> str:
        definition = self._definitions[name]
        full_name = _full_name(name, definition.kind)
        if full_name not in self.descriptions:
            members = [(field.name, field.type) for field in definition.fields] or [ONLY_MEMBER]
            self._describe(full_name, [self._field(member, kind) for member, kind in members])
        return full_name

    def service(self, name: MessageName, kind: InterfaceKind) -> str:
        """Describe a service or, depending on `kind`, one of the two services of an action."""
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
        type_id = _CHARACTER if element.is_character else _TYPE_IDS[element.name]
        return _described_field(name, increment + type_id, "", capacity)


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
    """Return a type's element, the array's offset to the element's type id, and the array's size or bound."""
    if isinstance(kind, ArrayType):
        return kind.element, _ARRAY, kind.length
    if isinstance(kind, SequenceType):
        bound = kind.bound
        if bound is None and isinstance(kind.element, StringType) and kind.element.is_wide:
            # rosidl_parser takes the bound of a wide string for that of the sequence around it.
            bound = kind.element.bound
        return kind.element, _UNBOUNDED_SEQUENCE if bound is None else _BOUNDED_SEQUENCE, bound or 0
    return kind, 0, 0


def _string_id(kind: StringType) -> int:
    if kind.bound is None:
        return _WIDE_STRING if kind.is_wide else _STRING
    return _BOUNDED_WIDE_STRING if kind.is_wide else _BOUNDED_STRING


def _full_name(name: MessageName, kind: InterfaceKind) -> str:
    return f"{name.package}/{kind}/{name.name}"


def _suffixed(name: MessageName, suffix: str) -> MessageName:
    return MessageName(name.package, f"{name.name}{suffix}")
