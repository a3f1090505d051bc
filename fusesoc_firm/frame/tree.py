"""Show a message as a tree: every field with its type, its width in bits and its position in the payload."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fusesoc_firm.frame.model import Fixed, Frame, Pad, all_nodes
from fusesoc_firm.message.middleware import Definitions, MessageDefinition
from fusesoc_firm.message.model import ArrayType, MessageName, MessageType, SequenceType


@dataclass(frozen=True)
class Row:
    """A line of the tree; `bits` and `offset` (bytes from the payload's start) are None if they vary.

    Below an array that is not a fixed part of the payload, `bits` is the width of one element.
    """

    depth: int
    name: str
    type: str
    bits: int | None = None
    offset: int | None = None


def rows(name: MessageName, definitions: Definitions, frame: Frame) -> Iterator[Row]:
    """Yield the rows of a message; a field precedes its nested fields."""
    is_fixed = frame.is_fixed_size
    title = f"{frame.ros.title}"
    yield Row(0, str(name), title, 8 * frame.payload_bytes if is_fixed else None, 0 if is_fixed else None)
    yield from _fields(definitions[name], definitions, (), _leaves(frame))


def text(found: Iterator[Row]) -> str:
    """Return the rows as a text in columns."""
    table = [("field", "type", "bits", "offset")]
    for row in found:
        bits, offset = (("" if value is None else str(value)) for value in (row.bits, row.offset))
        table.append(("  " * row.depth + row.name, row.type, bits, offset))
    widths = [max(len(line[column]) for line in table) for column in range(4)]
    return "\n".join(
        f"{name:{widths[0]}}  {type_:{widths[1]}}  {bits:>{widths[2]}}  {offset:>{widths[3]}}".rstrip()
        for name, type_, bits, offset in table
    )


@dataclass(frozen=True)
class _Leaf:
    """The properties of a leaf; `bits` is None for a variable part."""

    names: tuple[str, ...]
    bits: int | None
    offset: int | None


def _leaves(frame: Frame) -> list[_Leaf]:
    """Return the leaves of a frame; only leaves before the first variable part have an offset."""
    leaves = []
    first = frame.nodes[0] if frame.nodes else None
    for node in all_nodes(frame.nodes):
        if isinstance(node, Fixed):
            for leaf in node.fields:
                offset = min((run.offset for run in leaf.runs), default=None) if node is first else None
                leaves.append(_Leaf(leaf.names, 8 * leaf.held * leaf.type.size, offset))
        elif not isinstance(node, Pad):
            leaves.append(_Leaf(node.names, None, None))
    return leaves


def _fields(
    definition: MessageDefinition,
    definitions: Definitions,
    path: tuple[str, ...],
    leaves: list[_Leaf],
) -> Iterator[Row]:
    by_name: dict[str, list[_Leaf]] = {}
    for leaf in leaves:
        if len(leaf.names) > len(path):
            by_name.setdefault(leaf.names[len(path)], []).append(leaf)
    for field in definition.fields:
        here = (*path, field.name)
        below = by_name.get(field.name, [])
        bits = [leaf.bits for leaf in below]
        known = [bit for bit in bits if bit is not None]
        offset = min((leaf.offset for leaf in below if leaf.offset is not None), default=None)
        yield Row(
            len(here), field.name, str(field.type), sum(known) if any(known) and None not in bits else None, offset
        )
        element = field.type.element if isinstance(field.type, ArrayType | SequenceType) else field.type
        if isinstance(element, MessageType):
            yield from _fields(definitions[element.name], definitions, here, below)
