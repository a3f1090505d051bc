"""A crossing in the top level: instances between the signals of a connection's two ends."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.system.crossings import Crossing, Scope, parts_of, port_of, word
from fusesoc_firm.system.derived import Clock
from fusesoc_firm.system.maps import port_map
from fusesoc_firm.system.names import AXIS, RELEASED, Names

Pairs = list[tuple[str, str]]


@dataclass(frozen=True)
class SourceSide:
    """What a connection shows one of its sinks.

    `ports` are the signals by port of the message side, `begun` those that tell by part that a message or an element is
    there.
    """

    ports: Mapping[str, str]
    begun: Mapping[str, str]


def crossing_configuration(names: Names, crossing: Crossing, source: SourceSide) -> dict[str, Any]:
    """The comment, signals and instances of a crossing."""
    ends = f"{crossing.source.block} to {crossing.sink.block}"
    declared = [(names.crossing(crossing, name), vhdl_type(bits)) for name, bits in crossing.signals()]
    column = max((len(name) for name, _ in declared), default=0)
    return {
        "ends": ends,
        "difference": ", ".join(filter(None, (crossing.clocks, crossing.widths))),
        "has_signals": bool(declared),
        "signals": [{"name": name.ljust(column), "type": type_} for name, type_ in declared],
        "notes": _notes(crossing),
        "instances": list(_instances(names, crossing, source)),
    }


def field_pairs(names: Names, crossing: Crossing, source: SourceSide) -> Iterator[tuple[str, str]]:
    """The assignments of the fields of a message of variable size to and from what holds them."""
    for scope in crossing.scopes:
        given, taken = (names.crossing(crossing, word(scope.handshake.part, name)) for name in ("given", "taken"))
        low = 0
        for port, width in scope.fields:
            bits = f"({low})" if width is None else f"({low + width - 1} downto {low})"
            low += width or 1
            yield f"{given}{bits}", source.ports[port]
            yield names.at(crossing.sink, port), f"{taken}{bits}"


def _notes(crossing: Crossing) -> list[dict[str, str]]:
    """Which paths an implementation must know of."""
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
    return [{"line": line} for line in lines]


def _instances(names: Names, crossing: Crossing, source: SourceSide) -> Iterator[dict[str, Any]]:
    for scope in crossing.scopes:
        if crossing.is_clocked:
            yield _message(names, crossing, scope, source)
        if crossing.is_clocked or crossing.widths:
            yield from (_stream(names, crossing, scope, stream, source) for stream in scope.streams)


def _message(names: Names, crossing: Crossing, scope: Scope, source: SourceSide) -> dict[str, Any]:
    """The handshake and the fields of a scope."""
    if crossing.frame.is_fixed_size:
        generics: Pairs = []
        s_side, m_side = _fixed_ports(names, crossing, source)
    else:
        generics = [("FIELD_BITS", str(scope.bits))]
        s_side, m_side = _variable_ports(names, crossing, scope, source)
    if scope.handshake.segments > 1:
        generics.insert(0, ("SEGMENTS", str(scope.handshake.segments)))
    if len(parts_of(scope, crossing.scopes)) > 1:
        generics.append(("PARTS", str(len(parts_of(scope, crossing.scopes)))))
    return {
        "label": names.crossing_label(crossing, word(scope.handshake.part, "crossing")),
        "entity": "firm_cdc_message",
        "generics": {"lines": port_map(generics)} if generics else None,
        "ports": port_map([*_domain("s", crossing.source_clock), *s_side, *_domain("m", crossing.sink_clock), *m_side]),
    }


def _fixed_ports(names: Names, crossing: Crossing, source: SourceSide) -> tuple[Pairs, Pairs]:
    """Of a message of fixed size: its fields hold at the source, and it comes as a whole."""
    valid = source.ports["segment_valid"]
    s_side = [
        ("s_segment_valid(0)", valid),
        ("s_valid", valid),
        ("s_ready", source.ports["msg_ready"]),
        ("s_settled", "open"),
        ("s_idle", "open"),
    ]
    m_side = [
        ("m_fields", "open"),
        ("m_segment_valid", "open"),
        *((f"m_{name}", names.crossing(crossing, name)) for name in ("valid", "ready")),
    ]
    return s_side, m_side


def _variable_ports(names: Names, crossing: Crossing, scope: Scope, source: SourceSide) -> tuple[Pairs, Pairs]:
    handshake, part, sink = scope.handshake, scope.handshake.part, crossing.sink
    inner = parts_of(scope, crossing.scopes)
    s_side: Pairs = []
    m_side: Pairs = []
    if scope.parent:
        s_side.append(("s_enable", names.crossing(crossing, word(scope.parent.part, "settled"))))
        m_side.append(("m_enable", f"{names.at(sink, scope.parent.segment_valid or '')}(0)"))
    s_side.append(("s_fields", names.crossing(crossing, word(part, "given"))))
    m_side.append(("m_fields", names.crossing(crossing, word(part, "taken"))))
    if handshake.segment_valid:
        s_side.append(("s_segment_valid", source.ports[handshake.segment_valid]))
        m_side.append(("m_segment_valid", names.at(sink, handshake.segment_valid)))
    else:
        s_side.append(("s_segment_valid(0)", source.ports[handshake.valid]))
        m_side.append(("m_segment_valid", "open"))
    s_side += [
        ("s_valid", source.ports[handshake.valid]),
        ("s_ready", source.ports[handshake.ready]),
        ("s_settled", names.crossing(crossing, word(part, "settled")) if inner else "open"),
        ("s_idle", names.crossing(crossing, word(part, "idle")) if scope.parent else "open"),
        *((f"s_part_idle({place})", names.crossing(crossing, name)) for place, name in enumerate(inner)),
    ]
    m_side += [("m_valid", names.at(sink, handshake.valid)), ("m_ready", names.at(sink, handshake.ready))]
    return s_side, m_side


def _stream(names: Names, crossing: Crossing, scope: Scope, stream: str, source: SourceSide) -> dict[str, Any]:
    """A stream of a scope, from clock to clock or from width to width."""
    part, sink = scope.handshake.part, crossing.sink
    s_axis = [(f"s_axis_{name}", source.ports[f"{stream}_axis_{name}"]) for name in AXIS]
    m_axis = [(f"m_axis_{name}", names.at(sink, f"{stream}_axis_{name}")) for name in AXIS]
    begun = source.begun[part]
    if crossing.is_clocked:
        ports = [
            *_domain("s", crossing.source_clock),
            ("s_open", begun),
            ("s_enable", names.crossing(crossing, word(part, "settled"))),
            ("s_idle", names.crossing(crossing, word(f"{stream}_axis", "idle"))),
            *s_axis,
            *_domain("m", crossing.sink_clock),
            ("m_open", f"{names.at(sink, scope.handshake.segment_valid or '')}(0)"),
            *m_axis,
        ]
    else:
        clock = crossing.source_clock
        reset = clock.reset if clock else "rst_n"
        ports = [("clk", port_of(clock)), ("rst_n", reset), ("is_open", begun), *s_axis, *m_axis]
    generics = [("S_WIDTH", str(crossing.source_width)), ("M_WIDTH", str(crossing.sink_width))]
    return {
        "label": names.crossing_label(crossing, word(f"{stream}_axis", "crossing")),
        "entity": "firm_cdc_stream" if crossing.is_clocked else "firm_axis_resize",
        "generics": {"lines": port_map(generics)},
        "ports": port_map(ports),
    }


def _domain(side: str, clock: Clock | None) -> Pairs:
    """Clock and reset of a side; what is of the system's clock waits until all domains have been reset."""
    return [(f"{side}_clk", port_of(clock)), (f"{side}_rst_n", clock.reset if clock else RELEASED)]
