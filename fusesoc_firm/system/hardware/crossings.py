"""The instances between the ends of a connection whose clocks or stream widths differ.

A message or an element of an array is a scope: a handshake, fields that are stable during the handshake, and nested
streams and elements. A handshake and its fields cross in a `firm_cdc_message`, a stream in a `firm_cdc_stream`. If only
the widths differ, streams pass through a `firm_axis_resize`, which causes no stall, and all other signals are wired.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from fusesoc_firm.converter.message_ports import LENGTH_BITS, ElementPorts, MessageSide, message_side
from fusesoc_firm.converter.program import has_bytes
from fusesoc_firm.frame.model import Data, Fixed, Frame, Loop, Node
from fusesoc_firm.system.derived.model import Clock, Connection, DerivedSystem, End
from fusesoc_firm.system.derived.sides import PAYLOAD_LENGTH, Handshake

# A field's port and its width in bits, None for a `std_logic`.
Field = tuple[str, int | None]


@dataclass(frozen=True)
class Scope:
    """A message or an element of an array: its handshake, and the ports of its fields and streams.

    `parent` is the handshake of the enclosing scope.
    """

    handshake: Handshake
    parent: Handshake | None = None
    fields: list[Field] = field(default_factory=list)
    streams: list[str] = field(default_factory=list)

    @property
    def bits(self) -> int:
        """The width of all fields together."""
        return sum(width or 1 for _, width in self.fields)


@dataclass(frozen=True)
class Crossing:
    """A connection between two ends whose clocks or stream widths differ; None represents the system's clock."""

    source: End
    sink: End
    frame: Frame
    source_clock: Clock | None
    sink_clock: Clock | None
    source_width: int
    sink_width: int

    @property
    def is_clocked(self) -> bool:
        """Whether the clocks differ."""
        return self.source_clock != self.sink_clock

    @property
    def scopes(self) -> list[Scope]:
        """The message, followed by the elements of its arrays in wire order."""
        return _scopes(self.frame)

    @property
    def clocks(self) -> str:
        """The ports of both clocks, as text; empty if the clocks are equal."""
        return f"{port_of(self.source_clock)} to {port_of(self.sink_clock)}" if self.is_clocked else ""

    @property
    def widths(self) -> str:
        """The stream widths at both ends, as text; empty if the widths are equal or there is no stream."""
        has_streams = any(scope.streams for scope in self.scopes)
        is_resized = has_streams and self.source_width != self.sink_width
        return f"{self.source_width} to {self.sink_width} bits" if is_resized else ""

    def signals(self) -> Iterator[tuple[str, int | None]]:
        """Yield the word and the width of each signal to declare."""
        if not self.is_clocked:
            return
        if self.frame.is_fixed_size:
            yield from (("valid", None), ("ready", None))
            return
        scopes = self.scopes
        for scope in scopes:
            part = scope.handshake.part
            if parts_of(scope, scopes):
                yield word(part, "settled"), None
            if scope.parent:
                yield word(part, "idle"), None
            yield from ((word(part, name), scope.bits) for name in ("given", "taken"))
            yield from ((word(f"{stream}_axis", "idle"), None) for stream in scope.streams)

    def instances(self) -> Iterator[str]:
        """Yield the word in each instance's label."""
        for scope in self.scopes:
            if self.is_clocked:
                yield word(scope.handshake.part, "crossing")
            if self.is_clocked or self.source_width != self.sink_width:
                yield from (word(f"{stream}_axis", "crossing") for stream in scope.streams)


def port_of(clock: Clock | None) -> str:
    """Return the top level's port for the clock."""
    return clock.port if clock else "clk"


def word(part: str, name: str) -> str:
    """Return a part's name joined with the name of a signal or label."""
    return f"{part}_{name}" if part else name


def parts_of(scope: Scope, scopes: Sequence[Scope]) -> list[str]:
    """Return the words for the idle signals of the streams and elements within a scope."""
    streams = [word(f"{stream}_axis", "idle") for stream in scope.streams]
    return streams + [word(item.handshake.part, "idle") for item in scopes if item.parent == scope.handshake]


def crossings(system: DerivedSystem, connection: Connection) -> list[Crossing | None]:
    """Return the crossing before each sink of a connection, or None if both ends have the same clock and width."""
    return [_crossing(system, connection, sink) for sink in connection.sinks]


def all_crossings(system: DerivedSystem) -> list[Crossing]:
    """Return all crossings of a system, in the order of its connections."""
    return [found for item in system.connections for found in crossings(system, item) if found]


def _crossing(system: DerivedSystem, connection: Connection, sink: End) -> Crossing | None:
    source, target = connection.source.block, sink.block
    found = Crossing(
        connection.source,
        sink,
        # In a message of variable size, all sinks get the same parts.
        connection.frame,
        system.clock_of(source),
        system.clock_of(target),
        system.width_of(source),
        system.width_of(target),
    )
    return found if found.clocks or found.widths else None


def _scopes(frame: Frame) -> list[Scope]:
    if frame.is_fixed_size:
        return [Scope(Handshake("", "segment_valid", "msg_ready"))]
    side = message_side(frame)
    message = Scope(Handshake("", "msg_valid", "msg_ready", "segment_valid", side.segments))
    message.fields.append((PAYLOAD_LENGTH, LENGTH_BITS))
    return [message, *_collect(side, frame.nodes, message)]


def _collect(side: MessageSide, nodes: Sequence[Node], scope: Scope) -> Iterator[Scope]:
    """Add fields and streams to a scope, and yield the nested scopes."""
    for node in nodes:
        match node:
            case Fixed():
                ports = (side.field(leaf) for leaf in node.fields if leaf.count and leaf.is_used)
                # Padding may separate the elements of a leaf.
                scope.fields.extend(
                    dict.fromkeys((p.name, p.width) for p in ports if (p.name, p.width) not in scope.fields)
                )
            case Data() if node.is_used:
                stream = side.stream(node)
                scope.fields.append((stream.length, LENGTH_BITS))
                scope.streams.append(stream.name)
            case Loop() if node.is_used:
                element = side.element(node)
                if node.count is None:
                    scope.fields.append((element.length, LENGTH_BITS))
                if has_bytes(node):
                    inner = Scope(_handshake(element), scope.handshake, [(element.last, None)])
                    yield inner
                    yield from _collect(side, node.body, inner)


def _handshake(element: ElementPorts) -> Handshake:
    if element.segments is None:
        return Handshake(element.name, element.valid, element.ready)
    return Handshake(element.name, element.valid, element.ready, element.segment_valid, element.segments)
