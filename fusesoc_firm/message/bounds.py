"""Limit the size of messages; the definitions are checked before any further work.

With nesting, a few lines of text can define a huge message. Real messages are far below the limits: the maxima among
5,900 messages are 17 levels, 1,982 fields and 6,049 bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass

from fusesoc_firm.message.middleware import Definitions, MessageDefinition
from fusesoc_firm.message.model import ArrayType, FieldType, MessageName, MessageType, PrimitiveType, SequenceType
from fusesoc_firm.message.wire import WireRules
from fusesoc_firm.text.diagnostics import fail

MOST_LEVELS = 64
MOST_FIELDS = 4096
MOST_CONSTANTS = 4096
MOST_NODES = 16384
MOST_BYTES = 65536
MOST_STREAMED_BYTES = 2**31 - 1
"""The size limit in bytes of an array of fixed size that is a stream: integers in VHDL count its bytes."""
MOST_FILE_BYTES = 2**18
"""The size limit in bytes of a `.msg`, `.srv`, `.action` or `.idl` file."""

_COUNT_BYTES = 4


@dataclass(frozen=True)
class Extent:
    """The size of a message with all nested messages expanded.

    `levels` is 1 for a message without nested messages. `fields` includes the fields of nested messages; an array
    counts once. `nodes` also counts each element of a fixed array, unless the elements are numbers. `bytes` is the size
    of the payload with empty strings and one element in each variable array and in each fixed array that is a stream,
    without padding.
    """

    levels: int = 0
    fields: int = 0
    nodes: int = 0
    bytes: int = 0

    def joined(self, other: Extent) -> Extent:
        """Return the extent of both messages in sequence."""
        return Extent(
            max(self.levels, other.levels),
            self.fields + other.fields,
            self.nodes + other.nodes,
            self.bytes + other.bytes,
        )


# The limits, each with its name in error messages.
_BOUNDS = {
    "levels": (MOST_LEVELS, "levels of nested messages"),
    "fields": (MOST_FIELDS, "fields, including those of nested messages"),
    "nodes": (MOST_NODES, "fields, including those of each element in fixed arrays"),
    "bytes": (MOST_BYTES, "bytes of fixed size"),
}


def is_streamed(type_: ArrayType, rules: WireRules) -> bool:
    """Return whether an array of fixed size is so long that its numbers are a stream, not registers."""
    element = type_.element
    if not isinstance(element, PrimitiveType) or element.name not in rules.scalars:
        return False
    return MOST_BYTES < rules.scalars[element.name].size * type_.length <= MOST_STREAMED_BYTES


def check_extents(definitions: Definitions, known: MutableMapping[MessageName, Extent]) -> None:
    """Raise `InputError` for the first message that is too large, with the place of the field that exceeds the limit.

    `definitions` lists each message after its nested messages. `known` holds the extents of previously checked
    messages; the function adds the new extents to it.
    """
    for name, definition in definitions.items():
        if name not in known:
            known[name] = _extent(definition, known)


def _extent(definition: MessageDefinition, known: Mapping[MessageName, Extent]) -> Extent:
    if len(definition.constants) > MOST_CONSTANTS:
        what = f"'{definition.name}' has {len(definition.constants)} constants"
        fail(what, definition.constants[MOST_CONSTANTS].source, f"legal here: up to {MOST_CONSTANTS}")
    rules = definition.ros.rules
    extent = Extent(levels=1, bytes=0 if definition.fields else rules.empty_bytes)
    for field in definition.fields:
        extent = extent.joined(_of_type(field.type, rules, known))
        for word, (most, words) in _BOUNDS.items():
            found = getattr(extent, word)
            if found > most:
                what = f"field '{field.name}' makes '{definition.name}' too large: {found} {words}"
                fail(what, field.source, f"legal here: up to {most}")
    return extent


def _of_type(type_: FieldType, rules: WireRules, known: Mapping[MessageName, Extent]) -> Extent:
    """Return the extent that a field of this type adds."""
    match type_:
        case PrimitiveType(name) if name in rules.scalars:
            return Extent(0, 1, 1, rules.scalars[name].size)
        case PrimitiveType(name):
            return Extent(0, 1, 1, sum(part.size for _, part in rules.compounds[name]))
        case MessageType(name):
            inner = known[name]
            return Extent(inner.levels + 1, inner.fields + 1, inner.nodes + 1, inner.bytes)
        case ArrayType(element) if is_streamed(type_, rules):
            return _of_type(element, rules, known)
        case ArrayType(element, length):
            one = _of_type(element, rules, known)
            is_of_numbers = isinstance(element, PrimitiveType) and element.name in rules.scalars
            return Extent(one.levels, one.fields, one.nodes * (1 if is_of_numbers else length), one.bytes * length)
        case SequenceType(element):
            return _of_type(element, rules, known).joined(Extent(bytes=_COUNT_BYTES))
    return Extent(0, 1, 1, _COUNT_BYTES)
