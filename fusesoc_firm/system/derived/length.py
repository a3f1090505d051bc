"""Determine the source of each payload's length, and the publishers that must store whole frames.

A payload's length must be known before the payload is sent. The length is computed from the lengths of the parts,
provided by the accelerator, or counted in a buffer after the publisher. Publishers that share a source stream also have
buffers: only one publisher sends at a time, so without buffers the others would block the stream forever.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from fusesoc_firm.frame.length import Length, Repeat, sent_length_of
from fusesoc_firm.frame.model import Data, Frame, Loop, all_nodes
from fusesoc_firm.frame.select import names_in_use, select
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.system.derived.bypass import passing_hint
from fusesoc_firm.system.derived.model import Connection, End, LengthSource, MessageSide, PayloadLength
from fusesoc_firm.system.written.specification import Block, OutputType
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.naming import identifier

# More than the on-chip memory of any FPGA.
_LARGEST_BUFFER = 2**24
_ADD_BUFFER = "add 'buffer: <bytes of the longest payload>'"


def with_lengths(
    connections: Sequence[Connection],
    outputs: Mapping[str, Sequence[MessageSide]],
    blocks: Mapping[str, Block],
    faults: Diagnostics,
) -> tuple[Connection, ...]:
    """Return the connections, each with the source of its payload's length; note faults."""
    found: list[Connection] = []
    suffixes: dict[Frame, str] = {}
    for connection in connections:
        if connection.frame.is_fixed_size:
            found.append(connection)
            continue
        source = connection.source
        (side,) = (side for side in outputs[source.block] if side.prefix == source.prefix)
        _check_whole(connection, side, connections, blocks, faults)
        is_sent = any(blocks[sink.block].type is None for sink in connection.sinks)
        length = side.length or _subscriber_length(connection.frame, is_sent=is_sent)
        if connection.frame != select(connection.frame):
            # Outputs with the same parts share the entity of the first one.
            suffix = suffixes.setdefault(connection.frame, f"_{identifier(source.block).lower()}")
            length = replace(length, suffix=suffix)
        found.append(replace(connection, length=length))
    return tuple(found)


def _check_whole(
    connection: Connection,
    side: MessageSide,
    connections: Sequence[Connection],
    blocks: Mapping[str, Block],
    faults: Diagnostics,
) -> None:
    """Note a fault if a message of variable size is split, since its segment boundaries depend on the fields."""
    names = [names_in_use(frame) for frame in connection.frames]
    whole = names[0] if blocks[connection.source.block].type is None else names_in_use(side.frame)
    message = connection.frame.message
    for end, given in zip(connection.sinks, names, strict=True):
        place = blocks[end.block].name.source
        if given != whole:
            apart = ", ".join(f"'{dotted(name)}'" for name in sorted(given ^ whole))
            text = (
                f"'{end.block}' takes different fields of {message} than '{connection.source.block}' outputs: {apart}"
            )
            hint = "all blocks that take a message of variable size must take the same fields"
            type_ = blocks[end.block].type
            faults.error(text, place, f"{hint}; {passing_hint(type_)}" if type_ else hint)
        if sum(end in other.sinks for other in connections) > 1:
            text = f"'{end.block}' receives {message} from several blocks"
            faults.error(text, place, "a message of variable size must come from one block")


def _subscriber_length(frame: Frame, *, is_sent: bool) -> PayloadLength:
    """Return the source of the length of a subscriber's output.

    The received length is the length of the whole message. An accelerator can always use it. If a forwarded message
    (`is_sent`) lacks some parts, its length differs.
    """
    unused = [node for node in all_nodes(frame.nodes) if isinstance(node, Data | Loop) and not node.is_used]
    if not unused or not is_sent:
        return PayloadLength(LengthSource.GIVEN, "the subscriber has the length")
    length = sent_length_of(frame)
    if length.minimum == length.maximum:
        return PayloadLength(LengthSource.COMPUTED, "the length is constant without the unused parts")
    names = ", ".join(dict.fromkeys(f"'{dotted(node.names)}'" for node in unused))
    return PayloadLength(LengthSource.BUFFERED, f"the subscriber's length includes {names}, which no block uses")


def output_length(item: OutputType, frame: Frame, faults: Diagnostics) -> PayloadLength | None:
    """Return the source for the length of an accelerator's output, or None if it is constant or faulty."""
    if frame.is_fixed_size:
        if item.length is not None:
            message = f"'length' is set for {frame.message}, which has a fixed size"
            faults.error(message, item.length.source, "remove the key: the length is constant")
        return None
    length = sent_length_of(frame)
    if item.length == LengthSource.COMPUTED.value and not length.is_computed:
        message = f"the length of {frame.message} cannot be computed: {_doubt(length)}"
        faults.error(message, item.length.source, "legal here: given, buffered")
        return None
    if item.length is not None:
        return PayloadLength(LengthSource(item.length), "the specification selects this source")
    if length.is_computed:
        return PayloadLength(LengthSource.COMPUTED, "the lengths at the output's ports determine the payload's length")
    return PayloadLength(LengthSource.BUFFERED, _doubt(length))


def publisher_buffers(
    connections: Sequence[Connection], publishers: Mapping[str, Block], merges: Collection[str], faults: Diagnostics
) -> dict[str, int]:
    """Return the buffer size, in bytes of payload, of each publisher that stores whole frames."""
    needs = _needs(connections, publishers, merges)
    buffers: dict[str, int] = {}
    for connection in connections:
        for end in connection.sinks:
            if end.block in publishers:
                block = publishers[end.block]
                size = _buffer(block, connection.frame, needs.get(end.block), faults)
                if size is not None:
                    buffers[end.block] = size
    return buffers


@dataclass(frozen=True)
class _Need:
    """The reason why a publisher must store its frames, and possible remedies."""

    reason: str
    hint: str


def _buffer(block: Block, frame: Frame, need: _Need | None, faults: Diagnostics) -> int | None:
    """Return the size of a publisher's buffer in bytes, or None without a buffer; note faults."""
    if frame.is_fixed_size:
        if block.buffer is not None:
            message = f"'{block.name}' has a 'buffer', but {frame.message} has a fixed size"
            faults.error(message, block.place("buffer"), "remove the key: only messages of variable size are stored")
        return None
    length = sent_length_of(frame)
    size = block.buffer
    if size is None and need and length.maximum is not None and length.maximum <= _LARGEST_BUFFER:
        size = length.maximum
    if size is None and need:
        faults.error(f"'{block.name}' needs a 'buffer': {need.reason}", block.name.source, need.hint)
    elif size is not None and not length.minimum <= size <= _LARGEST_BUFFER:
        message = f"'{block.name}' cannot have a buffer of {size} bytes for {frame.message}"
        faults.error(message, block.place("buffer"), f"legal here: {length.minimum} to {_LARGEST_BUFFER}")
    return size


def _needs(
    connections: Sequence[Connection], publishers: Mapping[str, Block], merges: Collection[str]
) -> dict[str, _Need]:
    """Return the publishers that must store their frames, each with the reason."""
    needs: dict[str, _Need] = {}
    for connection in connections:
        if connection.length is None:
            continue
        if len(connection.sinks) > 1:
            behind = blocks_behind(connection.sinks, connections)
            waiting = [name for name in publishers if name in behind]
            if len(waiting) == 1 and not behind.isdisjoint(merges):
                reason = f"its streams also wait where the message of '{connection.source.block}' meets others"
                needs = dict.fromkeys(waiting, _Need(reason, _ADD_BUFFER)) | needs
            if len(waiting) > 1:
                names = ", ".join(f"'{name}'" for name in waiting)
                reason = f"{names} wait for the same streams, but only one of them can send at a time"
                needs = dict.fromkeys(waiting, _Need(reason, _ADD_BUFFER)) | needs
        if connection.length.source is LengthSource.BUFFERED:
            source = connection.source.block
            reason = f"the length of the message from '{source}' must be counted, because {connection.length.reason}"
            hint = f"{_ADD_BUFFER}, or add 'length: given' to the output of '{source}' if a port provides the length"
            counted = (end.block for end in connection.sinks if end.block in publishers)
            needs |= dict.fromkeys(counted, _Need(reason, hint))
    return needs


def blocks_behind(ends: Iterable[End], connections: Sequence[Connection]) -> set[str]:
    """Return all blocks that messages of variable size reach from `ends`, including `ends`."""
    found: set[str] = set()
    for end in ends:
        found.add(end.block)
        for connection in connections:
            if connection.source.block == end.block and connection.length is not None:
                found |= blocks_behind(connection.sinks, connections)
    return found


def _doubt(length: Length) -> str:
    """Return the reason why the lengths at the ports do not determine the payload's length."""
    outer = next(term for term in length.terms if isinstance(term, Repeat) and term.stride is None)
    inner = next(term for term in outer.body if isinstance(term, Repeat))
    name = "" if inner.part.path == outer.part.path else f", '{dotted(inner.part.names)}'"
    return f"each element of '{dotted(outer.part.names)}' has a separate length{name}"
