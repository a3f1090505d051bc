"""Derived System -> template configuration: the top level and its test bench as plain dictionaries.

The message side of a block is the same few ports everywhere: the fields, `segment_valid`, `msg_valid` and
`msg_ready`. Every block has a signal for each of its ports, called `<block>_<port>`; a connection is then a list of
assignments between signals, as in the dissertation's listing 6.9. Between them stands what lets several blocks take a
message, and what finds out the length of a payload.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.payload_length import length_entity, length_ports
from fusesoc_firm.converter.ports import field_ports, vhdl_type
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.naming import distinct_identifiers, identifier
from fusesoc_firm.system.derived import (
    AcceleratorBlock,
    AcceleratorType,
    Connection,
    Converter,
    DerivedSystem,
    End,
    LengthSource,
    PayloadLength,
)
from fusesoc_firm.system.sides import (
    PAYLOAD_LENGTH,
    Handshake,
    SidePort,
    accelerator_ports,
    handshakes,
    side_ports,
)
from fusesoc_firm.system.specification import DIRECTIONS
from fusesoc_firm.system.timing import WITH_DEADLINES, WITH_TRANSFER_TIMES

Configuration = dict[str, Any]

SYSTEM_TEMPLATE = "vhdl/system.vhd"
TEST_BENCH_TEMPLATE = "vhdl/test_bench.vhd"

# Names of the top level's own, and of its test bench: no block's signal or pin may be called so.
_TAKEN = """
    clk rst_n id_error frame_error frame_error_code rtl u_manager u_scheduler firm work ieee std_logic_1164
    s_axis_tdata s_axis_tkeep s_axis_tvalid s_axis_tlast s_axis_tready
    m_axis_tdata m_axis_tkeep m_axis_tid m_axis_tvalid m_axis_tlast m_axis_tready
    to_tdata to_tkeep to_tvalid to_tlast to_tready
    from_tdata from_tkeep from_tid from_tvalid from_tlast from_tready
    burst_tdata burst_tkeep burst_tid burst_tvalid burst_tlast burst_tready
    u_host u_system u_join u_environment
    sub_axis_tdata sub_axis_tkeep sub_axis_tlast sub_axis_tvalid sub_axis_tready
    pub_axis_tdata pub_axis_tkeep pub_axis_tvalid pub_axis_tlast pub_axis_tready
    sched_request sched_beat sched_last sched_grant_valid sched_grant_select
    periods deadlines transfer_times firm_sched_pkg times_t
    std standard std_logic std_logic_vector
""".split()
_ERROR_CODE_BITS = 4
# One entity serves both policies of fixed priorities.
_FIXED_PRIORITY = "fixed_priority"


def accelerator_entity(accelerator: AcceleratorType) -> str:
    """The entity that the top level instantiates: the user's own, or the wrapper of a C++ function."""
    name = identifier(accelerator.accelerator.name)
    return f"{name}_wrapper" if accelerator.accelerator.type == "HLS" else name


def system_configuration(system: DerivedSystem) -> Configuration:
    """The configuration of the top level."""
    names = _Names(system)
    return {
        **_dimensions(system),
        "name": system.name,
        **_scheduler(system),
        "publisher_errors": [
            {"bit": bit, "block": block}
            for bit, block in enumerate(system.error_blocks)
            if bit >= len(system.subscribers)
        ],
        "signals": [_signals(names, *block) for block in _blocks(system)],
        "subscribers": [_subscriber(names, converter, system) for converter in system.subscribers],
        "publishers": [_publisher(names, converter, system) for converter in system.publishers],
        "accelerators": [_accelerator(names, block, system.width) for block in system.accelerators],
        "pins": _pins(names, system),
        "connections": _connections(names, system),
    }


def test_bench_configuration(
    system: DerivedSystem, seed: int, stall_percent: int, environment: str | None
) -> Configuration:
    """The configuration of the test bench: the simulated host beside the system, and at its pins the `environment`.

    That is an entity with `clk`, `rst_n` and the pins, each in the other direction.
    """
    pins = _pins(_Names(system), system)
    formals = ["clk", "rst_n", *(str(port["formal"]) for group in pins for port in group["ports"])]
    return {
        "pins": pins,
        "environment": {"entity": environment, "ports": port_map((name, name) for name in formals)}
        if environment
        else None,
        **_dimensions(system),
        "seed": seed,
        "stall_percent": stall_percent,
        "is_preemptive": system.scheduling.is_preemptive,
        "from": "burst" if system.scheduling.is_preemptive else "from",
    }


def top_level_pins(system: DerivedSystem) -> dict[tuple[str, str], str]:
    """What the pins of blocks are called at the top level, by block and name."""
    names = _Names(system)
    return {
        (block.block, pin.name): names.port(block.block, pin.name)
        for block in system.accelerators
        for pin in block.type.accelerator.pins
    }


def _pins(names: _Names, system: DerivedSystem) -> list[Configuration]:
    """The pins of each block that has some, as ports of the top level."""
    groups = []
    for block in system.accelerators:
        pins = block.type.accelerator.pins
        formals = [names.port(block.block, pin.name) for pin in pins]
        column = max(map(len, formals), default=0)
        ports = [
            {
                "formal": formal,
                "name": formal.ljust(column),
                "direction": str(pin.direction).ljust(max(map(len, DIRECTIONS))),
                "type": vhdl_type(pin.bits),
                "low": "'0'" if pin.bits is None else "(others => '0')",
            }
            for pin, formal in zip(pins, formals, strict=True)
        ]
        if ports:
            groups.append({"block": block.block, "ports": ports})
    return groups


def _dimensions(system: DerivedSystem) -> Configuration:
    publishers = len(system.publishers)
    return {
        "entity": system.entity,
        "width": system.width,
        "data_high": system.width - 1,
        "keep_high": system.width // 8 - 1,
        "subscriber_count": len(system.subscribers),
        "publisher_count": publishers,
        "subscriber_high": len(system.subscribers) - 1,
        "publisher_high": publishers - 1,
        "pub_data_high": publishers * system.width - 1,
        "pub_keep_high": publishers * system.width // 8 - 1,
        "select_high": max(1, (publishers - 1).bit_length()) - 1,
        "error_count": len(system.error_blocks),
        "error_high": len(system.error_blocks) - 1,
        "error_code_high": _ERROR_CODE_BITS * len(system.error_blocks) - 1,
    }


def _scheduler(system: DerivedSystem) -> Configuration:
    """The scheduler's entity, its generics, and the constants with the publishers' times that these name."""
    scheduling = system.scheduling
    policy = scheduling.policy
    generics = {"REQUESTERS": str(len(system.publishers))}
    constants = []
    is_fixed = policy.startswith(_FIXED_PRIORITY)
    if is_fixed and scheduling.is_preemptive:
        generics["PREEMPTIVE"] = "true"
    if policy in WITH_DEADLINES:
        deadlines = [item.deadline for item in scheduling.times]
        periods = [item.period or item.deadline for item in scheduling.times]
        constants += [_times("PERIODS", periods, system), _times("DEADLINES", deadlines, system)]
    if policy in WITH_TRANSFER_TIMES:
        constants.append(_times("TRANSFER_TIMES", [item.transfer_time for item in scheduling.times], system))
    generics |= {str(item["name"]): str(item["name"]) for item in constants}
    if constants:
        generics["TIME_BITS"] = str(scheduling.time_bits)
    if scheduling.is_preemptive:
        generics["SHORTEST_RUN"] = str(scheduling.shortest_run)
    return {
        "scheduler": f"firm_sched_{_FIXED_PRIORITY if is_fixed else policy}",
        "scheduler_generics": _aligned(generics),
        "is_preemptive": scheduling.is_preemptive,
        "scheduler_times": {"constants": constants} if constants else None,
    }


def _times(name: str, cycles: Sequence[int | None], system: DerivedSystem) -> Configuration:
    """A constant with one time a publisher."""
    last = len(cycles) - 1
    return {
        "name": name,
        "high": last,
        "values": [
            {"id": number, "cycles": value, "comma": "" if number == last else ",", "block": publisher.block}
            for number, (value, publisher) in enumerate(zip(cycles, system.publishers, strict=True))
        ],
    }


def _aligned(generics: Mapping[str, str]) -> list[Configuration]:
    """A generic map, its arrows below each other."""
    width, last = max(map(len, generics)), [*generics][-1]
    return [
        {"formal": name.ljust(width), "actual": actual, "comma": "" if name == last else ","}
        for name, actual in generics.items()
    ]


def _blocks(system: DerivedSystem) -> list[tuple[str, list[tuple[str, SidePort]]]]:
    """Each block with all signals of its message sides and their prefixes, in the order of the data flow."""
    blocks = []
    for converter in system.subscribers:
        ports = side_ports(converter.frame, system.width, gives=True, has_valid=True)
        blocks.append((converter.block, [("", port) for port in ports]))
    for block in system.accelerators:
        blocks.append((block.block, accelerator_ports(block.type, system.width)))
    for converter in system.publishers:
        ports = side_ports(converter.frame, system.width, gives=False, has_valid=False)
        blocks.append((converter.block, [("", port) for port in ports]))
    return blocks


def _length_key(end: End) -> tuple[str, str, str]:
    return end.block, end.prefix, "sent_length"


def _is_found_out(connection: Connection) -> bool:
    """Whether the length of a connection's payloads does not come from its source."""
    return connection.length is not None and connection.length.source is not LengthSource.GIVEN


def _is(source: LengthSource, length: PayloadLength | None) -> bool:
    return length is not None and length.source is source


def _forked(connection: Connection) -> Iterator[Handshake]:
    """The handshakes of a connection that need a fork."""
    if len(connection.sinks) > 1 and connection.frame.is_fixed_size:
        yield Handshake("", "segment_valid", "msg_ready")
    elif len(connection.sinks) > 1:
        yield from handshakes(connection.frame)


class _Names:
    """The signal of each port of each block, those of what stands between blocks, and the labels."""

    def __init__(self, system: DerivedSystem) -> None:
        blocks = _blocks(system)
        forks = [(item.source, fork) for item in system.connections for fork in _forked(item)]
        buffered = [item.block for item in system.publishers if item.buffer]
        labels: list[tuple[str, ...]] = [("u", block) for block, _ in blocks]
        labels += [("u", *_fork_key(end, fork, "fork")) for end, fork in forks]
        labels += [
            ("u", item.source.block, item.source.prefix, "length")
            for item in system.connections
            if _is(LengthSource.COMPUTED, item.length)
        ]
        labels += [("u", block, "buffer") for block in buffered]
        label_names = distinct_identifiers(labels, _TAKEN)
        self._labels = dict(zip(labels, label_names, strict=True))

        entities = {subscriber_entity(item.frame, item.suffix) for item in system.subscribers}
        entities |= {publisher_entity(item.frame, item.suffix) for item in system.publishers}
        entities |= {accelerator_entity(item) for item in system.accelerator_types}
        entities |= {length_entity(frame, suffix) for frame, suffix in system.computed_lengths.items()}
        reserved = {*_TAKEN, system.entity, *entities, *label_names}
        # What stands between blocks has keys of three parts, so no field of a message can have the same.
        ports = [(block, f"{prefix}{port.name}") for block, found in blocks for prefix, port in found]
        signals = [_fork_key(end, fork, word) for end, fork in forks for word in _fork_words(fork)]
        signals += [(block, "", word) for block in buffered for word in _FRAME_SIGNALS]
        signals += [_length_key(item.source) for item in system.connections if _is_found_out(item)]
        # Pins first: who connects them should find them under the names they ask for.
        pins = [(block.block, pin.name) for block in system.accelerators for pin in block.type.accelerator.pins]
        keys: list[tuple[str, ...]] = [*pins, *ports, *signals]
        self._signals: Mapping[tuple[str, ...], str] = dict(
            zip(keys, distinct_identifiers(keys, reserved), strict=True)
        )

    def label(self, *words: str) -> str:
        """The label of a block, or of what the further words call."""
        return self._labels["u", *words]

    def port(self, block: str, port: str) -> str:
        return self._signals[block, port]

    def at(self, end: End, port: str) -> str:
        return self._signals[end.block, f"{end.prefix}{port}"]

    def fork(self, end: End, fork: Handshake) -> str:
        """The label of the fork behind an output."""
        return self._labels["u", *_fork_key(end, fork, "fork")]

    def forked(self, end: End, fork: Handshake, word: str) -> str:
        """The signal with the `valid`, `ready` or `segment_valid` of all that stand behind a fork."""
        return self._signals[_fork_key(end, fork, f"fork_{word}")]

    def length(self, connection: Connection) -> str:
        """The signal with the length of a connection's payloads."""
        source = connection.source
        return self._signals[_length_key(source)] if _is_found_out(connection) else self.at(source, PAYLOAD_LENGTH)

    def frame(self, block: str, signal: str) -> str:
        """A signal between a publisher and its buffer."""
        return self._signals[block, "", f"frame_{signal}"]


_AXIS = ("tdata", "tkeep", "tvalid", "tlast", "tready")
_FRAME_SIGNALS = tuple(f"frame_{word}" for word in (*_AXIS, "error", "error_code"))


def _fork_words(fork: Handshake) -> list[str]:
    return ["fork_valid", "fork_ready", *(["fork_segment_valid"] if fork.segment_valid else [])]


def _fork_key(end: End, fork: Handshake, word: str) -> tuple[str, str, str]:
    return end.block, end.prefix, f"{fork.part}_{word}" if fork.part else word


def _signals(names: _Names, block: str, ports: list[tuple[str, SidePort]]) -> Configuration:
    declared = [(names.port(block, f"{prefix}{port.name}"), vhdl_type(port.width)) for prefix, port in ports]
    column = max(len(name) for name, _ in declared)
    return {
        "block": block,
        "declarations": [{"name": name.ljust(column), "type": type_} for name, type_ in declared],
    }


def port_map(pairs: Iterable[tuple[str, str]]) -> list[Configuration]:
    """Formal and actual of each port, in columns; every line but the last ends with a comma."""
    lines = list(pairs)
    column = max(len(formal) for formal, _ in lines)
    return [
        {"formal": formal.ljust(column), "actual": actual, "comma": "," if number < len(lines) - 1 else ""}
        for number, (formal, actual) in enumerate(lines)
    ]


def _subscriber(names: _Names, converter: Converter, system: DerivedSystem) -> Configuration:
    number = converter.id
    ports = side_ports(converter.frame, system.width, gives=True, has_valid=True)
    return {
        **_instance(names, converter.block, subscriber_entity(converter.frame, converter.suffix)),
        "message": str(converter.frame.message),
        "id": number,
        "ports": port_map(
            [
                ("clk", "clk"),
                ("rst_n", "rst_n"),
                ("s_axis_tdata", "sub_axis_tdata"),
                ("s_axis_tkeep", "sub_axis_tkeep"),
                ("s_axis_tvalid", f"sub_axis_tvalid({number})"),
                ("s_axis_tlast", "sub_axis_tlast"),
                ("s_axis_tready", f"sub_axis_tready({number})"),
                *((port.name, names.port(converter.block, port.name)) for port in ports),
                *_errors(converter, system),
            ]
        ),
    }


def _publisher(names: _Names, converter: Converter, system: DerivedSystem) -> Configuration:
    ports = side_ports(converter.frame, system.width, gives=False, has_valid=False)
    frame = _frame_out(converter, system.width)
    errors = [] if converter.frame.is_fixed_size else _errors(converter, system)
    if converter.buffer:
        frame = [(f"m_axis_{word}", names.frame(converter.block, word)) for word in _AXIS]
        errors = [(f"frame_{word}", names.frame(converter.block, word)) for word in ("error", "error_code")]
    return {
        **_instance(names, converter.block, publisher_entity(converter.frame, converter.suffix)),
        "message": str(converter.frame.message),
        "id": converter.id,
        "ports": port_map(
            [
                ("clk", "clk"),
                ("rst_n", "rst_n"),
                *((port.name, names.port(converter.block, port.name)) for port in ports),
                *frame,
                *errors,
            ]
        ),
        "buffer": _buffer(names, converter, system) if converter.buffer else None,
    }


def _frame_out(converter: Converter, width: int) -> list[tuple[str, str]]:
    """Where a publisher's frames go: its part of what the Manager takes."""
    number, lanes = converter.id, width // 8
    return [
        ("m_axis_tdata", f"pub_axis_tdata({width * (number + 1) - 1} downto {width * number})"),
        ("m_axis_tkeep", f"pub_axis_tkeep({lanes * (number + 1) - 1} downto {lanes * number})"),
        ("m_axis_tvalid", f"pub_axis_tvalid({number})"),
        ("m_axis_tlast", f"pub_axis_tlast({number})"),
        ("m_axis_tready", f"pub_axis_tready({number})"),
    ]


def _errors(converter: Converter, system: DerivedSystem) -> list[tuple[str, str]]:
    """Where a converter's errors go: its part of the system's."""
    bit = system.error_blocks.index(converter.block)
    low, high = _ERROR_CODE_BITS * bit, _ERROR_CODE_BITS * (bit + 1) - 1
    return [("frame_error", f"frame_error({bit})"), ("frame_error_code", f"frame_error_code({high} downto {low})")]


def _buffer(names: _Names, converter: Converter, system: DerivedSystem) -> Configuration:
    """The buffer behind a publisher."""
    block, lanes = converter.block, system.width // 8
    types = [vhdl_type(system.width), vhdl_type(lanes), *[vhdl_type(None)] * 4, vhdl_type(_ERROR_CODE_BITS)]
    declared = [names.frame(block, word.removeprefix("frame_")) for word in _FRAME_SIGNALS]
    column = max(map(len, declared))
    return {
        "block": block,
        "label": names.label(block, "buffer"),
        "width": system.width,
        "depth": max(2, -(-(ID_BYTES + LENGTH_BYTES + converter.buffer) // lanes)),
        "signals": [{"name": name.ljust(column), "type": type_} for name, type_ in zip(declared, types, strict=True)],
        "ports": port_map(
            [
                ("clk", "clk"),
                ("rst_n", "rst_n"),
                *((f"s_axis_{word}", names.frame(block, word)) for word in _AXIS),
                *_frame_out(converter, system.width),
                ("s_frame_error", names.frame(block, "error")),
                ("s_frame_error_code", names.frame(block, "error_code")),
                *_errors(converter, system),
            ]
        ),
    }


def _accelerator(names: _Names, block: AcceleratorBlock, width: int) -> Configuration:
    formals = [f"{prefix}{port.name}" for prefix, port in accelerator_ports(block.type, width)]
    formals += [str(pin.name) for pin in block.type.accelerator.pins]
    return {
        **_instance(names, block.block, accelerator_entity(block.type)),
        "has_width": block.type.has_width,
        "width": width,
        "ports": port_map(
            [("clk", "clk"), ("rst_n", "rst_n"), *((formal, names.port(block.block, formal)) for formal in formals)]
        ),
    }


def _instance(names: _Names, block: str, entity: str) -> Configuration:
    return {"block": block, "label": names.label(block), "entity": entity}


def _connections(names: _Names, system: DerivedSystem) -> list[Configuration]:
    """The assignments of every connection. A sink of several sources takes their parts of a message together."""
    waiting: dict[End, list[str]] = {}
    for connection in system.connections:
        if connection.frame.is_fixed_size:
            for sink, (valid, _) in zip(connection.sinks, _handshakes(names, connection), strict=True):
                waiting.setdefault(sink, []).append(valid)
    return [_connection(names, connection, system.width, waiting) for connection in system.connections]


def _connection(names: _Names, connection: Connection, width: int, waiting: Mapping[End, list[str]]) -> Configuration:
    """The assignments of a connection; with several sinks, forks let each take the message in its own time.

    `waiting` are the valids of all sources of each sink; what they make together is assigned with the last one.
    """
    length = connection.length
    pairs: list[tuple[str, str]] = []
    if _is(LengthSource.BUFFERED, length):
        # As long as it gets.
        pairs.append((names.length(connection), 'x"FFFFFFFF"'))
    if connection.frame.is_fixed_size:
        pairs += _fixed_pairs(names, connection, waiting)
    else:
        for number in range(len(connection.sinks)):
            pairs += _pairs(names, connection, number, width)
    column = max(len(target) for target, _ in pairs)
    return {
        "message": str(connection.frame.message),
        "source": connection.source.block,
        "sinks": ", ".join(sink.block for sink in connection.sinks),
        "length_note": f"; its length is {length.source.value}" if length else "",
        "length_signal": {"name": names.length(connection)} if _is_found_out(connection) else None,
        "length": _length(names, connection) if _is(LengthSource.COMPUTED, length) else None,
        "forks": [_fork(names, connection, fork) for fork in _forked(connection)],
        "assignments": [{"target": target.ljust(column), "source": value} for target, value in pairs],
    }


def _fixed_pairs(names: _Names, connection: Connection, waiting: Mapping[End, list[str]]) -> Iterator[tuple[str, str]]:
    """The assignments of a message of fixed size."""
    source = connection.source
    handshakes = _handshakes(names, connection)
    for sink, frame, (valid, ready) in zip(connection.sinks, connection.frames, handshakes, strict=True):
        yield from ((names.at(sink, port.name), names.at(source, port.name)) for port in field_ports(frame))
        sink_valid, sink_ready = f"{names.at(sink, 'segment_valid')}(0)", names.at(sink, "msg_ready")
        if valid == waiting[sink][-1]:
            whole = " and ".join(waiting[sink])
            yield sink_valid, whole
            if sink.prefix:
                yield names.at(sink, "msg_valid"), whole
        yield ready, sink_ready if len(waiting[sink]) == 1 else f"{sink_ready} and {sink_valid}"


def _handshakes(names: _Names, connection: Connection) -> list[tuple[str, str]]:
    """Where each sink of a message of fixed size has its valid from, and its ready goes to."""
    source = connection.source
    for fork in _forked(connection):
        valid, ready = (names.forked(source, fork, word) for word in ("valid", "ready"))
        return [(f"{valid}({number})", f"{ready}({number})") for number in range(len(connection.sinks))]
    return [(f"{names.at(source, 'segment_valid')}(0)", names.at(source, "msg_ready"))]


def _pairs(names: _Names, connection: Connection, number: int, width: int) -> list[tuple[str, str]]:
    """The same of one of variable size between the source and a sink; a handshake that is forked goes by its fork."""
    source, sink = connection.source, connection.sinks[number]
    behind_fork: dict[str, str] = {}
    for fork in _forked(connection):
        low, high = fork.segments * number, fork.segments * (number + 1) - 1
        behind_fork[fork.valid] = f"{names.forked(source, fork, 'valid')}({number})"
        behind_fork[fork.ready] = f"{names.forked(source, fork, 'ready')}({number})"
        if fork.segment_valid is not None:
            behind_fork[fork.segment_valid] = f"{names.forked(source, fork, 'segment_valid')}({high} downto {low})"
    pairs = []
    for port in side_ports(connection.frames[number], width, gives=True, has_valid=True):
        at_source = behind_fork.get(port.name) or (
            names.length(connection) if port.name == PAYLOAD_LENGTH else names.at(source, port.name)
        )
        at_sink = names.at(sink, port.name)
        pairs.append((at_sink, at_source) if port.is_output else (at_source, at_sink))
    return pairs


def _length(names: _Names, connection: Connection) -> Configuration:
    """What computes the length of an accelerator's payloads."""
    source = connection.source
    inputs = ((formal, names.at(source, formal)) for formal in length_ports(connection.frame))
    return {
        "label": names.label(source.block, source.prefix, "length"),
        "entity": length_entity(connection.frame, connection.length.suffix if connection.length else ""),
        "ports": port_map([*inputs, (PAYLOAD_LENGTH, names.length(connection))]),
    }


def _fork(names: _Names, connection: Connection, fork: Handshake) -> Configuration:
    source, count = connection.source, len(connection.sinks)
    valid, ready = (names.forked(source, fork, word) for word in ("valid", "ready"))
    source_valid = names.at(source, fork.valid)
    signals = [(valid, count), (ready, count)]
    generics = [("SINKS", str(count))]
    ports = [
        ("clk", "clk"),
        ("rst_n", "rst_n"),
        ("source_valid", f"{source_valid}(0)" if connection.frame.is_fixed_size else source_valid),
        ("source_ready", names.at(source, fork.ready)),
        ("sink_valid", valid),
        ("sink_ready", ready),
    ]
    if fork.segment_valid is not None:
        segment_valid = names.forked(source, fork, "segment_valid")
        signals.append((segment_valid, count * fork.segments))
        generics.append(("SEGMENTS", str(fork.segments)))
        ports.insert(4, ("source_segment_valid", names.at(source, fork.segment_valid)))
        ports.append(("sink_segment_valid", segment_valid))
    column = max(len(name) for name, _ in signals)
    return {
        "label": names.fork(source, fork),
        "signals": [{"name": name.ljust(column), "type": vhdl_type(bits)} for name, bits in signals],
        "generics": port_map(generics),
        "ports": port_map(ports),
    }
