"""The Frame model, the second stage: a message as bytes on the wire.

A frame is `id` (1 byte) | `length` (uint32, little-endian) | payload. The payload is a tree of nodes in wire order;
docs/explanation/frames.md shows an example:

* `Fixed`: bytes with a known layout, including padding.
* `Pad`: padding that depends on the position, which is known only at run time.
* `Data`: a string, or a variable array of numbers.
* `Loop`: an array whose elements are messages or strings; its body also consists of nodes.
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
MOST_EMPTY_ELEMENTS = 1024
"""The limit of elements without bytes in a variable array; otherwise, four bytes could announce billions of them."""


@dataclass(frozen=True)
class Step:
    """One name on the path from a message to a field; `count` is None except for a fixed-size array.

    A `Loop` does not set `count`: a path within a loop describes one element of the loop.
    """

    name: str
    count: int | None = None


Path = tuple[Step, ...]


@dataclass(frozen=True)
class Run:
    """Adjacent elements of a field; `offset` counts from the start of the `Fixed`."""

    offset: int
    count: int


@dataclass(frozen=True)
class FrameField:
    """A leaf of the message; all elements of a leaf have the same wire type.

    `path` leads from the message to the leaf. Each fixed array on the path multiplies the number of elements, which are
    numbered in wire order. `runs` contains the positions of the elements. If a `Pad` separates the elements, each
    `Fixed` has a field with this path for its own elements, and `first` is the number of the first of them.
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
        """Whether the path includes a fixed array, even an array of one element."""
        return any(step.count is not None for step in self.path)

    @property
    def count(self) -> int:
        """The total number of elements; 1 for a scalar."""
        return prod(step.count for step in self.path if step.count is not None)

    @property
    def held(self) -> int:
        """The number of elements in this node: all elements of the leaf, unless a `Pad` separates them."""
        return sum(run.count for run in self.runs)

    @property
    def offsets(self) -> Iterator[int]:
        """Yield the offset of the first byte of each element in this node, in order."""
        for run in self.runs:
            yield from range(run.offset, run.offset + run.count * self.type.size, self.type.size)


@dataclass(frozen=True)
class Fixed:
    """`size` bytes with `fields` and padding between them; the first `Fixed` of a payload begins with the prefix."""

    size: int
    fields: tuple[FrameField, ...]


@dataclass(frozen=True)
class Pad:
    """Padding of 0 to `alignment` - 1 bytes to a multiple of `alignment`, counted from the end of the prefix."""

    alignment: int


class DataKind(Enum):
    """The kind of value that a `Data` contains."""

    ARRAY = "array"
    STRING = "string"
    WSTRING = "wstring"


@dataclass(frozen=True)
class Data:
    """A count (uint32), followed by that number of elements: numbers, or the bytes or UTF-16 units of a text.

    The count includes the `terminator` zero bytes after the text; `bound` does not. If there are elements, `padding`
    bytes precede them; None means padding to `alignment` that depends on the position, as for a `Pad`. `ros_type` is
    the field's type as written in the definition.
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
    """An array of messages or strings, or a long fixed array of numbers: `body`, repeated for each element.

    `count` is the size of a fixed array, which is not sent. If `count` is None, a count (uint32) of at most `bound`
    precedes the elements. Paths in the body begin with the path of the loop.
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

    @property
    def text(self) -> Data | None:
        """The element, if it is a string."""
        return next((node for node in self.body if isinstance(node, Data) and node.path == self.path), None)

    @property
    def number(self) -> FrameField | None:
        """The element, if it is a number: that of a long array of fixed size."""
        fields = (leaf for node in self.body if isinstance(node, Fixed) for leaf in node.fields)
        return next((leaf for leaf in fields if leaf.path == self.path), None)

    @property
    def has_fields(self) -> bool:
        """True if the element is a message, neither a string nor a number."""
        return self.text is None and self.number is None


Node = Fixed | Pad | Data | Loop
NameTree = dict[str, "NameTree"]


@dataclass(frozen=True)
class Frame:
    """The layout of a message.

    `prefix` is the constant bytes before the first field; a receiver checks only the first `checked_prefix` bytes. The
    converters of messages of fixed size accept up to `trailing_bytes` bytes after the last field. Unless this is 0, all
    others accept any number.
    """

    message: MessageName
    ros: Middleware
    prefix: bytes
    checked_prefix: int
    nodes: tuple[Node, ...]
    trailing_bytes: int

    def __hash__(self) -> int:
        """Return the hash of all parts, computed once, since frames are dictionary keys and may be large."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash((self.message, self.ros, self.prefix, self.checked_prefix, self.nodes, self.trailing_bytes))

    @property
    def is_fixed_size(self) -> bool:
        """Whether the whole payload is one `Fixed`, so that offsets in the `Fixed` are offsets in the payload."""
        return all(isinstance(node, Fixed) for node in self.nodes)

    @property
    def fields(self) -> tuple[FrameField, ...]:
        """The leaves of a fixed-size message."""
        return tuple(leaf for node in self._fixed_nodes() for leaf in node.fields)

    @property
    def payload_bytes(self) -> int:
        """The number of bytes in the payload of a fixed-size message."""
        return sum(node.size for node in self._fixed_nodes())

    @property
    def frame_bytes(self) -> int:
        """The number of bytes in the frame of a fixed-size message, including id and length."""
        return ID_BYTES + LENGTH_BYTES + self.payload_bytes

    @cached_property
    def names(self) -> NameTree:
        """The tree of the names of all fields and nested fields; a field without values is omitted."""
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
    """Return the names on a path."""
    return tuple(step.name for step in path)


def all_nodes(nodes: tuple[Node, ...]) -> Iterator[Node]:
    """Yield every node in wire order; a loop precedes the nodes of its body."""
    for node in nodes:
        yield node
        if isinstance(node, Loop):
            yield from all_nodes(node.body)


def has_bytes(nodes: tuple[Node, ...]) -> bool:
    """Return whether nodes have a byte in each message."""
    return any(
        bool(node.size) if isinstance(node, Fixed) else isinstance(node, Data) or _has_bytes(node)
        for node in nodes
        if not isinstance(node, Pad)
    )


def _has_bytes(loop: Loop) -> bool:
    return loop.count is None or (loop.count > 0 and has_bytes(loop.body))
