"""The bytes of a message's frame in wire order, with their offsets where these are constant."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fusesoc_firm.frame.model import (
    COUNT_BYTES,
    LENGTH_BYTES,
    Data,
    Fixed,
    Frame,
    FrameField,
    Loop,
    Node,
    Pad,
    names_of,
)


@dataclass(frozen=True)
class Part:
    """Successive bytes with one meaning: `size` bytes from `offset`, or None where these differ between messages.

    `depth` counts the arrays of messages or texts whose elements repeat the part. Padding has no `name`.
    """

    name: str
    type: str
    offset: int | None
    size: int | None
    depth: int = 0


def byte_map(frame: Frame, id_bytes: int) -> list[Part]:
    """Return the parts of a frame, from the id to the last byte."""
    parts = [Part("id", "id", 0, id_bytes), Part("length", "uint32", id_bytes, LENGTH_BYTES)]
    walk = _Walk(id_bytes + LENGTH_BYTES, len(frame.prefix))
    parts += walk.parts(frame.nodes)
    if frame.trailing_bytes:
        parts.append(Part("", f"0 to {frame.trailing_bytes} unused bytes", walk.offset, None))
    return parts


class _Walk:
    """A traversal of the nodes of a frame; `offset` is that of the next byte, or None after a variable part."""

    def __init__(self, offset: int, prefix: int) -> None:
        self.offset: int | None = offset
        self._prefix = prefix

    def parts(self, nodes: Sequence[Node], depth: int = 0) -> Iterator[Part]:
        for node in nodes:
            match node:
                case Fixed():
                    yield from self._fixed(node, depth)
                case Pad():
                    yield self._part("", f"padding to {node.alignment} bytes", None, depth)
                case Data():
                    yield self._part(".".join(node.names), "count, uint32", COUNT_BYTES, depth)
                    if node.padding != 0:
                        yield self._part("", "padding, if not empty", None, depth)
                    yield self._part(".".join(node.names), node.ros_type, None, depth)
                case Loop():
                    yield from self._loop(node, depth)

    def _fixed(self, node: Fixed, depth: int) -> Iterator[Part]:
        """Yield the fields of fixed bytes, with the prefix and the padding between them."""
        done = 0
        if self._prefix:
            yield self._part("prefix", "encapsulation", self._prefix, depth)
            done, self._prefix = self._prefix, 0
        for start, name, type_, size in sorted(_runs(node.fields)):
            if start > done:
                yield self._part("", "padding", start - done, depth)
            yield self._part(name, type_, size, depth)
            done = start + size
        if node.size > done:
            yield self._part("", "padding", node.size - done, depth)

    def _loop(self, node: Loop, depth: int) -> Iterator[Part]:
        name = ".".join(node.names)
        if node.count is None:
            yield self._part(name, "count, uint32", COUNT_BYTES, depth)
        yield self._part(name, f"{node.ros_type}, each:", None, depth)
        yield from self.parts(node.body, depth + 1)
        self.offset = None

    def _part(self, name: str, type_: str, size: int | None, depth: int) -> Part:
        part = Part(name, type_, self.offset, size, depth)
        self.offset = None if size is None or self.offset is None else self.offset + size
        return part


def _runs(fields: Sequence[FrameField]) -> Iterator[tuple[int, str, str, int]]:
    """Yield offset, name, type and size of each field's successive elements."""
    for field in fields:
        name, first = ".".join(names_of(field.path)), field.first
        for run in field.runs:
            if field.is_array:
                last = first + run.count - 1
                numbered = f"{name}[{first}]" if last == first else f"{name}[{first}..{last}]"
            else:
                numbered = name
            yield run.offset, numbered, field.type.name, run.count * field.type.size
            first += run.count
