"""The instances of a crossing between the signals of a connection's two ends."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.converter.vhdl import bit, bits, vhdl_type
from fusesoc_firm.system.hardware.crossings import Crossing, Scope, parts_of, port_of, word
from fusesoc_firm.system.hardware.names import AXIS, RELEASED, Names, reset_of


@dataclass(frozen=True)
class SourceSide:
    """The signals that a connection offers to one of its sinks.

    `ports` maps each port of the message side to a signal. `begun` maps each part to the signal that marks a message or
    an element as present.
    """

    ports: Mapping[str, str]
    begun: Mapping[str, str]


def crossing_configuration(names: Names, crossing: Crossing, source: SourceSide) -> dict[str, Any]:
    """Return the comment, the signals and the instances of a crossing."""
    ends = f"{crossing.source.block} to {crossing.sink.block}"
    return {
        "ends": ends,
        "difference": ", ".join(filter(None, (crossing.clocks, crossing.widths))),
        "signals": [
            {"name": names.crossing(crossing, name), "type": vhdl_type(width)} for name, width in crossing.signals()
        ],
        "notes": _notes(crossing),
        "instances": list(_instances(names, crossing, source)),
    }


def field_pairs(names: Names, crossing: Crossing, source: SourceSide) -> Iterator[tuple[str, str]]:
    """Yield the assignments between the fields of a message of variable size and the registers that hold them."""
    for scope in crossing.scopes:
        given, taken = (names.crossing(crossing, word(scope.handshake.part, name)) for name in ("given", "taken"))
        low = 0
        for port, width in scope.fields:
            yield _part(given, low, width), source.ports[port]
            yield names.at(crossing.sink, port), _part(taken, low, width)
            low += width or 1


def _part(vector: str, low: int, width: int | None) -> str:
    return bit(vector, low) if width is None else bits(vector, low + width - 1, low)


def _notes(crossing: Crossing) -> list[str]:
    """Return comments on the paths that an implementation must constrain."""
    if not crossing.is_clocked:
        return []
    fields = "every field" if crossing.frame.is_fixed_size else "fields_r"
    lines = [
        f"max delay of a cycle of {port_of(crossing.sink_clock)}: {fields}, request_r",
        f"max delay of a cycle of {port_of(crossing.source_clock)}: answer_r",
    ]
    if any(scope.streams for scope in crossing.scopes):
        lines[0] += ", and the streams' write_gray_r, memory"
        lines[1] += ", and the streams' read_gray_r"
    return lines


def _instances(names: Names, crossing: Crossing, source: SourceSide) -> Iterator[dict[str, Any]]:
    """Yield the instances of a crossing, for messages and streams: between two clocks, or between two widths."""
    kinds = ("message", "stream", "resize")
    for scope in crossing.scopes:
        found = [("message", _message(names, crossing, scope, source))] if crossing.is_clocked else []
        if crossing.is_clocked or crossing.widths:
            kind = "stream" if crossing.is_clocked else "resize"
            found += [(kind, _stream(names, crossing, scope, stream, source)) for stream in scope.streams]
        yield from ({**dict.fromkeys(kinds), kind: instance} for kind, instance in found)


def _message(names: Names, crossing: Crossing, scope: Scope, source: SourceSide) -> dict[str, Any]:
    """Return the instance for the handshake and the fields of a scope."""
    inner = parts_of(scope, crossing.scopes)
    generics = [] if scope.handshake.segments < 2 else [("SEGMENTS", scope.handshake.segments)]
    generics += [] if crossing.frame.is_fixed_size else [("FIELD_BITS", scope.bits)]
    generics += [] if len(inner) < 2 else [("PARTS", len(inner))]
    sides = _fixed_sides if crossing.frame.is_fixed_size else _variable_sides
    return {
        "label": names.crossing_label(crossing, word(scope.handshake.part, "crossing")),
        "generics": [{"formal": formal, "actual": actual} for formal, actual in generics],
        "domains": _domains(crossing),
        **sides(names, crossing, scope, source),
        "parts": [{"place": place, "idle": names.crossing(crossing, name)} for place, name in enumerate(inner)],
    }


def _fixed_sides(names: Names, crossing: Crossing, _: Scope, source: SourceSide) -> dict[str, Any]:
    """Return the sides of a message of fixed size, which crosses as a whole; its fields are stable at the source."""
    valid = source.ports["segment_valid"]
    return {
        "is_one_segment": True,
        "s": {
            "enable": "",
            "fields": "",
            "segment_valid": valid,
            "valid": valid,
            "ready": source.ports["msg_ready"],
            "settled": "open",
            "idle": "open",
        },
        "m": {
            "enable": "",
            "fields": "open",
            "segment_valid": "open",
            **{name: names.crossing(crossing, name) for name in ("valid", "ready")},
        },
    }


def _variable_sides(names: Names, crossing: Crossing, scope: Scope, source: SourceSide) -> dict[str, Any]:
    """Return the sides of a message or element of variable size.

    Registers hold its fields until all nested parts have crossed.
    """
    handshake, parent, sink = scope.handshake, scope.parent, crossing.sink
    has_inner = bool(parts_of(scope, crossing.scopes))
    own = {name: names.crossing(crossing, word(handshake.part, name)) for name in ("given", "taken")}
    segment_valid = handshake.segment_valid
    return {
        "is_one_segment": not segment_valid,
        "s": {
            "enable": names.crossing(crossing, word(parent.part, "settled")) if parent else "",
            "fields": own["given"],
            "segment_valid": source.ports[segment_valid or handshake.valid],
            "valid": source.ports[handshake.valid],
            "ready": source.ports[handshake.ready],
            "settled": names.crossing(crossing, word(handshake.part, "settled")) if has_inner else "open",
            "idle": names.crossing(crossing, word(handshake.part, "idle")) if parent else "open",
        },
        "m": {
            "enable": bit(names.at(sink, parent.segment_valid or ""), 0) if parent else "",
            "fields": own["taken"],
            "segment_valid": names.at(sink, segment_valid) if segment_valid else "open",
            "valid": names.at(sink, handshake.valid),
            "ready": names.at(sink, handshake.ready),
        },
    }


def _stream(names: Names, crossing: Crossing, scope: Scope, stream: str, source: SourceSide) -> dict[str, Any]:
    """Return the instance for a stream within a scope."""
    part, sink = scope.handshake.part, crossing.sink
    found = {
        "label": names.crossing_label(crossing, word(f"{stream}_axis", "crossing")),
        "s_width": crossing.source_width,
        "m_width": crossing.sink_width,
        "domains": _domains(crossing),
        "begun": source.begun[part],
        "s_axis": {name: source.ports[f"{stream}_axis_{name}"] for name in AXIS},
        "m_axis": {name: names.at(sink, f"{stream}_axis_{name}") for name in AXIS},
    }
    if crossing.is_clocked:
        found["enable"] = names.crossing(crossing, word(part, "settled"))
        found["idle"] = names.crossing(crossing, word(f"{stream}_axis", "idle"))
        found["m_open"] = bit(names.at(sink, scope.handshake.segment_valid or ""), 0)
    return found


def _domains(crossing: Crossing) -> dict[str, str]:
    """Return the clock and reset of each side; logic on the system's clock waits until all domains have been reset."""
    found = {}
    for side, clock in (("s", crossing.source_clock), ("m", crossing.sink_clock)):
        found[f"{side}_clock"] = port_of(clock)
        found[f"{side}_reset"] = RELEASED if crossing.is_clocked and not clock else reset_of(clock)
    return found
