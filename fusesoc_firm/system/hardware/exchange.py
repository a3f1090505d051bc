"""The exchange as plain data: the unit around the routers, and its instance in the top level.

The unit has the fields of all messages as one word in each direction. `firm_message_send` makes frames of a publisher's
messages, one for each destination, and `firm_message_receive` makes messages of the frames to a reader.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.converter.vhdl import bit, bits, index_bits
from fusesoc_firm.system.derived.exchange import field_bits
from fusesoc_firm.system.derived.model import DerivedSystem, End, Exchange, Junction
from fusesoc_firm.system.hardware.maps import instance
from fusesoc_firm.system.hardware.names import (
    DROPPED,
    EXCHANGE,
    EXCHANGE_EVENTS,
    EXCHANGE_WORDS,
    OWN_RESET,
    Names,
    is_counted,
)
from fusesoc_firm.text.render import Context

EXCHANGE_TEMPLATE = "vhdl/system_exchange.vhd"
_CLOCK = [("clk", "clk"), ("rst_n", "rst_n")]
# A word without fields has one unused bit.
_UNUSED = "'0'"


def exchange_entity(system: DerivedSystem) -> str:
    """Return the name of the unit with the routers, publishers and readers."""
    return f"{system.entity}_exchange"


def routers_entity(system: DerivedSystem) -> str:
    """Return the name of the unit with the routers."""
    return f"{system.entity}_routers"


@dataclass(frozen=True)
class _Word:
    """A message among those of all endpoints in one direction: its endpoint, its number and its lowest bit."""

    end: int
    block: str
    side: End
    junction: Junction
    number: int
    low: int

    @property
    def high(self) -> int:
        return self.low + max(1, field_bits(self.junction.frame)) - 1


class _Words:
    """The messages that enter and leave the exchange."""

    def __init__(self, system: DerivedSystem, exchange: Exchange) -> None:
        self._junctions = {item.block: item for item in system.junctions}
        ends = list(enumerate(exchange.ends))
        self.sources = self._words([(number, item.block, item.source) for number, item in ends if item.source])
        self.sinks = self._words([(number, item.block, item.sink) for number, item in ends if item.sink])

    def _words(self, ends: Sequence[tuple[int, str, End]]) -> list[_Word]:
        found: list[_Word] = []
        for number, (end, block, side) in enumerate(ends):
            low = found[-1].high + 1 if found else 0
            found.append(_Word(end, block, side, self._junctions[side.block], number, low))
        return found


def exchange_instance(names: Names, system: DerivedSystem) -> list[Context]:
    """Return the instance of the exchange in the top level, with its signals and assignments, if there is one."""
    if not system.exchange:
        return []
    words = _Words(system, system.exchange)
    signals = {word: names.exchange(word) for word in EXCHANGE_WORDS}
    sizes = {
        f"{side}_{kind}": found[-1].high + 1 if kind == "fields" else len(found)
        for side, found in (("source", words.sources), ("sink", words.sinks))
        for kind in ("fields", "valid", "ready")
    }
    pairs: list[tuple[str, str]] = []
    for word in words.sources:
        pairs += [(part, port) for part, port in _fields(names, word, signals["source_fields"])]
        pairs.append((bit(signals["source_valid"], word.number), bit(names.at(word.side, "segment_valid"), 0)))
        pairs.append((names.at(word.side, "msg_ready"), bit(signals["source_ready"], word.number)))
    for word in words.sinks:
        pairs += [(port, part) for part, port in _fields(names, word, signals["sink_fields"]) if port != _UNUSED]
        pairs.append((bit(names.at(word.side, "segment_valid"), 0), bit(signals["sink_valid"], word.number)))
        pairs.append((bit(signals["sink_ready"], word.number), names.at(word.side, "msg_ready")))
    events = EXCHANGE_EVENTS if system.status else ()
    signals |= {word: names.exchange(word) for word in events}
    sizes |= dict.fromkeys(events, len(system.exchange.ends))
    pairs += [] if not events else [(bit(signals["dropped"], end), source) for end, source in _dropped(names, system)]
    ports = [(word, signal) for word, signal in signals.items() if word != "dropped"]
    topics = dict.fromkeys(word.junction.topic for word in words.sources)
    return [
        {
            "block": "the exchange",
            "message": f"topics in the exchange: {', '.join(topics)}",
            "signals": [{"name": signals[word], "bits": sizes[word]} for word in sizes],
            "assignments": [{"target": target, "source": source} for target, source in pairs],
            **instance(
                names.label(*EXCHANGE),
                f"entity work.{exchange_entity(system)}",
                [("clk", "clk"), ("rst_n", OWN_RESET), *ports],
            ),
        }
    ]


def _dropped(names: Names, system: DerivedSystem) -> Iterator[tuple[int, str]]:
    """Yield for each endpoint the signal that its reader's queue drops a message, if it does."""
    assert system.exchange
    sinks = {item.source: item.sinks for item in system.connections}
    queues = {item.block: item for item in system.junctions if is_counted(item, system)}
    for number, end in enumerate(system.exchange.ends):
        after = [queues[sink.block] for sink in (sinks.get(end.sink, ()) if end.sink else ()) if sink.block in queues]
        yield number, bit(names.joined(after[0], DROPPED), 0) if after else _UNUSED


def _fields(names: Names, word: _Word, signal: str) -> Iterator[tuple[str, str]]:
    """Yield the part of a signal for each field of a message, with the field's signal."""
    low = word.low
    for port in field_ports(word.junction.frame):
        width = port.width or 1
        part = bit(signal, low) if port.width is None else bits(signal, low + width - 1, low)
        yield part, names.at(word.side, port.name)
        low += width
    if low == word.low:
        yield bit(signal, low), _UNUSED


def exchange_unit(system: DerivedSystem) -> Context:
    """Return the configuration of the unit with the routers, publishers and readers."""
    assert system.exchange is not None
    return _Unit(system, system.exchange).context()


@dataclass(frozen=True)
class _Unit:
    system: DerivedSystem
    exchange: Exchange

    @cached_property
    def _words(self) -> _Words:
        return _Words(self.system, self.exchange)

    @cached_property
    def _dest_bits(self) -> int:
        """The bits of a destination, 0 if each source has only one."""
        most = self.exchange.network.destinations
        return index_bits(most) if most > 1 else 0

    def context(self) -> Context:
        """Return the data of the template."""
        words, width, count = self._words, self.system.width, len(self.exchange.ends)
        return {
            "entity": exchange_entity(self.system),
            "name": self.system.name,
            "topology": described(self.exchange),
            "width": width,
            "topics": [*self._topics()],
            "source_bits": words.sources[-1].high + 1,
            "source_count": len(words.sources),
            "sink_bits": words.sinks[-1].high + 1,
            "sink_count": len(words.sinks),
            "end_count": count,
            "is_counted": bool(self.system.status),
            "data_bits": count * width,
            "keep_bits": count * width // 8,
            "has_destinations": self._dest_bits > 0,
            "all_dest_bits": count * self._dest_bits,
            "sources": [self._source(word) for word in words.sources],
            **self._idle(),
            "routers": self._routers(),
            "sinks": [self._sink(word) for word in words.sinks],
        }

    def _topics(self) -> Iterator[dict[str, Any]]:
        for topic in self.system.inner_topics:
            for junction in self.system.junctions:
                if junction.is_exchanged and junction.topic == topic.name:
                    yield {
                        "topic": topic.name,
                        "message": str(junction.frame.message),
                        "bits": field_bits(junction.frame),
                        "ways": f"{', '.join(topic.publishers)} -> {', '.join(topic.readers)}",
                    }

    def _copies(self, end: int) -> int:
        return len(self.exchange.network.flows_of(end))

    def _source(self, word: _Word) -> Context:
        """Return a publisher's messages as frames, one for each destination."""
        end, copies = word.end, self._copies(word.end)
        ports = [
            *_CLOCK,
            ("fields", bits("source_fields", word.high, word.low)),
            ("valid", bit("source_valid", word.number)),
            ("ready", bit("source_ready", word.number)),
            ("m_axis_tdata", self._data("s_tdata", end)),
            *self._destination(end, copies),
            *((f"m_axis_{name}", bit(f"s_{name}", end)) for name in ("tvalid", "tlast", "tready")),
        ]
        generics = [("WIDTH", self.system.width), ("FIELD_BITS", word.high + 1 - word.low)]
        generics += [("COPIES", copies)] if copies > 1 else []
        return {
            **self._head(word),
            **instance(f"u_send_{word.number}", "entity firm.firm_message_send", ports, generics),
        }

    def _destination(self, end: int, copies: int) -> list[tuple[str, str]]:
        if copies < 2:
            return [("m_axis_tdest", "open")]
        low = end * self._dest_bits
        return [("m_axis_tdest", bits("s_tdest", low + index_bits(copies) - 1, low))]

    def _idle(self) -> Context:
        """Return the endpoints without a publisher or a reader, and the bits of destinations that nobody needs."""
        sending, taking = ({word.end for word in words} for words in (self._words.sources, self._words.sinks))
        ends = range(len(self.exchange.ends))
        return {
            "silent": [{"end": end, "data": self._data("s_tdata", end)} for end in ends if end not in sending],
            "deaf": [end for end in ends if end not in taking],
            "unused": [*self._unused()],
        }

    def _unused(self) -> Iterator[str]:
        """Yield the bits of destinations that no publisher needs."""
        for end in range(len(self.exchange.ends)):
            copies = self._copies(end)
            own = index_bits(copies) if copies > 1 else 0
            if own < self._dest_bits:
                yield bits("s_tdest", (end + 1) * self._dest_bits - 1, end * self._dest_bits + own)

    def _routers(self) -> Context:
        dest = [("s_axis_tdest", "s_tdest")] if self._dest_bits else []
        given = ((f"s_axis_{word}", f"s_{word}") for word in ("tdata", "tkeep", "tuser", "tlast", "tvalid", "tready"))
        taken = ((f"m_axis_{word}", f"m_{word}") for word in ("tdata", "tlast", "tvalid", "tready"))
        unused = [("m_axis_tkeep", "open"), ("m_axis_tuser", "open")]
        ports = [*_CLOCK, *dest, *given, *taken, *unused]
        return instance("u_routers", f"entity work.{routers_entity(self.system)}", ports)

    def _sink(self, word: _Word) -> Context:
        """Return a reader's frames as messages."""
        ports = [
            *_CLOCK,
            ("s_axis_tdata", self._data("m_tdata", word.end)),
            *((f"s_axis_{name}", bit(f"m_{name}", word.end)) for name in ("tvalid", "tlast", "tready")),
            ("fields", bits("sink_fields", word.high, word.low)),
            ("valid", bit("sink_valid", word.number)),
            ("ready", bit("sink_ready", word.number)),
        ]
        generics = [("WIDTH", self.system.width), ("FIELD_BITS", word.high + 1 - word.low)]
        return {
            **self._head(word),
            **instance(f"u_receive_{word.number}", "entity firm.firm_message_receive", ports, generics),
        }

    def _head(self, word: _Word) -> Context:
        return {"number": word.number, "block": word.block, "topic": word.junction.topic}

    def _data(self, signal: str, end: int) -> str:
        width = self.system.width
        return bits(signal, width * (end + 1) - 1, width * end)


def described(exchange: Exchange) -> str:
    """Return the topology of an exchange with its size, as text."""
    topology = exchange.network.topology
    if topology.routers == 1:
        return f"a {topology.kind} of {len(exchange.ends)} endpoints"
    sides = f" of {topology.columns} x {topology.routers // topology.columns}" if topology.columns else ""
    return f"a {topology.kind}{sides} with {topology.routers} routers and {len(exchange.ends)} endpoints"
