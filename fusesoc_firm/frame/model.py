"""The Frame model: the second stage, a message as bytes on the wire.

A frame is `id` (1 byte) | `length` (uint32, little-endian) | payload. The payload is a tree of nodes in wire order;
docs/explanation/frames.md shows it by example:

* `Fixed`: bytes whose arrangement is known here, padding included.
* `Pad`: padding that depends on the position, which only the run knows.
* `Data`: a string, or a variable array of numbers.
* `Loop`: an array whose elements are messages or strings; its body are nodes again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from math import prod

from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import DefaultValue, MessageName
from fusesoc_firm.message.wire import WireType
from fusesoc_firm.text.diagnostics import SourceRef

ID_BYTES = 1
LENGTH_BYTES = 4
COUNT_BYTES = 4


@dataclass(frozen=True)
class Step:
    """One name on the way from a message to a field; `count` is None unless an array of fixed size lies here.

    The elements of a `Loop` are no such array: a path within it counts what one of them holds.
    """

    name: str
    count: int | None = None


Path = tuple[Step, ...]


@dataclass(frozen=True)
class Run:
    """Elements of a field that lie without a gap from `offset` on; it counts from the start of the `Fixed`."""

    offset: int
    count: int


@dataclass(frozen=True)
class FrameField:
    """A leaf of the message: every element of it has the same wire type.

    `path` leads from the message to the leaf; a fixed array anywhere on it multiplies the elements, which are
    numbered in wire order. `runs` tell where they lie. Where a `Pad` parts the elements, each `Fixed` has a field of
    this path for those it holds, the first of them being number `first`.
    """

    path: Path
    type: WireType
    runs: tuple[Run, ...]
    first: int = 0
    default: DefaultValue | None = None
    is_used: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        """The names on the path."""
        return names_of(self.path)

    @property
    def is_array(self) -> bool:
        """Whether a fixed array, be it of one element, lies anywhere on the path."""
        return any(step.count is not None for step in self.path)

    @property
    def count(self) -> int:
        """Elements in all; 1 for a scalar."""
        return prod(step.count for step in self.path if step.count is not None)

    @property
    def held(self) -> int:
        """Elements that lie here: all of them unless a `Pad` parts them."""
        return sum(run.count for run in self.runs)

    @property
    def offsets(self) -> Iterator[int]:
        """The offset of the first byte of each element that lies here, in their order."""
        for run in self.runs:
            yield from range(run.offset, run.offset + run.count * self.type.size, self.type.size)


@dataclass(frozen=True)
class Fixed:
    """`size` bytes that hold `fields` and between them padding; the payload's first one begins with the prefix."""

    size: int
    fields: tuple[FrameField, ...]


@dataclass(frozen=True)
class Pad:
    """0 to `alignment` - 1 bytes, up to a multiple of `alignment` from behind the prefix."""

    alignment: int


class DataKind(Enum):
    """What the elements of a `Data` make up."""

    ARRAY = "array"
    STRING = "string"
    WSTRING = "wstring"


@dataclass(frozen=True)
class Data:
    """A count (uint32), then that many elements: numbers, or the bytes or UTF-16 units of a text.

    The count includes `terminator` bytes of zero behind the text, `bound` does not. Between count and elements, if
    there is any, lie `padding` bytes; None is padding to `alignment` that depends on the position, as a `Pad` does.
    `ros_type` is the field's type as the definition has it.
    """

    path: Path
    kind: DataKind
    element: WireType
    ros_type: str
    bound: int | None
    terminator: int
    alignment: int
    padding: int | None
    default: DefaultValue | None = None
    is_used: bool = True
    source: SourceRef | None = field(default=None, compare=False)

    @property
    def names(self) -> tuple[str, ...]:
        """The names on the path."""
        return names_of(self.path)


@dataclass(frozen=True)
class Loop:
    """An array of messages or strings: `body`, once an element.

    `count` is that of a fixed array, which the wire does not name; where it is None, a count (uint32) of at most
    `bound` comes first. Paths in the body begin with the loop's own.
    """

    path: Path
    ros_type: str
    count: int | None
    bound: int | None
    body: tuple[Node, ...]
    default: DefaultValue | None = None
    is_used: bool = True
    source: SourceRef | None = field(default=None, compare=False)

    @property
    def names(self) -> tuple[str, ...]:
        """The names on the path."""
        return names_of(self.path)


Node = Fixed | Pad | Data | Loop
NameTree = dict[str, "NameTree"]


@dataclass(frozen=True)
class Frame:
    """The layout of a message.

    `prefix` are the constant bytes in front of the first field, `checked_prefix` how many of them a
    receiver compares, `trailing_bytes` how many bytes behind the last field a sender may append.
    """

    message: MessageName
    ros: Middleware
    prefix: bytes
    checked_prefix: int
    nodes: tuple[Node, ...]
    trailing_bytes: int

    @property
    def is_fixed_size(self) -> bool:
        """Whether all of it is one `Fixed`: its offsets are those in the payload."""
        return all(isinstance(node, Fixed) for node in self.nodes)

    @property
    def fields(self) -> tuple[FrameField, ...]:
        """The leaves of a message of fixed size."""
        return tuple(leaf for node in self._fixed_nodes() for leaf in node.fields)

    @property
    def payload_bytes(self) -> int:
        """Bytes of the payload of a message of fixed size."""
        return sum(node.size for node in self._fixed_nodes())

    @property
    def frame_bytes(self) -> int:
        """Bytes of the whole frame of a message of fixed size, id and length included."""
        return ID_BYTES + LENGTH_BYTES + self.payload_bytes

    @cached_property
    def names(self) -> NameTree:
        """The name of every field, with the names below it; a field without any value is left out."""
        tree: NameTree = {}
        for node in all_nodes(self.nodes):
            for part in node.fields if isinstance(node, Fixed) else () if isinstance(node, Pad) else (node,):
                below = tree
                for name in part.names:
                    below = below.setdefault(name, {})
        return tree

    def _fixed_nodes(self) -> Iterator[Fixed]:
        for node in self.nodes:
            if not isinstance(node, Fixed):
                raise ValueError(f"{self.message} has no fixed size")
            yield node


def names_of(path: Path) -> tuple[str, ...]:
    """The names on a path."""
    return tuple(step.name for step in path)


def all_nodes(nodes: tuple[Node, ...]) -> Iterator[Node]:
    """Every node in wire order, a loop in front of its body."""
    for node in nodes:
        yield node
        if isinstance(node, Loop):
            yield from all_nodes(node.body)
