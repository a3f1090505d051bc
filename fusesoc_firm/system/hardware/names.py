"""The names in the top level: a signal for each port of each block, labels, and the instances between blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.payload_length import length_entity
from fusesoc_firm.system.derived.model import (
    AcceleratorBlock,
    BlockParameter,
    Clock,
    Connection,
    Converter,
    DerivedSystem,
    End,
    Junction,
    LengthSource,
    Queue,
)
from fusesoc_firm.system.derived.sides import (
    PAYLOAD_LENGTH,
    Handshake,
    SidePort,
    accelerator_ports,
    handshakes,
    side_ports,
)
from fusesoc_firm.system.hardware.crossings import Crossing, all_crossings
from fusesoc_firm.system.hardware.interconnect import HOST_PINS
from fusesoc_firm.system.written.specification import Pin
from fusesoc_firm.text.naming import distinct_identifiers
from fusesoc_firm.text.reserved import reserved_names

_TEMPLATES = ("vhdl/system.vhd", "vhdl/test_bench.vhd")
# The words of a name: a block, and words for one of its ports or for an instance or signal between blocks.
_Key = tuple[str, ...]
AXIS = ("tdata", "tkeep", "tvalid", "tlast", "tready")
STREAM = ("tdata", "tkeep", "tuser", "tvalid", "tlast", "tready")
# The reset of clk's domain.
OWN_RESET = "system_rst_n"
# Low until all clock domains have been reset.
RELEASED = "domains_rst_n"
# Between a publisher and its buffer, and between a subscriber and its queue or watchdog.
FRAME_WORDS = (*AXIS, "tuser", "error", "error_code")
FRAME_SIGNALS = tuple(f"frame_{word}" for word in FRAME_WORDS)
# Between a publisher that the watchdog may cut off and the system's errors.
ERROR_WORDS = ("error", "error_code")
# The levels and data of all sources of a merge, and those of its sink.
MERGE_WORDS = tuple(f"{side}_{word}" for side in ("source", "sink") for word in ("fields", "offers", "takes"))
QUEUE_WORDS = ("source_fields", "sink_fields")
DROPPED = "dropped"
# The exchange, with the messages of all publishers and readers.
EXCHANGE = ("", "exchange")
EXCHANGE_WORDS = tuple(f"{side}_{word}" for side in ("source", "sink") for word in ("fields", "valid", "ready"))
# What a status counts at the endpoints of the exchange.
EXCHANGE_EVENTS = ("sent", "stalled", "received", "waited", DROPPED)
# Between a publisher and the FIFO for late frames.
LATE_WORDS = (*AXIS, "tuser")


def is_counted(junction: Junction, system: DerivedSystem) -> bool:
    """Return whether a status counts the messages that a queue drops."""
    return junction.drops and bool(system.status and system.exchange)


@cache
def taken_names() -> frozenset[str]:
    """Return the names in the top level and its test bench that signals of blocks, pins and labels must not have."""
    return reserved_names(*_TEMPLATES) | {pin for pins in HOST_PINS for pin, *_ in pins} | {OWN_RESET, "u_system_rst"}


class Names:
    """The signals of all ports of all blocks, the signals of instances between blocks, and the labels."""

    def __init__(self, system: DerivedSystem) -> None:
        labels = [*_labels(system)]
        label_names = distinct_identifiers(labels, taken_names())
        self._labels = dict(zip(labels, label_names, strict=True))
        reserved = {*taken_names(), system.entity, *_entities(system), *label_names, *clock_names(system)}
        # Pins are named first, so that they get the requested names.
        keys = [*_pins(system), *_ports(system), *_parameters(system), *_signals(system)]
        self._signals: Mapping[_Key, str] = dict(zip(keys, distinct_identifiers(keys, reserved), strict=True))

    def label(self, *words: str) -> str:
        """Return the label of a block, or of an instance identified by further words."""
        return self._labels["u", *words]

    def port(self, block: str, port: str) -> str:
        """Return the signal of a block's port, or the top level's port for a pin."""
        return self._signals[block, port]

    def synced(self, block: str, pin: str) -> str:
        """Return the signal of a pin after its synchroniser."""
        return self._signals[block, pin, "synced"]

    def parameter(self, item: BlockParameter, word: str = "") -> str:
        """Return the signal of a parameter's port, or one of `parameter_words`."""
        return self._signals[item.block, item.parameter.name, *([word, "word"] if word else [])]

    def between(self, block: str) -> str:
        """Return the signal that tells whether the next edge is between two messages of a block."""
        return self._signals[block, "", "between"]

    def at(self, end: End, port: str) -> str:
        """Return the signal of a message's port at one end of a connection."""
        return self._signals[end.block, f"{end.prefix}{port}"]

    def fork(self, end: End, fork: Handshake) -> str:
        """Return the label of the fork after an output."""
        return self._labels["u", *_fork_key(end, fork, "fork")]

    def forked(self, end: End, fork: Handshake, word: str) -> str:
        """Return the signal that combines `valid`, `ready` or `segment_valid` of all sinks of a fork."""
        return self._signals[_fork_key(end, fork, f"fork_{word}")]

    def length(self, connection: Connection) -> str:
        """Return the signal with the length of a connection's payloads."""
        source = connection.source
        return self._signals[_length_key(source)] if is_found_out(connection) else self.at(source, PAYLOAD_LENGTH)

    def crossing(self, crossing: Crossing, word: str) -> str:
        """Return a signal of a crossing."""
        return self._signals[_crossing_key(crossing, word)]

    def crossing_label(self, crossing: Crossing, word: str) -> str:
        """Return the label of an instance of a crossing."""
        return self._labels["u", *_crossing_key(crossing, word)]

    def frame(self, block: str, signal: str) -> str:
        """Return a signal between a publisher and its buffer, or between a subscriber and its queue or watchdog."""
        return self._signals[block, "", f"frame_{signal}"]

    def joined(self, junction: Junction, word: str) -> str:
        """Return a signal with the fields or levels of all sides of a junction in one direction."""
        return self._signals[junction.block, "", f"all_{word}"]

    def exchange(self, word: str) -> str:
        """Return a signal with the fields, `valid` or `ready` of all messages to or from the exchange."""
        return self._signals[*EXCHANGE, word]

    def late(self, block: str, signal: str) -> str:
        """Return a signal between a publisher and its FIFO for late frames."""
        return self._signals[block, "", f"late_{signal}"]


def _entities(system: DerivedSystem) -> Iterator[str]:
    """Yield the names of all entities that are generated for the system or written for it."""
    yield from (subscriber_entity(item.frame, item.suffix) for item in system.subscribers)
    yield from (publisher_entity(item.frame, item.suffix) for item in system.publishers)
    yield from (item.entity for item in system.accelerator_types)
    yield from (length_entity(frame, suffix) for frame, suffix in system.computed_lengths.items())


def _labels(system: DerivedSystem) -> Iterator[_Key]:
    """Yield the words of the labels of all instances."""
    exchanged = {item.block for item in system.junctions if item.is_exchanged}
    yield from (("u", block) for block, _ in blocks(system) if block not in exchanged)
    if system.exchange:
        yield "u", *EXCHANGE
    yield from (("u", *_fork_key(end, fork, "fork")) for end, fork in _forks(system))
    for item in system.connections:
        if item.length and item.length.source is LengthSource.COMPUTED:
            yield "u", item.source.block, item.source.prefix, "length"
    yield from (("u", item.block, "buffer") for item in system.publishers if item.buffer)
    yield from (("u", item.block, queue_word(item.queue)) for item in system.subscribers if item.queue)
    yield from (("u", item.block, "late") for item in system.publishers if item.late_bytes)
    yield from (("u", block.block, str(pin.name), "sync") for block, pin in synchronised_pins(system))
    for parameter in system.parameters:
        words = ("parameter", *(("there", "back") if system.clock_of(parameter.block) else ()))
        yield from (("u", parameter.block, parameter.parameter.name, word) for word in words)
    for crossing in all_crossings(system):
        yield from (("u", *_crossing_key(crossing, word)) for word in crossing.instances())


def _pins(system: DerivedSystem) -> Iterator[_Key]:
    return ((block.block, str(pin.name)) for block in system.accelerators for pin in block.type.accelerator.pins)


def _ports(system: DerivedSystem) -> Iterator[_Key]:
    return ((block, f"{prefix}{port.name}") for block, sides in blocks(system) for prefix, port in sides)


def parameter_words(item: BlockParameter, system: DerivedSystem) -> tuple[str, ...]:
    """Return the words of a parameter: those of its registers, and both in the domain of a block with another clock."""
    return ("wanted", "value", *(("there", "back") if system.clock_of(item.block) else ()))


def _parameters(system: DerivedSystem) -> Iterator[_Key]:
    yield from ((block, "", "between") for block in dict.fromkeys(item.block for item in system.parameters))
    for item in system.parameters:
        yield item.block, item.parameter.name
        yield from ((item.block, item.parameter.name, word, "word") for word in parameter_words(item, system))


def _signals(system: DerivedSystem) -> Iterator[_Key]:
    """Yield the words of the signals at instances between blocks; three or more, so that no port has the same ones."""
    for end, fork in _forks(system):
        yield from (_fork_key(end, fork, word) for word in _fork_words(fork))
    queued = [item.block for item in system.subscribers if item.queue]
    buffered = [item.block for item in system.publishers if item.buffer]
    for block in (*queued, *buffered):
        yield from ((block, "", word) for word in FRAME_SIGNALS)
    for item in publishers_with_watchdog(system):
        yield from ((item.block, "", f"frame_{word}") for word in ERROR_WORDS)
    for item in system.publishers:
        if item.late_bytes:
            yield from ((item.block, "", f"late_{word}") for word in LATE_WORDS)
    for junction in system.junctions:
        words = () if junction.is_exchanged else MERGE_WORDS if junction.sources > 1 else QUEUE_WORDS
        if is_counted(junction, system):
            words = (*words, DROPPED)
        yield from ((junction.block, "", f"all_{word}") for word in words)
    if system.exchange:
        events = EXCHANGE_EVENTS if system.status else ()
        yield from ((*EXCHANGE, word) for word in (*EXCHANGE_WORDS, *events))
    yield from ((block.block, str(pin.name), "synced") for block, pin in synchronised_pins(system))
    yield from (_length_key(item.source) for item in system.connections if is_found_out(item))
    for crossing in all_crossings(system):
        yield from (_crossing_key(crossing, word) for word, _ in crossing.signals())


def _forks(system: DerivedSystem) -> Iterator[tuple[End, Handshake]]:
    return ((item.source, fork) for item in system.connections for fork in forked(item))


def queue_word(queue: Queue) -> str:
    """Return the kind of a queue, `watchdog` or `queue`, which is also part of its label."""
    return "watchdog" if queue.limit else "queue"


def publishers_with_watchdog(system: DerivedSystem) -> list[Converter]:
    """Return the publishers that the watchdog may cut off."""
    return [item for item in system.publishers if system.watchdog and item.may_pause]


def blocks(system: DerivedSystem) -> list[tuple[str, list[tuple[str, SidePort]]]]:
    """Return each block with the ports of its message sides and their prefixes, in the order of the data flow."""
    blocks = []
    for converter in system.subscribers:
        ports = side_ports(converter.frame, system.width, gives=True, has_valid=True)
        blocks.append((converter.block, [("", port) for port in ports]))
    for block in system.accelerators:
        blocks.append((block.block, accelerator_ports(block.type)))
    blocks += [(junction.block, junction_ports(junction, system.width)) for junction in system.junctions]
    for converter in system.publishers:
        ports = side_ports(converter.frame, system.width, gives=False, has_valid=False)
        blocks.append((converter.block, [("", port) for port in ports]))
    return blocks


def junction_ports(junction: Junction, width: int) -> list[tuple[str, SidePort]]:
    """Return all ports of a junction's message sides, with prefixes; it has a length only if its sources provide it."""
    taken = [
        (side.prefix, port)
        for side in junction.inputs
        for port in side_ports(side.frame, width, gives=False, has_valid=True)
    ]
    return taken + [(side.prefix, port) for side in junction.outputs for port in given_ports(junction, width)]


def given_ports(junction: Junction, width: int) -> list[SidePort]:
    """Return the ports of a junction's output, without its prefix."""
    is_counted = junction.length is not None and junction.length.source is not LengthSource.GIVEN
    ports = side_ports(junction.frame, width, gives=True, has_valid=False)
    return [port for port in ports if port.name != PAYLOAD_LENGTH or not is_counted]


def synchronised_pins(system: DerivedSystem) -> Iterator[tuple[AcceleratorBlock, Pin]]:
    """Yield each block's pins that the top level synchronises."""
    for block in system.accelerators:
        yield from ((block, pin) for pin in block.type.accelerator.pins if pin.is_synchronised)


def forked(connection: Connection) -> Iterator[Handshake]:
    """Yield the handshakes of a connection that need a fork."""
    if len(connection.sinks) > 1 and connection.frame.is_fixed_size:
        yield Handshake("", "segment_valid", "msg_ready")
    elif len(connection.sinks) > 1:
        yield from handshakes(connection.frame)


def is_found_out(connection: Connection) -> bool:
    """Return whether the length of a connection's payloads comes from a separate instance instead of its source."""
    return connection.length is not None and connection.length.source is not LengthSource.GIVEN


def clock_names(system: DerivedSystem) -> list[str]:
    """Return the names needed for clocks besides clk: ports, resets, and the labels of the reset instances."""
    found = resets(system)[1:]
    return [*(clock.port for clock in system.clocks), *found, *map(reset_label, found)]


def resets(system: DerivedSystem) -> list[str]:
    """Return the resets of all clocks, each the output of an instance; the reset of clk is first."""
    if not system.clocks:
        return [OWN_RESET]
    return [OWN_RESET, RELEASED, *(name for clock in system.clocks for name in (seen_reset(clock), clock.reset))]


def reset_label(reset: str) -> str:
    """Return the label of the instance that generates a reset."""
    return f"u_{reset.removesuffix('_n')}"


def seen_reset(clock: Clock) -> str:
    """Return the signal that is low until a clock domain, and all domains before it, have been reset."""
    return f"seen_{clock.name}_n"


def reset_of(clock: Clock | None) -> str:
    """Return the reset of a clock's domain; None represents clk."""
    return clock.reset if clock else OWN_RESET


def _crossing_key(crossing: Crossing, word: str) -> tuple[str, ...]:
    source, sink = crossing.source, crossing.sink
    return source.block, source.prefix, "to", sink.block, sink.prefix, word


def _length_key(end: End) -> tuple[str, str, str]:
    return end.block, end.prefix, "sent_length"


def _fork_words(fork: Handshake) -> list[str]:
    return ["fork_valid", "fork_ready", *(["fork_segment_valid"] if fork.segment_valid else [])]


def _fork_key(end: End, fork: Handshake, word: str) -> tuple[str, str, str]:
    return end.block, end.prefix, f"{fork.part}_{word}" if fork.part else word
