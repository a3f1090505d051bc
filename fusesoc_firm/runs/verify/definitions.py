"""Definitions as text that every independent serialiser can parse."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from fusesoc_firm.message import ROS2
from fusesoc_firm.message.middleware import Definitions, MessageDefinition
from fusesoc_firm.message.model import (
    ArrayType,
    ElementType,
    Field,
    FieldType,
    MessageName,
    MessageType,
    PrimitiveType,
    SequenceType,
    StringType,
)
from fusesoc_firm.text.diagnostics import SourceRef

_SEPARATOR = "=" * 80
# A message that replaces a wstring, so that arrays of wstrings are possible.
_WIDE = MessageName("firm_wide_msgs", "Wide")
_UNITS = "units"
_PLACE = SourceRef("", 0, 0)


class NoJudgementError(Exception):
    """A reference cannot determine a message's bytes; the text is the reason."""


def plain_text(definition: MessageDefinition) -> str:
    """Return the text of a definition's fields; defaults and constants, which some parsers reject, are never sent."""
    return "".join(f"{field.type} {field.name}\n" for field in definition.fields)


def joint_text(name: MessageName, definitions: Definitions) -> str:
    """Return one text with a message and all nested messages, separated as by the tools of ROS."""
    others = [f"{_SEPARATOR}\nMSG: {other}\n{plain_text(definitions[other])}" for other in definitions if other != name]
    return "\n".join([plain_text(definitions[name]), *others])


def with_wide_arrays(definitions: Definitions) -> dict[MessageName, MessageDefinition]:
    """Return ROS 2 definitions with each wstring replaced by `uint32[]`, an array with one element per UTF-16 unit."""
    field = Field(_UNITS, SequenceType(PrimitiveType("uint32")), _PLACE)
    made = {_WIDE: MessageDefinition(_WIDE, ROS2, (field,), (), _PLACE)}
    for name, definition in definitions.items():
        fields = tuple(replace(field, type=_without_wide(field.type), default=None) for field in definition.fields)
        made[name] = replace(definition, fields=fields)
    return made


def with_wide_units(
    definition: MessageDefinition, definitions: Definitions, value: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a message's value converted to match the definitions from `with_wide_arrays`."""
    return {field.name: _wide_value(field.type, definitions, value[field.name]) for field in definition.fields}


def _without_wide(type_: FieldType) -> FieldType:
    match type_:
        case ArrayType() | SequenceType():
            return replace(type_, element=_element_without_wide(type_.element))
    return _element_without_wide(type_)


def _element_without_wide(type_: ElementType) -> ElementType:
    return MessageType(_WIDE) if isinstance(type_, StringType) and type_.is_wide else type_


def _wide_value(type_: FieldType, definitions: Definitions, value: Any) -> Any:
    match type_:
        case MessageType(name):
            return with_wide_units(definitions[name], definitions, value)
        case ArrayType(MessageType() | StringType() as element) | SequenceType(MessageType() | StringType() as element):
            return [_wide_value(element, definitions, item) for item in value]
        case StringType(is_wide=True):
            units = value.encode("utf-16-le", "surrogatepass")
            return {_UNITS: list(struct.unpack(f"<{len(units) // 2}H", units))}
    return value
