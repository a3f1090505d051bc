"""A second reference for ROS 2: mcap-ros2-support, an optional package, reads the bytes that rosbags wrote."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib import metadata
from typing import Any

from fusesoc_firm.frame.codec import MessageValue
from fusesoc_firm.message.middleware import Definitions, MessageDefinition
from fusesoc_firm.message.model import ArrayType, FieldType, MessageName, MessageType, PrimitiveType, SequenceType
from fusesoc_firm.runs.verify.definitions import NoJudgementError, joint_text

TITLE = "mcap-ros2-support"
# The package reads `char` as in ROS 1.
_PLAIN = {"byte": "uint8", "char": "uint8"}


@cache
def version() -> str:
    """Return the package's version, or an empty string if the package is not installed."""
    try:
        return metadata.version(TITLE)
    except metadata.PackageNotFoundError:
        return ""


def check(
    name: MessageName,
    definitions: Definitions,
    values: Sequence[MessageValue],
    payloads: Sequence[bytes],
) -> None:
    """Raise `NoJudgementError` unless each payload decodes to its value."""
    from mcap.records import Schema
    from mcap_ros2.decoder import DecoderFactory

    renamed = _renamed(definitions)
    names = dict(zip(definitions, renamed, strict=True))
    text = joint_text(names[name], renamed)
    decode = DecoderFactory().decoder_for("cdr", Schema(1, text.encode(), "ros2msg", str(names[name])))
    assert decode is not None, "it supports cdr and ros2msg"
    for value, payload in zip(values, payloads, strict=True):
        try:
            found = decode(payload)
        except Exception as error:
            raise NoJudgementError(f"{TITLE} rejects the bytes: {type(error).__name__}: {error}") from error
        if not _is_same_message(found, definitions[name], definitions, value):
            raise NoJudgementError(f"{TITLE} reads a different value")


def _renamed(definitions: Definitions) -> dict[MessageName, MessageDefinition]:
    """Return definitions with names that the package accepts: it rejects those of action messages and of IDL."""
    names = {name: MessageName("renamed", f"M{number}") for number, name in enumerate(definitions)}
    return {
        names[name]: replace(
            definition,
            name=names[name],
            fields=tuple(
                replace(field, name=_field_name(number), type=_renamed_type(field.type, names))
                for number, field in enumerate(definition.fields)
            ),
        )
        for name, definition in definitions.items()
    }


def _field_name(number: int) -> str:
    return f"field{number}"


def _renamed_type(type_: FieldType, names: Mapping[MessageName, MessageName]) -> FieldType:
    match type_:
        case ArrayType() | SequenceType():
            element = _renamed_type(type_.element, names)
            assert not isinstance(element, ArrayType | SequenceType)
            return replace(type_, element=element)
        case MessageType(name):
            return MessageType(names[name])
        case PrimitiveType(name):
            return PrimitiveType(_PLAIN.get(name, name))
    return type_


def _is_same_message(found: Any, definition: MessageDefinition, definitions: Definitions, value: MessageValue) -> bool:
    return all(
        _is_same(getattr(found, _field_name(number)), field.type, definitions, value[field.name])
        for number, field in enumerate(definition.fields)
    )


def _is_same(found: Any, type_: FieldType, definitions: Definitions, value: Any) -> bool:
    match type_:
        case MessageType(name):
            return _is_same_message(found, definitions[name], definitions, value)
        case ArrayType(element, _) | SequenceType(element, _):
            return len(found) == len(value) and all(
                _is_same(*pair[:1], element, definitions, pair[1]) for pair in zip(found, value, strict=True)
            )
    if isinstance(value, float) and math.isnan(value):
        return isinstance(found, float) and math.isnan(found)
    return bool(found == value) and (not isinstance(value, float) or math.copysign(1, found) == math.copysign(1, value))
