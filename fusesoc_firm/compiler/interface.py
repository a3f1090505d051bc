"""The messages of a compiled function, as values for the front and as ports for the text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

from fusesoc_firm.compiler.conversions import converted
from fusesoc_firm.compiler.graph import Graph, Node
from fusesoc_firm.compiler.kinds import INT, KINDS, Kind
from fusesoc_firm.compiler.values import Array, Memory, Record, Stream, Value
from fusesoc_firm.converter.message_ports import (
    ElementPorts,
    MessagePort,
    MessageSide,
    StreamPorts,
    array_ports,
    message_side,
)
from fusesoc_firm.converter.ports import FieldPort, field_ports
from fusesoc_firm.converter.segments import segments_of
from fusesoc_firm.frame.model import Data, DataKind, Fixed, Frame, Loop, Path, names_of
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
    """A string or an array of variable size: its place in the message, and the prefix of its stream's ports.

    `length` is the port with the number of elements, which is never fixed. `number` counts the parts of the message in
    wire order; the part follows the segment of its length. The elements have no kind if they are characters, and are at
    most `bound`.
    """

    path: Path
    stream: str
    length: str
    kind: Kind | None
    bits: int
    segment: int
    number: int
    bound: int | None = None
    count: ClassVar[None] = None

    @property
    def element(self) -> str:
        """The prefix of the signals of an element: `_valid`, `_last` and `_ready`, and the element itself.

        It does not begin as a port, so it never equals one.
        """
        return f"element_{self.stream.removesuffix('_axis')}"

    @property
    def shape(self) -> tuple[object, ...]:
        """What two strings or arrays have in common if one can be passed on as the other."""
        return (self.kind, self.bits)

    @property
    def ports(self) -> tuple[MessagePort, ...]:
        """The ports, except for the length."""
        forward = {"tdata": 8, "tkeep": 1, "tvalid": None, "tlast": None}
        ports = [MessagePort(f"{self.stream}_{signal}", width) for signal, width in forward.items()]
        return (*ports, MessagePort(f"{self.stream}_tready", None, is_reverse=True))


@dataclass(frozen=True)
class Elements:
    """An array of messages, of strings or of many numbers: its place in the message, and the ports of an element.

    An array of fixed size has a `count` in place of the port `length`. `ports` are all others; their names begin with
    `element`. `leaves` are those of an element's own fields, and `within` the paths of its strings and arrays.
    """

    path: Path
    element: str
    length: str | None
    count: int | None
    type: str
    leaves: tuple[Leaf, ...]
    within: tuple[Path, ...]
    ports: tuple[MessagePort, ...]
    segment: int
    number: int
    bound: int | None = None

    @property
    def shape(self) -> tuple[object, ...]:
        """What two arrays have in common if the elements of one can be passed on as those of the other."""
        skipped = len(self.element)
        return (self.type, *((port.name[skipped:], port.width) for port in self.ports))

    @property
    def inner(self) -> list[MessagePort]:
        """The ports of an element's strings and arrays."""
        own = {leaf.port for leaf in self.leaves}
        own |= {f"{self.element}_{signal}" for signal in ("segment_valid", "valid", "last", "ready")}
        return [port for port in self.ports if port.name not in own]


@dataclass(frozen=True)
class Side:
    """A message of a function: its ports' prefix, its fields and parts in wire order, and its number of segments.

    `length` tells how an answer's length comes about: `computed` from those of its parts, `given` by the function, or
    `buffered`, so that nothing is needed before the parts.
    """

    prefix: str
    frame: Frame
    leaves: tuple[Leaf, ...]
    parts: tuple[Part | Elements, ...]
    segments: int
    length: str = "buffered"

    @property
    def is_fixed(self) -> bool:
        """Whether the message has a fixed size."""
        return self.frame.is_fixed_size


def side_of(prefix: str, frame: Frame, length: str = "buffered") -> Side:
    """Return the ports of a message; `length` is that of an answer."""
    if frame.is_fixed_size:
        leaves = tuple(_leaf(prefix, port, 0) for port in field_ports(frame) if port.field.is_used)
        return Side(prefix, frame, leaves, (), 1)
    segments, ports = segments_of(frame), message_side(frame)
    found: list[Leaf] = []
    parts: list[Part | Elements] = []
    for item in ports.parts:
        match item:
            case FieldPort(field=leaf) if leaf.path in segments.fields:
                found.append(_leaf(prefix, item, segments.fields[leaf.path]))
            case StreamPorts(part=part) if part.path in segments.parts and ("loop", part.path) not in ports.by_path:
                parts.append(_part(prefix, item, segments.parts[part.path], len(parts)))
            case ElementPorts(loop=loop) if loop.path in segments.parts:
                parts.append(_elements(prefix, item, ports, segments.parts[loop.path], len(parts)))
    return Side(prefix, frame, tuple(found), tuple(parts), segments.count, length)


def _leaf(prefix: str, port: FieldPort, segment: int) -> Leaf:
    leaf = port.field
    return Leaf(leaf.path, prefix + port.name, KINDS[leaf.type.name], leaf.count, leaf.is_array, segment)


def _part(prefix: str, ports: StreamPorts, segment: int, number: int) -> Part:
    data: Data = ports.part
    # A bool of an array is a byte.
    kind = KINDS["uint8" if data.element.name == "bool" else data.element.name] if data.kind is DataKind.ARRAY else None
    stream = f"{prefix}{ports.name}_axis"
    return Part(data.path, stream, prefix + ports.length, kind, 8 * data.element.size, segment, number, data.bound)


def _elements(prefix: str, ports: ElementPorts, side: MessageSide, segment: int, number: int) -> Elements:
    loop = ports.loop
    fields = [leaf for node in loop.body if isinstance(node, Fixed) for leaf in node.fields if leaf.count]
    leaves = dict.fromkeys(side.field(leaf) for leaf in fields if leaf.is_used)
    # The width of the streams does not matter here: they are connected, or empty.
    found = [replace(port, name=prefix + port.name) for port in array_ports(side, loop, 8, set())]
    return Elements(
        loop.path,
        prefix + ports.name,
        None if loop.count is not None else prefix + ports.length,
        loop.count,
        loop.ros_type,
        tuple(_leaf(prefix, port, segment) for port in leaves),
        tuple(node.path for node in loop.body if isinstance(node, Data | Loop) and node.path != loop.path),
        tuple(found),
        segment,
        number,
        loop.bound,
    )


def message_value(side: Side, graph: Graph, memory: Memory, numbers: Kind | None) -> Record:
    """Return a message as the function receives it; floats have the kind `numbers`, if it is given."""
    tree = _fields(graph, side.leaves, numbers)
    for part in side.parts:
        length = graph.constant(part.count) if part.count is not None else _length(graph, part)
        name = dotted(names_of(part.path))
        _set(tree, names_of(part.path), Stream(part, name, part.number, length, _maker(graph, part, numbers)))
    message: Record = _objects(tree, memory)
    return message


def _length(graph: Graph, part: Part | Elements) -> Node:
    # The limits need a bit less than the port has.
    bits = Bits(str(part.length), _MOST_ELEMENTS.bit_length() - 1)
    return graph.leaf("input", INT, bits, (0, _MOST_ELEMENTS), 2 * part.segment)


def _fields(graph: Graph, leaves: Sequence[Leaf], numbers: Kind | None, phase: int | None = None) -> dict[Any, Any]:
    """Return the values of fields by the steps of their paths: those of an element, if the phase of its loop is given.

    The paths of an element's fields begin behind that of the array.
    """
    tree: dict[Any, Any] = {}
    for leaf in leaves:
        for number, steps in enumerate(places(leaf.path)):
            made = graph.leaf("input", leaf.kind, leaf.bits(number), phase=2 * leaf.segment if phase is None else phase)
            _set(tree, steps, converted(graph, made, numbers) if numbers and leaf.kind.is_float else made)
    return tree


def _maker(graph: Graph, part: Part | Elements, numbers: Kind | None) -> Callable[[int, Memory], Value] | None:
    """Return the function that makes the value of an element in a phase, or None for elements that are texts."""
    if isinstance(part, Elements):
        return partial(_message, graph, part, numbers) if part.leaves else None
    return partial(_number, graph, part, part.kind, numbers) if part.kind else None


def _number(graph: Graph, part: Part, kind: Kind, numbers: Kind | None, phase: int, _: Memory) -> Node:
    made = graph.leaf("input", kind, Bits(part.element), phase=phase)
    return converted(graph, made, numbers) if numbers and kind.is_float else made


def _message(graph: Graph, part: Elements, numbers: Kind | None, phase: int, memory: Memory) -> Value:
    tree: Any = _fields(graph, part.leaves, numbers, phase)
    for path in part.within:
        names = names_of(path)
        _set(tree, names, Stream(None, dotted(names), part.number, graph.constant(0), None))
    for step in names_of(part.path):
        tree = tree[step]
    return _objects(tree, memory)


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


def _objects(tree: Any, memory: Memory) -> Any:
    """Return messages and lists for the levels of a tree, or a number as it is."""
    if not isinstance(tree, dict):
        return tree
    content = {key: _objects(value, memory) for key, value in tree.items()}
    # The elements of a list are numbered from 0.
    return memory.new(Array() if 0 in content else Record(), content)
