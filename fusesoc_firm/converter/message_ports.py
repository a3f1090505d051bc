"""The message side of a converter: all ports of a message of fixed or variable size.

The subscriber and the publisher of a message have the same ports, in opposite directions. The module `ports` names the
ports of fields. A message of variable size also has `payload_length`, and each part named `f` has these ports:

    string, array of numbers    f_length, f_axis_tdata/tkeep/tvalid/tlast/tready
    array of messages           f_length, the ports of an element, f_valid/last/ready
                                and f_segment_valid if an element has several segments

In an array of strings, `f` is the array and `f_element` is one of its strings.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from fusesoc_firm.converter.ports import FieldPort, field_ports, port_width, ros_path
from fusesoc_firm.converter.program import Program, Scope, has_bytes, subscriber_program
from fusesoc_firm.converter.steps import SET_NAMES
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.frame.model import Data, Fixed, Frame, FrameField, Loop, Node, Path
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.reserved import reserved_names

LENGTH_BITS = 32

_TEMPLATES = ("vhdl/variable_subscriber.vhd", "vhdl/variable_publisher.vhd")
# The templates' configurations add numbers to these names; a numbered name never equals another name.
_NUMBERED = re.compile(
    r".*_r|(closing|at_end)_\d+|(elements|(u_)?ahead|(step|next)_fills)_\d+(_[a-z]+)?", re.IGNORECASE
)
_TAKEN = reserved_names(*_TEMPLATES) | SET_NAMES | {"payload_length"}


@dataclass(frozen=True)
class MessagePort:
    """A port of the message side; `is_reverse` marks a `ready`, whose direction is opposite to the message's."""

    name: str
    width: int | None
    comment: str = ""
    is_reverse: bool = False

    @property
    def vhdl_type(self) -> str:
        """The port's type in VHDL."""
        return vhdl_type(self.width)


@dataclass(frozen=True)
class StreamPorts:
    """The ports of a string or an array of numbers."""

    part: Data
    name: str

    @property
    def length(self) -> str:
        """The port with the number of elements: bytes in a string or units in a wstring, without the terminator."""
        return f"{self.name}_length"

    def axis(self, signal: str) -> str:
        """Return the stream's `tdata`, `tkeep`, `tvalid`, `tlast` or `tready`."""
        return f"{self.name}_axis_{signal}"


@dataclass(frozen=True)
class ElementPorts:
    """The ports of an array of messages or strings; `segments` is None if an element has a single segment.

    If the elements have no bytes, the length is the only port.
    """

    loop: Loop
    name: str
    segments: int | None

    @property
    def length(self) -> str:
        """The port with the number of elements; an array of fixed size has no such port."""
        return f"{self.name}_length"

    @property
    def valid(self) -> str:
        """The port that marks an element as complete, with all its streams ended."""
        return f"{self.name}_valid"

    @property
    def last(self) -> str:
        """The port that marks the last element."""
        return f"{self.name}_last"

    @property
    def ready(self) -> str:
        """The port that accepts the element."""
        return f"{self.name}_ready"

    @property
    def segment_valid(self) -> str:
        """The port with a valid bit for each segment of the element."""
        return f"{self.name}_segment_valid"


@dataclass(frozen=True)
class MessageSide:
    """The ports for the used fields and parts of a message of variable size, in wire order, with look-ups by node.

    `segments` is the width of `segment_valid`.
    """

    segments: int
    parts: tuple[FieldPort | StreamPorts | ElementPorts, ...]
    by_path: dict[tuple[str, Path], FieldPort | StreamPorts | ElementPorts] = field(compare=False, repr=False)

    def field(self, leaf: FrameField) -> FieldPort:
        """Return the port of a leaf; any piece of the leaf identifies the port."""
        found = self.by_path["field", leaf.path]
        assert isinstance(found, FieldPort)
        return found

    def stream(self, part: Data) -> StreamPorts:
        """Return the ports of a string or an array of numbers."""
        found = self.by_path["data", part.path]
        assert isinstance(found, StreamPorts)
        return found

    def element(self, loop: Loop) -> ElementPorts:
        """Return the ports of an array of messages or strings."""
        found = self.by_path["loop", loop.path]
        assert isinstance(found, ElementPorts)
        return found

    def length(self, part: Data | Loop) -> str:
        """Return the port that holds a part's number of elements."""
        return self.stream(part).length if isinstance(part, Data) else self.element(part).length


def message_side(frame: Frame) -> MessageSide:
    """Return the ports of a message of variable size."""
    program = subscriber_program(frame)
    naming = _Naming(program)
    naming.nodes(frame.nodes, ())
    return MessageSide(program.segments(), tuple(naming.parts.values()), naming.parts)


def message_ports(frame: Frame, width: int) -> tuple[MessagePort, ...]:
    """Return the ports of the message side except the handshake, in declaration order; streams have `width` bits."""
    if frame.is_fixed_size:
        return tuple(MessagePort(port.name, port.width, port.comment) for port in field_ports(frame))
    found = [MessagePort("payload_length", LENGTH_BITS, "bytes of the payload")]
    side = message_side(frame)
    found += _ports(side, frame.nodes, width, set())
    return tuple(found)


def port_declarations(ports: Sequence[MessagePort], direction: str) -> list[dict[str, str]]:
    """Return the port declarations of the message side, in `direction`; reverse ports have the opposite direction."""
    opposite = {"in": "out", "out": "in"}[direction]
    return [
        {
            "name": port.name,
            "direction": opposite if port.is_reverse else direction,
            "type": port.vhdl_type,
            "comment": port.comment,
        }
        for port in ports
    ]


def segment_count(frame: Frame) -> int:
    """Return the width of `segment_valid`."""
    return 1 if frame.is_fixed_size else subscriber_program(frame).segments()


@dataclass
class _Naming:
    """An assignment of unique names to ports, in wire order."""

    program: Program
    parts: dict[tuple[str, Path], FieldPort | StreamPorts | ElementPorts] = field(default_factory=dict)
    taken: set[str] = field(default_factory=lambda: set(_TAKEN))

    def nodes(self, nodes: Sequence[Node], scope: Scope) -> None:
        """Name the ports of all parts, including unused parts, so that names are independent of the field selection."""
        for node in nodes:
            match node:
                case Fixed(fields=fields):
                    for leaf in fields:
                        self.leaf(leaf)
                case Data():
                    names = (*node.names, "element") if scope and scope[-1].path == node.path else node.names
                    self.add(("data", node.path), StreamPorts(node, self.name(names, _STREAM)), is_used=node.is_used)
                case Loop():
                    inner = (*scope, node)
                    segments = self.program.segments(inner) if _has_parts(node) else None
                    ports = ElementPorts(node, self.name(node.names, _ELEMENT), segments or None)
                    self.add(("loop", node.path), ports, is_used=node.is_used)
                    self.nodes(node.body, inner)

    def leaf(self, leaf: FrameField) -> None:
        if leaf.count and leaf.first == 0:
            port = FieldPort(self.name(leaf.names, ("",)), port_width(leaf), leaf)
            self.add(("field", leaf.path), port, is_used=leaf.is_used)

    def add(self, key: tuple[str, Path], ports: FieldPort | StreamPorts | ElementPorts, *, is_used: bool) -> None:
        if is_used:
            self.parts[key] = ports

    def name(self, names: Sequence[str], suffixes: Sequence[str]) -> str:
        """Return the first of `a_b`, `a_b_2`, `a_b_3`, ... that results in unused names for all ports."""
        base = identifier(*names)
        candidate, number = base, 2
        while any(self.is_taken(candidate + suffix) for suffix in suffixes):
            candidate, number = f"{base}_{number}", number + 1
        self.taken |= {(candidate + suffix).lower() for suffix in suffixes}
        return candidate

    def is_taken(self, name: str) -> bool:
        return name.lower() in self.taken or _NUMBERED.fullmatch(name) is not None


_AXIS = ("tdata", "tkeep", "tvalid", "tlast", "tready")
_STREAM = ("_length", *(f"_axis_{signal}" for signal in _AXIS))
_ELEMENT = ("_length", "_valid", "_last", "_ready", "_segment_valid")


def _has_parts(loop: Loop) -> bool:
    return any(isinstance(node, Data | Loop) and node.is_used for node in loop.body)


def _ports(side: MessageSide, nodes: Sequence[Node], width: int, done: set[Path]) -> Iterator[MessagePort]:
    for node in nodes:
        match node:
            case Fixed():
                yield from _leaf_ports(side, node, done)
            case Data() if node.is_used:
                yield from _stream_ports(side.stream(node), width)
            case Loop() if node.is_used:
                if node.count is None:
                    yield MessagePort(side.element(node).length, LENGTH_BITS, f"{_words(node)}, its elements")
                yield from array_ports(side, node, width, done)


def array_ports(side: MessageSide, loop: Loop, width: int, done: set[Path]) -> Iterator[MessagePort]:
    """Yield the ports of an array of messages or strings except its length; `done` are leaves that have ports."""
    if has_bytes(loop):
        yield from _ports(side, loop.body, width, done)
        yield from _element_ports(side.element(loop))


def _words(part: Data | Loop) -> str:
    return f"{ros_path(part.path)}: {part.ros_type}"


def _leaf_ports(side: MessageSide, node: Fixed, done: set[Path]) -> Iterator[MessagePort]:
    """Yield the port of each leaf once, even if padding separates the leaf's elements."""
    for leaf in node.fields:
        if leaf.count and leaf.is_used and leaf.path not in done:
            port = side.field(leaf)
            yield MessagePort(port.name, port.width, port.comment)
            done.add(leaf.path)


def _element_ports(ports: ElementPorts) -> Iterator[MessagePort]:
    if ports.segments is not None:
        yield MessagePort(ports.segment_valid, ports.segments, f"{_words(ports.loop)}, segments of an element")
    yield MessagePort(ports.valid, None, f"{_words(ports.loop)}, an element")
    yield MessagePort(ports.last, None)
    yield MessagePort(ports.ready, None, is_reverse=True)


def _stream_ports(ports: StreamPorts, width: int) -> Iterator[MessagePort]:
    words = _words(ports.part)
    yield MessagePort(ports.length, LENGTH_BITS, f"{words}, its length")
    yield MessagePort(ports.axis("tdata"), width, words)
    yield MessagePort(ports.axis("tkeep"), width // 8)
    yield MessagePort(ports.axis("tvalid"), None)
    yield MessagePort(ports.axis("tlast"), None)
    yield MessagePort(ports.axis("tready"), None, is_reverse=True)
