"""The merges and queues between connections: instances that see all fields or levels of a message as one word."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

from fusesoc_firm.converter.vhdl import bit, bits
from fusesoc_firm.system.derived.model import DerivedSystem, Junction, Overflow
from fusesoc_firm.system.derived.sides import SidePort, handshakes
from fusesoc_firm.system.hardware.maps import instance
from fusesoc_firm.system.hardware.names import DROPPED, OWN_RESET, Names, given_ports, is_counted

_CLOCK = (("clk", "clk"), ("rst_n", OWN_RESET))
# The level of a message without fields.
_UNUSED = "'0'"
_READY, _SEGMENTS = "msg_ready", "segment_valid"


def junction_configuration(names: Names, junction: Junction, system: DerivedSystem) -> dict[str, Any]:
    """Return a merge or a queue, with its signals and the assignments between these and its ports."""
    ports = _Ports(given_ports(junction, system.width), junction)
    make = _merge if junction.sources > 1 else partial(_queue, has_events=is_counted(junction, system))
    topic = f" of topic {junction.topic}" if junction.topic else ""
    return {"block": junction.block, "message": f"{junction.frame.message}{topic}", **make(names, junction, ports)}


class _Ports:
    """The ports of a message by their use: fields and data, levels that offer, and levels that take."""

    def __init__(self, ports: Iterable[SidePort], junction: Junction) -> None:
        found = {port.name: port for port in ports}
        pairs = [] if junction.frame.is_fixed_size else [*handshakes(junction.frame)]
        nested = [item for item in pairs if item.part]
        # The lowest level is the first segment, the highest one the complete message.
        offers = [_SEGMENTS, *(word for item in nested for word in (item.valid, item.segment_valid) if word)]
        offers += [item.valid for item in pairs if not item.part]
        takes = [_READY, *(item.ready for item in nested)]
        self.offers = [found[name] for name in offers]
        self.takes = [found[name] for name in takes]
        self.fields = [port for name, port in found.items() if name not in offers and name not in takes]


def _merge(names: Names, junction: Junction, ports: _Ports) -> dict[str, Any]:
    kinds = {"fields": ports.fields, "offers": ports.offers, "takes": ports.takes}
    sizes = {word: max(1, _bits(found)) for word, found in kinds.items()}
    inputs, output = junction.inputs, junction.output
    signals, pairs = [], []
    for word, found in kinds.items():
        source, sink = (names.joined(junction, f"{side}_{word}") for side in ("source", "sink"))
        signals += [{"name": source, "bits": len(inputs) * sizes[word]}, {"name": sink, "bits": sizes[word]}]
        for number, side in enumerate(inputs):
            own = _slices(found, source, number * sizes[word])
            ways = [(target, names.port(junction.block, f"{side.prefix}{name}")) for target, name in own]
            pairs += [(port, part) for part, port in ways] if word == "takes" else ways
            if not found:
                pairs.append((bit(source, number), _UNUSED))
        ways = [(names.port(junction.block, f"{output.prefix}{name}"), part) for part, name in _slices(found, sink, 0)]
        pairs += [(part, port) for port, part in ways] if word == "takes" else ways
    generics = [("SOURCES", len(inputs)), ("FIELD_BITS", sizes["fields"])]
    generics += [("OFFERS", sizes["offers"]), ("TAKES", sizes["takes"])]
    formals = [f"{side}_{word}" for side in ("source", "sink") for word in kinds]
    return {
        "signals": signals,
        "assignments": [{"target": target, "source": source} for target, source in pairs],
        **instance(
            names.label(junction.block),
            "entity firm.firm_message_merge",
            [*_CLOCK, *((formal, names.joined(junction, formal)) for formal in formals)],
            generics,
        ),
    }


def _queue(names: Names, junction: Junction, ports: _Ports, *, has_events: bool) -> dict[str, Any]:
    (given,), taken = junction.inputs, junction.output
    size = max(1, _bits(ports.fields))
    source, sink = (names.joined(junction, f"{side}_fields") for side in ("source", "sink"))
    pairs = [
        (part, names.port(junction.block, f"{given.prefix}{name}")) for part, name in _slices(ports.fields, source, 0)
    ]
    pairs += [] if ports.fields else [(bit(source, 0), _UNUSED)]
    pairs += [
        (names.port(junction.block, f"{taken.prefix}{name}"), part) for part, name in _slices(ports.fields, sink, 0)
    ]
    drop = [] if junction.overflow is Overflow.BLOCK else [(junction.overflow.value.upper(), "true")]
    levels = []
    for side, prefix in (("source", given.prefix), ("sink", taken.prefix)):
        levels += [
            (f"{side}_fields", names.joined(junction, f"{side}_fields")),
            (f"{side}_valid", bit(names.port(junction.block, f"{prefix}{_SEGMENTS}"), 0)),
            (f"{side}_ready", names.port(junction.block, f"{prefix}{_READY}")),
        ]
    events = [names.joined(junction, DROPPED)] if has_events else []
    return {
        "signals": [
            *({"name": name, "bits": size} for name in (source, sink)),
            *({"name": name, "bits": 1} for name in events),
        ],
        "assignments": [{"target": target, "source": value} for target, value in pairs],
        **instance(
            names.label(junction.block),
            "entity firm.firm_message_queue",
            [*_CLOCK, *levels, *((DROPPED, bit(name, 0)) for name in events)],
            [("FIELD_BITS", size), ("MESSAGES", junction.depth), *drop],
        ),
    }


def _bits(ports: Iterable[SidePort]) -> int:
    return sum(port.width or 1 for port in ports)


def _slices(ports: Iterable[SidePort], signal: str, low: int) -> Iterator[tuple[str, str]]:
    """Yield the part of a signal for each port, from bit `low` on, and the name of the port."""
    for port in ports:
        width = port.width or 1
        yield bit(signal, low) if port.width is None else bits(signal, low + width - 1, low), port.name
        low += width
