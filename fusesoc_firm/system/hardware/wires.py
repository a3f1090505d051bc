"""The connections of the top level as assignments between signals, as in the dissertation's listing 6.9.

Instances between the signals distribute a message to several blocks or determine the length of a payload.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fusesoc_firm.converter.payload_length import length_entity, length_ports
from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.converter.vhdl import all_of, bit, bits
from fusesoc_firm.system.derived.model import Connection, DerivedSystem, End, LengthSource, PayloadLength
from fusesoc_firm.system.derived.sides import PAYLOAD_LENGTH, Handshake, handshakes, side_ports
from fusesoc_firm.system.hardware.crossing_wires import SourceSide, crossing_configuration, field_pairs
from fusesoc_firm.system.hardware.crossings import Crossing, crossings, port_of
from fusesoc_firm.system.hardware.maps import instance
from fusesoc_firm.system.hardware.names import Names, forked, is_found_out, reset_of

# A 32-bit length.
_LONGEST = 'x"FFFFFFFF"'


def connections(names: Names, system: DerivedSystem) -> list[dict[str, Any]]:
    """Return the assignments of all connections.

    A sink with several sources accepts all message parts in one handshake.
    """
    waiting: dict[End, list[str]] = {}
    for connection in system.connections:
        if connection.frame.is_fixed_size:
            for sink, (valid, _) in zip(connection.sinks, _arriving(names, system, connection), strict=True):
                waiting.setdefault(sink, []).append(valid)
    return [_connection(names, connection, system, waiting) for connection in system.connections]


def _connection(
    names: Names, connection: Connection, system: DerivedSystem, waiting: Mapping[End, list[str]]
) -> dict[str, Any]:
    """Return the assignments of a connection; a fork lets each of several sinks accept the message independently.

    `waiting` maps each sink to the `valid` signals of the sources so far; the sink's `valid` is assigned with the last
    source.
    """
    length = connection.length
    pairs: list[tuple[str, str]] = []
    if _is(LengthSource.BUFFERED, length):
        # The buffer determines the actual length, so the publisher gets the greatest length.
        pairs.append((names.length(connection), _LONGEST))
    if connection.frame.is_fixed_size:
        pairs += _fixed_pairs(names, system, connection, waiting)
    else:
        for number, crossing in enumerate(crossings(system, connection)):
            pairs += _pairs(names, connection, number, system, crossing)
    return {
        "message": str(connection.frame.message),
        "source": connection.source.block,
        "sinks": ", ".join(sink.block for sink in connection.sinks),
        "length_note": f"; its length is {length.source.value}" if length else "",
        "length_signal": {"name": names.length(connection)} if is_found_out(connection) else None,
        "length": _length(names, connection) if _is(LengthSource.COMPUTED, length) else None,
        "forks": [_fork(names, connection, fork, system) for fork in forked(connection)],
        "crossings": [
            crossing_configuration(names, crossing, _source_side(names, connection, number, system))
            for number, crossing in enumerate(crossings(system, connection))
            if crossing
        ],
        "assignments": [{"target": target, "source": value} for target, value in pairs],
    }


def _fixed_pairs(
    names: Names, system: DerivedSystem, connection: Connection, waiting: Mapping[End, list[str]]
) -> Iterator[tuple[str, str]]:
    """Yield the assignments of a message of fixed size."""
    source = connection.source
    arriving = _arriving(names, system, connection)
    for sink, frame, (valid, ready) in zip(connection.sinks, connection.frames, arriving, strict=True):
        yield from ((names.at(sink, port.name), names.at(source, port.name)) for port in field_ports(frame))
        sink_valid, sink_ready = bit(names.at(sink, "segment_valid"), 0), names.at(sink, "msg_ready")
        if valid == waiting[sink][-1]:
            whole = all_of(waiting[sink])
            yield sink_valid, whole
            if sink.prefix:
                yield names.at(sink, "msg_valid"), whole
        yield ready, sink_ready if len(waiting[sink]) == 1 else all_of((sink_ready, sink_valid))


def _arriving(names: Names, system: DerivedSystem, connection: Connection) -> list[tuple[str, str]]:
    """Return the source of `valid` and the target of `ready` for each sink of a message of fixed size."""
    return [
        (names.crossing(crossing, "valid"), names.crossing(crossing, "ready")) if crossing else handshake
        for crossing, handshake in zip(crossings(system, connection), _handshakes(names, connection), strict=True)
    ]


def _handshakes(names: Names, connection: Connection) -> list[tuple[str, str]]:
    """Return the `valid` to and the `ready` from each sink of a message of fixed size, as seen by the source."""
    source = connection.source
    for fork in forked(connection):
        valid, ready = (names.forked(source, fork, word) for word in ("valid", "ready"))
        return [(bit(valid, number), bit(ready, number)) for number in range(len(connection.sinks))]
    return [(bit(names.at(source, "segment_valid"), 0), names.at(source, "msg_ready"))]


def _pairs(
    names: Names, connection: Connection, number: int, system: DerivedSystem, crossing: Crossing | None
) -> list[tuple[str, str]]:
    """Return the assignments of a message of variable size from source to sink, except those that instances replace."""
    sink, source = connection.sinks[number], _source_side(names, connection, number, system)
    if crossing and crossing.is_clocked:
        return list(field_pairs(names, crossing, source))
    pairs = []
    for port in side_ports(connection.frames[number], system.width, gives=True, has_valid=True):
        if crossing and port.name.rpartition("_")[0].endswith("_axis"):
            continue
        at_source, at_sink = source.ports[port.name], names.at(sink, port.name)
        pairs.append((at_sink, at_source) if port.is_output else (at_source, at_sink))
    return pairs


def _source_side(names: Names, connection: Connection, number: int, system: DerivedSystem) -> SourceSide:
    """Return the source's signals for a sink; forked handshakes use the signals of the fork."""
    source = connection.source
    if connection.frame.is_fixed_size:
        valid, ready = _handshakes(names, connection)[number]
        return SourceSide({"segment_valid": valid, "msg_ready": ready}, {})
    ports = {
        port.name: names.length(connection) if port.name == PAYLOAD_LENGTH else names.at(source, port.name)
        for port in side_ports(connection.frames[number], system.width, gives=True, has_valid=True)
    }
    begun = {
        item.part: bit(ports[item.segment_valid], 0) for item in handshakes(connection.frame) if item.segment_valid
    }
    for fork in forked(connection):
        low, high = fork.segments * number, fork.segments * (number + 1) - 1
        ports[fork.valid] = bit(names.forked(source, fork, "valid"), number)
        ports[fork.ready] = bit(names.forked(source, fork, "ready"), number)
        if fork.segment_valid is not None:
            segment_valid = names.forked(source, fork, "segment_valid")
            ports[fork.segment_valid] = bits(segment_valid, high, low)
            begun[fork.part] = bit(segment_valid, low)
    return SourceSide(ports, begun)


def _length(names: Names, connection: Connection) -> dict[str, Any]:
    """Return the instance that computes the length of an accelerator's payloads."""
    source = connection.source
    inputs = ((formal, names.at(source, formal)) for formal in length_ports(connection.frame))
    return instance(
        names.label(source.block, source.prefix, "length"),
        f"entity work.{length_entity(connection.frame, connection.length.suffix if connection.length else '')}",
        [*inputs, (PAYLOAD_LENGTH, names.length(connection))],
    )


def _fork(names: Names, connection: Connection, fork: Handshake, system: DerivedSystem) -> dict[str, Any]:
    source, count = connection.source, len(connection.sinks)
    clock = system.clock_of(source.block)
    source_valid = names.at(source, fork.valid)
    generics, signals = [("SINKS", count)], [(names.forked(source, fork, word), count) for word in ("valid", "ready")]
    ports = [
        ("clk", port_of(clock)),
        ("rst_n", reset_of(clock)),
        ("source_valid", bit(source_valid, 0) if connection.frame.is_fixed_size else source_valid),
        ("source_ready", names.at(source, fork.ready)),
    ]
    sinks = [("sink_valid", signals[0][0]), ("sink_ready", signals[1][0])]
    if fork.segment_valid is not None:
        segment_valid = names.forked(source, fork, "segment_valid")
        generics.append(("SEGMENTS", fork.segments))
        signals.append((segment_valid, count * fork.segments))
        ports.append(("source_segment_valid", names.at(source, fork.segment_valid)))
        sinks.append(("sink_segment_valid", segment_valid))
    return {
        "signals": [{"name": name, "bits": width} for name, width in signals],
        **instance(names.fork(source, fork), "entity firm.firm_message_fork", [*ports, *sinks], generics),
    }


def _is(source: LengthSource, length: PayloadLength | None) -> bool:
    return length is not None and length.source is source
