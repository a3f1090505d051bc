"""The wires of a first version that passes messages through: the parts that an output shares with the inputs.

Two parts are equal if they have the same path and the same type. Fields of an output are copied from the first input
that has an equal field. Strings and arrays of variable size pass without storage: while the publisher reads one, the
subscriber waits. Therefore they are forwarded only by an accelerator with a single output, from a single input, and
only if neither side waits for a value that the other side sends later.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from fusesoc_firm.converter.message_ports import ElementPorts, StreamPorts, message_side
from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.converter.program import has_bytes
from fusesoc_firm.converter.segments import segments_of
from fusesoc_firm.frame.model import Data, Fixed, Frame, FrameField, Loop, Node, Path
from fusesoc_firm.system.derived.model import AcceleratorType, LengthSource, MessageSide
from fusesoc_firm.system.derived.sides import PAYLOAD_LENGTH

_STREAM_SIGNALS = ("tdata", "tkeep", "tvalid", "tlast")


@dataclass(frozen=True)
class Wires:
    """The wires to an output: its ports, each with the input's port; all names have prefixes.

    If `carrier` is an input, its strings and arrays are forwarded: `ready` has the input's `ready` ports with the
    output's, and segment k of the output is valid with segment `segments[k]` of the carrier or, if that is None, with
    all complete inputs. `paths` are the paths of all wired fields, strings and arrays.
    """

    ports: dict[str, str] = field(default_factory=dict)
    carrier: MessageSide | None = None
    ready: dict[str, str] = field(default_factory=dict)
    segments: tuple[int | None, ...] = ()
    paths: frozenset[Path] = frozenset()


def wires_of(type_: AcceleratorType) -> list[Wires]:
    """Return the wires to each output of an accelerator, in the order of the outputs."""
    return [_wires(type_, output) for output in type_.outputs]


def passes_whole(side: MessageSide, other: MessageSide) -> bool:
    """Whether both sides have the same message with the same fields."""
    return side.kind == other.kind and side.frame.nodes == other.frame.nodes


def equal_paths(frame: Frame, other: Frame) -> frozenset[Path]:
    """Return the paths of the equal fields, strings and arrays of two messages, outside of arrays of variable size."""
    given, wanted = ({node.path: node for node in _top(item)} for item in (frame, other))
    return frozenset(path for path in wanted if path in given and _is_equal(given[path], wanted[path]))


def top_paths(frame: Frame) -> list[Path]:
    """Return the paths of all used fields, strings and arrays, outside of arrays of variable size, in wire order."""
    return [node.path for node in _top(frame)]


def _top(frame: Frame) -> Iterator[FrameField | Data | Loop]:
    for node in frame.nodes:
        if isinstance(node, Fixed):
            yield from (leaf for leaf in node.fields if leaf.is_used and leaf.count)
        elif isinstance(node, Data | Loop) and node.is_used:
            yield node


def _wires(type_: AcceleratorType, output: MessageSide) -> Wires:
    if len(type_.outputs) == 1 and not output.frame.is_fixed_size:
        forwarded = [(side, _forwarded(side, output)) for side in type_.inputs if not side.frame.is_fixed_size]
        carrier, parts = max(forwarded, key=lambda item: len(item[1]), default=(None, []))
        # The elements of an array of fixed size must be counted, unless they are forwarded.
        counted = [part for part in _parts(output.frame) if isinstance(part, Loop) and part.count and part not in parts]
        if carrier and parts and not counted:
            return _forwarding(type_, output, carrier, parts)
    ports, paths = _fields(type_.inputs, output)
    return Wires(ports, paths=paths)


def _forwarding(type_: AcceleratorType, output: MessageSide, carrier: MessageSide, parts: list[Data | Loop]) -> Wires:
    # A field that several inputs have comes from the carrier, as `_forwarded` assumes.
    ports, paths = _fields([carrier, *(side for side in type_.inputs if side is not carrier)], output)
    ready: dict[str, str] = {}
    for part in parts:
        for name, other, is_ready in _part_ports(carrier.frame, output.frame, part):
            if is_ready:
                ready[carrier.prefix + name] = output.prefix + other
            else:
                ports[output.prefix + other] = carrier.prefix + name
    if output.length and output.length.source is LengthSource.GIVEN:
        ports[output.prefix + PAYLOAD_LENGTH] = carrier.prefix + PAYLOAD_LENGTH
    return Wires(ports, carrier, ready, _latest(carrier, output, parts), paths | {part.path for part in parts})


def _fields(inputs: Sequence[MessageSide], output: MessageSide) -> tuple[dict[str, str], frozenset[Path]]:
    """Return the wires of the equal fields outside of arrays of variable size, and their paths."""
    wanted = _field_ports(output.frame)
    ports: dict[str, str] = {}
    wired: set[Path] = set()
    for side in reversed(inputs):
        given = _field_ports(side.frame)
        for path in equal_paths(side.frame, output.frame) & wanted.keys():
            ports[output.prefix + wanted[path]] = side.prefix + given[path]
            wired.add(path)
    return ports, frozenset(wired)


def _field_ports(frame: Frame) -> dict[Path, str]:
    """Return the port of each used field outside of arrays of variable size."""
    if frame.is_fixed_size:
        return {port.field.path: port.name for port in field_ports(frame)}
    side = message_side(frame)
    return {leaf.path: side.field(leaf).name for leaf in _top(frame) if isinstance(leaf, FrameField)}


def _forwarded(side: MessageSide, output: MessageSide) -> list[Data | Loop]:
    """Return the strings and arrays of an input that can be forwarded to the output, in wire order."""
    source = output.length.source if output.length else LengthSource.COMPUTED
    if source is LengthSource.GIVEN and not passes_whole(side, output):
        # A given length requires the same message.
        return []
    given = {node.path: (place, node) for place, node in enumerate(_parts(side.frame))}
    found: list[Data | Loop] = []
    before = -1
    for part in _parts(output.frame):
        place, node = given.get(part.path, (-1, part))
        # A computed length needs the lengths of all parts at the start, but a second part's length follows the first.
        if place <= before or not _is_equal(node, part) or (found and source is LengthSource.COMPUTED):
            continue
        if _is_in_order(side, output, [*found, part]):
            found.append(part)
            before = place
    return found


def _parts(frame: Frame) -> Iterator[Data | Loop]:
    return (node for node in _top(frame) if not isinstance(node, FrameField))


def _is_equal(node: FrameField | Data | Loop, other: FrameField | Data | Loop) -> bool:
    """Whether two parts with the same path have the same ports and legal values."""
    match node, other:
        case FrameField(), FrameField():
            return node.type == other.type
        case Data(), Data():
            return (node.kind, node.element, node.bound) == (other.kind, other.element, other.bound)
    return node == other


def _is_in_order(side: MessageSide, output: MessageSide, parts: Sequence[Data | Loop]) -> bool:
    """Whether all fields that the publisher needs before each part also precede that part at the subscriber."""
    given, needed = segments_of(side.frame), segments_of(output.frame)
    latest = _latest(side, output, parts)
    bounds = ((given.fields[path], latest[needed.fields[path]]) for path in _fields([side], output)[1])
    return all(bound is None or segment <= bound for segment, bound in bounds)


def _latest(side: MessageSide, output: MessageSide, parts: Sequence[Data | Loop]) -> tuple[int | None, ...]:
    """Return, for each segment of the output, the last input segment that it can wait for; None means all segments.

    The input's later segments become valid only after the output has taken the part.
    """
    given, needed = segments_of(side.frame), segments_of(output.frame)
    bounds = [(needed.parts[part.path], given.parts[part.path]) for part in parts]
    return tuple(
        min((bound for place, bound in bounds if place >= number), default=None) for number in range(needed.count)
    )


def _part_ports(frame: Frame, other: Frame, part: Data | Loop) -> Iterator[tuple[str, str, bool]]:
    """Yield the ports of an equal part in both messages, and whether the port is a `ready`."""
    side, opposite = message_side(frame), message_side(other)
    for node in _nested(part):
        if isinstance(node, FrameField):
            yield side.field(node).name, opposite.field(node).name, False
        elif isinstance(node, Data):
            yield from _stream_ports(side.stream(node), opposite.stream(node))
        else:
            yield from _element_ports(side.element(node), opposite.element(node))


def _nested(part: Data | Loop) -> Iterator[Data | Loop | FrameField]:
    """Yield a part, and the used parts and fields of its elements, each once."""
    yield part
    nodes: Sequence[Node] = part.body if isinstance(part, Loop) else ()
    seen: set[Path] = set()
    for node in nodes:
        if isinstance(node, Data | Loop) and node.is_used:
            yield from _nested(node)
        elif isinstance(node, Fixed):
            for leaf in node.fields:
                if leaf.is_used and leaf.count and leaf.path not in seen:
                    seen.add(leaf.path)
                    yield leaf


def _stream_ports(one: StreamPorts, other: StreamPorts) -> Iterator[tuple[str, str, bool]]:
    yield one.length, other.length, False
    for signal in _STREAM_SIGNALS:
        yield one.axis(signal), other.axis(signal), False
    yield one.axis("tready"), other.axis("tready"), True


def _element_ports(one: ElementPorts, other: ElementPorts) -> Iterator[tuple[str, str, bool]]:
    if one.loop.count is None:
        yield one.length, other.length, False
    if has_bytes(one.loop):
        if one.segments is not None:
            yield one.segment_valid, other.segment_valid, False
        yield one.valid, other.valid, False
        yield one.last, other.last, False
        yield one.ready, other.ready, True
