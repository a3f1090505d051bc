"""A message as a tree for people: every field with its type, its bits and where it lies in the payload."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from fusesoc_firm.frame.model import Frame, FrameField
from fusesoc_firm.message.model import ArrayType, MessageDefinition, MessageName, MessageType, SequenceType


@dataclass(frozen=True)
class Row:
    """A line of the tree; `bits` and `offset` (bytes from the payload's start) are None where they are not fixed."""

    depth: int
    name: str
    type: str
    bits: int | None = None
    offset: int | None = None


def rows(name: MessageName, definitions: Mapping[MessageName, MessageDefinition], frame: Frame | None) -> Iterator[Row]:
    """The rows of a message, outer ones first; `frame` is None for a message of variable size."""
    leaves = list(frame.fields) if frame else []
    yield Row(
        0,
        str(name),
        f"ROS {int(definitions[name].ros)}",
        8 * frame.payload_bytes if frame else None,
        0 if frame else None,
    )
    yield from _fields(definitions[name], definitions, (), leaves)


def text(found: Iterator[Row]) -> str:
    """The rows in columns."""
    table = [("field", "type", "bits", "offset")]
    for row in found:
        bits, offset = (("" if value is None else str(value)) for value in (row.bits, row.offset))
        table.append(("  " * row.depth + row.name, row.type, bits, offset))
    widths = [max(len(line[column]) for line in table) for column in range(4)]
    return "\n".join(
        f"{name:{widths[0]}}  {type_:{widths[1]}}  {bits:>{widths[2]}}  {offset:>{widths[3]}}".rstrip()
        for name, type_, bits, offset in table
    )


def _fields(
    definition: MessageDefinition,
    definitions: Mapping[MessageName, MessageDefinition],
    path: tuple[str, ...],
    leaves: list[FrameField],
) -> Iterator[Row]:
    for field in definition.fields:
        here = (*path, field.name)
        below = [leaf for leaf in leaves if leaf.names[: len(here)] == here]
        offsets = [run.offset for leaf in below for run in leaf.runs]
        bits = sum(8 * run.count * leaf.type.size for leaf in below for run in leaf.runs)
        yield Row(len(here), field.name, str(field.type), bits if offsets else None, min(offsets, default=None))
        element = field.type.element if isinstance(field.type, ArrayType | SequenceType) else field.type
        if isinstance(element, MessageType):
            yield from _fields(definitions[element.name], definitions, here, below)
