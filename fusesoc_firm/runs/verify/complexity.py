"""Measure messages: the dissertation's levels (figure 5.7), and fields, types and depth (figures 5.8 to 5.10)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

from fusesoc_firm.message.middleware import Definitions
from fusesoc_firm.message.model import ArrayType, FieldType, MessageName, MessageType, SequenceType, StringType


class Level(IntEnum):
    """The most complex kind of element in a message; each level includes the lower levels."""

    SIMPLE = 1
    """Single numbers."""
    EXPANDING = 2
    """Arrays of fixed size and nested messages, which unfold into simple elements."""
    ARRAYS = 3
    """Strings and variable arrays of numbers."""
    VARIABLE_SUBMESSAGES = 4
    """Variable arrays of messages, and arrays of strings."""


@dataclass(frozen=True)
class Statistics:
    """The measures of a message.

    `fields` counts the leaves with all messages unfolded; an array counts once. `types` counts the distinct types
    among all fields, including messages and the elements of arrays. `depth` is 1 for a message without nested messages.
    """

    level: Level
    fields: int
    types: int
    depth: int


def statistics(name: MessageName, definitions: Definitions) -> Statistics:
    """Return the measures of a message."""
    return Statistics(
        level=_level(name, definitions),
        fields=_fields(name, definitions),
        types=len(set(_types(name, definitions))),
        depth=_depth(name, definitions),
    )


def _element(type_: FieldType) -> FieldType:
    return type_.element if isinstance(type_, ArrayType | SequenceType) else type_


def _nested(name: MessageName, definitions: Definitions) -> Iterator[MessageName]:
    """Yield the message type of each field that contains a message."""
    for field in definitions[name].fields:
        element = _element(field.type)
        if isinstance(element, MessageType):
            yield element.name


def _level(name: MessageName, definitions: Definitions) -> Level:
    return max((_level_of(field.type, definitions) for field in definitions[name].fields), default=Level.SIMPLE)


def _level_of(type_: FieldType, definitions: Definitions) -> Level:
    element = _element(type_)
    match type_:
        case SequenceType():
            return Level.VARIABLE_SUBMESSAGES if isinstance(element, MessageType | StringType) else Level.ARRAYS
        case ArrayType() if isinstance(element, StringType):
            return Level.VARIABLE_SUBMESSAGES
        case StringType():
            return Level.ARRAYS
    if isinstance(element, MessageType):
        return max(Level.EXPANDING, _level(element.name, definitions))
    return Level.EXPANDING if isinstance(type_, ArrayType) else Level.SIMPLE


def _fields(name: MessageName, definitions: Definitions) -> int:
    nested = list(_nested(name, definitions))
    return len(definitions[name].fields) - len(nested) + sum(_fields(inner, definitions) for inner in nested)


def _types(name: MessageName, definitions: Definitions) -> Iterator[FieldType]:
    for field in definitions[name].fields:
        yield _without_bound(_element(field.type))
    for inner in set(_nested(name, definitions)):
        yield from _types(inner, definitions)


def _without_bound(type_: FieldType) -> FieldType:
    return StringType(type_.is_wide) if isinstance(type_, StringType) else type_


def _depth(name: MessageName, definitions: Definitions) -> int:
    return 1 + max((_depth(inner, definitions) for inner in _nested(name, definitions)), default=0)
