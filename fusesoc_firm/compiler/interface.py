"""The messages of a compiled function, as values for the front and as ports for the text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from fusesoc_firm.compiler.graph import Graph, Node
from fusesoc_firm.compiler.kinds import INT, KINDS, Kind
from fusesoc_firm.compiler.values import Array, Memory, Record, Stream, Value, converted
from fusesoc_firm.converter.message_ports import ElementPorts, StreamPorts, message_side
from fusesoc_firm.converter.ports import FieldPort, field_ports
from fusesoc_firm.converter.segments import segments_of
from fusesoc_firm.frame.model import Data, DataKind, Frame, Path, names_of
from fusesoc_firm.frame.values import dotted

# A payload is shorter than 2**30 bytes.
_MOST_ELEMENTS = (1 << 30) - 1


@dataclass(frozen=True)
class Bits:
    """The bits of a port, from `high` to `low`; a port without bits is a `std_logic`."""

    port: str
    high: int | None = None
    low: int = 0

    def __str__(self) -> str:
        if self.high is None:
            return self.port
        return f"{self.port}({self.high} downto {self.low})"


@dataclass(frozen=True)
class Leaf:
    """A field of a message, or each element of an array of fixed size: its port, kind and segment."""

    path: Path
    port: str
    kind: Kind
    count: int
    is_array: bool
    segment: int = 0

    def bits(self, element: int) -> Bits:
        """Return the bits of an element at the port."""
        if not self.is_array:
            return Bits(self.port)
        return Bits(self.port, self.kind.bits * (element + 1) - 1, self.kind.bits * element)


@dataclass(frozen=True)
class Part:
    """A string or an array of variable size: the prefix of its stream's ports, its length, and its elements' kind.

    `number` counts the parts of the message in wire order; the part follows the segment of its length. The elements
    have no kind if they are characters.
    """

    path: Path
    stream: str
    length: str
    kind: Kind | None
    bits: int
    segment: int
    number: int


@dataclass(frozen=True)
class Side:
    """A message of a function: its ports' prefix, its fields and parts in wire order, and its number of segments."""

    prefix: str
    frame: Frame
    leaves: tuple[Leaf, ...]
    parts: tuple[Part, ...]
    segments: int

    @property
    def is_fixed(self) -> bool:
        """Whether the message has a fixed size."""
        return self.frame.is_fixed_size


def side_of(prefix: str, frame: Frame) -> Side:
    """Return the ports of a message."""
    if frame.is_fixed_size:
        leaves = tuple(_leaf(prefix, port, 0) for port in field_ports(frame) if port.field.is_used)
        return Side(prefix, frame, leaves, (), 1)
    segments = segments_of(frame)
    found: list[Leaf] = []
    parts: list[Part] = []
    for item in message_side(frame).parts:
        match item:
            case FieldPort():
                found.append(_leaf(prefix, item, segments.fields[item.field.path]))
            case StreamPorts():
                parts.append(_part(prefix, item, segments.parts[item.part.path], len(parts)))
            case ElementPorts():
                raise AssertionError("the accelerator has passed check_streams")
    return Side(prefix, frame, tuple(found), tuple(parts), segments.count)


def _leaf(prefix: str, port: FieldPort, segment: int) -> Leaf:
    leaf = port.field
    return Leaf(leaf.path, prefix + port.name, KINDS[leaf.type.name], leaf.count, leaf.is_array, segment)


def _part(prefix: str, ports: StreamPorts, segment: int, number: int) -> Part:
    data: Data = ports.part
    # A bool of an array is a byte.
    kind = KINDS["uint8" if data.element.name == "bool" else data.element.name] if data.kind is DataKind.ARRAY else None
    stream = f"{prefix}{ports.name}_axis"
    return Part(data.path, stream, prefix + ports.length, kind, 8 * data.element.size, segment, number)


def message_value(side: Side, graph: Graph, memory: Memory, numbers: Kind | None) -> Record:
    """Return a message as the function receives it; floats have the kind `numbers`, if it is given."""
    tree: dict[Any, Any] = {}
    for leaf in side.leaves:
        for element, steps in enumerate(places(leaf.path)):
            made = graph.leaf("input", leaf.kind, leaf.bits(element), phase=2 * leaf.segment)
            _set(tree, steps, converted(graph, made, numbers) if numbers and leaf.kind.is_float else made)
    for part in side.parts:
        limits = 0, _MOST_ELEMENTS
        length = graph.leaf("input", INT, Bits(part.length, limits[1].bit_length() - 1), limits, 2 * part.segment)
        # The limits need a bit less than the port has.
        make = partial(_element, graph, part, numbers) if part.kind else None
        _set(tree, names_of(part.path), Stream(part.stream, dotted(names_of(part.path)), part.number, length, make))
    message: Record = _objects(tree, memory)
    return message


def _element(graph: Graph, part: Part, numbers: Kind | None, phase: int) -> Node:
    assert part.kind is not None
    made = graph.leaf("input", part.kind, Bits(element_signal(part)), phase=phase)
    return converted(graph, made, numbers) if numbers and part.kind.is_float else made


def element_signal(part: Part) -> str:
    """Return the signal with an element of a stream."""
    return f"{part.stream.removesuffix('_axis')}_element"


def places(path: Path) -> list[tuple[str | int, ...]]:
    """Return the names and indices that lead to each element of a leaf, in wire order."""
    found: list[tuple[str | int, ...]] = [()]
    for step in path:
        found = [(*item, step.name) for item in found]
        if step.count is not None:
            found = [(*item, index) for item in found for index in range(step.count)]
    return found


def _set(tree: dict[Any, Any], steps: Sequence[str | int], value: Value) -> None:
    *above, last = steps
    for step in above:
        tree = tree.setdefault(step, {})
    tree[last] = value


def _objects(tree: dict[Any, Any], memory: Memory) -> Any:
    """Return messages and lists for the levels of a tree."""
    content = {key: _objects(value, memory) if isinstance(value, dict) else value for key, value in tree.items()}
    # The elements of a list are numbered from 0.
    return memory.new(Array() if 0 in content else Record(), content)
