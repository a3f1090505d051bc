"""Derived System -> template configuration: the top level and its test bench as plain dictionaries.

The message side of a block is the same few ports everywhere: the fields, `segment_valid`, `msg_valid` and
`msg_ready`. Every block has a signal for each of its ports, called `<block>_<port>`; a connection is then a list of
assignments between signals, as in the dissertation's listing 6.9.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.ports import field_ports, vhdl_type
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.naming import distinct_identifiers, identifier
from fusesoc_firm.system.derived import AcceleratorBlock, AcceleratorType, Connection, Converter, DerivedSystem, End

Configuration = dict[str, Any]

SYSTEM_TEMPLATE = "vhdl/system.vhd"
TEST_BENCH_TEMPLATE = "vhdl/test_bench.vhd"

# Signals and ports of the top level's own: no block's signal may be called so.
_TAKEN = """
    clk rst_n id_error frame_error frame_error_code rtl u_manager u_scheduler firm work ieee std_logic_1164
    s_axis_tdata s_axis_tkeep s_axis_tvalid s_axis_tlast s_axis_tready
    m_axis_tdata m_axis_tkeep m_axis_tid m_axis_tvalid m_axis_tlast m_axis_tready
    sub_axis_tdata sub_axis_tkeep sub_axis_tlast sub_axis_tvalid sub_axis_tready
    pub_axis_tdata pub_axis_tkeep pub_axis_tvalid pub_axis_tlast pub_axis_tready
    sched_request sched_beat sched_last sched_grant_valid sched_grant_select
    std standard std_logic std_logic_vector
""".split()
_ERROR_CODE_BITS = 4


@dataclass(frozen=True)
class SidePort:
    """A port of a message side, without the side's prefix."""

    name: str
    width: int | None
    is_output: bool
    comment: str = ""


def side_ports(frame: Frame, *, gives: bool, has_valid: bool) -> list[SidePort]:
    """The ports of a message side; `gives` tells whether its block is where the message comes from.

    `has_valid`: whoever gets a message from a converter also learns by `msg_valid` that all of it came.
    """
    ports = [SidePort(port.name, port.width, gives, port.comment) for port in field_ports(frame)]
    ports.append(SidePort("segment_valid", 1, gives))
    if has_valid:
        ports.append(SidePort("msg_valid", None, gives))
    ports.append(SidePort("msg_ready", None, not gives))
    return ports


def accelerator_ports(accelerator: AcceleratorType) -> list[tuple[str, SidePort]]:
    """Every port of an accelerator's message sides with its prefix, in the order of the interface."""
    taken = [(side.prefix, port) for side in accelerator.inputs for port in _input_ports(side.frame)]
    given = [(side.prefix, port) for side in accelerator.outputs for port in _output_ports(side.frame)]
    return taken + given


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
        "scheduler": system.scheduler,
        "signals": [_signals(names, *block) for block in _blocks(system)],
        "subscribers": [_subscriber(names, converter) for converter in system.subscribers],
        "publishers": [_publisher(names, converter, system.width) for converter in system.publishers],
        "accelerators": [_accelerator(names, block) for block in system.accelerators],
        "connections": _connections(names, system.connections),
    }


def test_bench_configuration(system: DerivedSystem, seed: int, stall_percent: int) -> Configuration:
    """The configuration of the test bench: the simulated host beside the system."""
    return {**_dimensions(system), "seed": seed, "stall_percent": stall_percent}


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
        "error_code_high": _ERROR_CODE_BITS * len(system.subscribers) - 1,
    }


def _input_ports(frame: Frame) -> list[SidePort]:
    return side_ports(frame, gives=False, has_valid=True)


def _output_ports(frame: Frame) -> list[SidePort]:
    return side_ports(frame, gives=True, has_valid=False)


def _blocks(system: DerivedSystem) -> list[tuple[str, list[tuple[str, SidePort]]]]:
    """Each block with all ports of its message sides and their prefixes, in the order of the data flow."""
    blocks = []
    for converter in system.subscribers:
        ports = side_ports(converter.frame, gives=True, has_valid=True)
        blocks.append((converter.block, [("", port) for port in ports]))
    for block in system.accelerators:
        blocks.append((block.block, accelerator_ports(block.type)))
    for converter in system.publishers:
        ports = side_ports(converter.frame, gives=False, has_valid=False)
        blocks.append((converter.block, [("", port) for port in ports]))
    return blocks


class _Names:
    """The signal of each port of each block, the fork's signals of each message with several takers, and the labels."""

    def __init__(self, system: DerivedSystem) -> None:
        blocks = _blocks(system)
        forks = [connection.source for connection in system.connections if len(connection.sinks) > 1]
        labels = [("u", block) for block, _ in blocks] + [("u", end.block, end.prefix, "fork") for end in forks]
        label_names = distinct_identifiers(labels, _TAKEN)
        self._labels = dict(zip(labels, label_names, strict=True))

        entities = {subscriber_entity(item.frame, item.suffix) for item in system.subscribers}
        entities |= {publisher_entity(item.frame, item.suffix) for item in system.publishers}
        entities |= {accelerator_entity(item) for item in system.accelerator_types}
        reserved = {*_TAKEN, system.entity, *entities, *label_names}
        # A fork's signals have keys of three parts, so no field of a message can have the same.
        ports = [(block, f"{prefix}{port.name}") for block, found in blocks for prefix, port in found]
        signals = [(end.block, end.prefix, word) for end in forks for word in ("fork_valid", "fork_ready")]
        keys = [*ports, *signals]
        self._signals: Mapping[tuple[str, ...], str] = dict(
            zip(keys, distinct_identifiers(keys, reserved), strict=True)
        )

    def label(self, block: str) -> str:
        return self._labels["u", block]

    def port(self, block: str, port: str) -> str:
        return self._signals[block, port]

    def at(self, end: End, port: str) -> str:
        return self._signals[end.block, f"{end.prefix}{port}"]

    def fork(self, end: End) -> tuple[str, str, str]:
        """Label, valid and ready of the fork behind an output."""
        valid, ready = (self._signals[end.block, end.prefix, word] for word in ("fork_valid", "fork_ready"))
        return self._labels["u", end.block, end.prefix, "fork"], valid, ready


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


def _subscriber(names: _Names, converter: Converter) -> Configuration:
    number = converter.id
    low, high = _ERROR_CODE_BITS * number, _ERROR_CODE_BITS * (number + 1) - 1
    ports = side_ports(converter.frame, gives=True, has_valid=True)
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
                ("frame_error", f"frame_error({number})"),
                ("frame_error_code", f"frame_error_code({high} downto {low})"),
            ]
        ),
    }


def _publisher(names: _Names, converter: Converter, width: int) -> Configuration:
    number = converter.id
    lanes = width // 8
    ports = side_ports(converter.frame, gives=False, has_valid=False)
    return {
        **_instance(names, converter.block, publisher_entity(converter.frame, converter.suffix)),
        "message": str(converter.frame.message),
        "id": number,
        "ports": port_map(
            [
                ("clk", "clk"),
                ("rst_n", "rst_n"),
                *((port.name, names.port(converter.block, port.name)) for port in ports),
                ("m_axis_tdata", f"pub_axis_tdata({width * (number + 1) - 1} downto {width * number})"),
                ("m_axis_tkeep", f"pub_axis_tkeep({lanes * (number + 1) - 1} downto {lanes * number})"),
                ("m_axis_tvalid", f"pub_axis_tvalid({number})"),
                ("m_axis_tlast", f"pub_axis_tlast({number})"),
                ("m_axis_tready", f"pub_axis_tready({number})"),
            ]
        ),
    }


def _accelerator(names: _Names, block: AcceleratorBlock) -> Configuration:
    formals = [f"{prefix}{port.name}" for prefix, port in accelerator_ports(block.type)]
    return {
        **_instance(names, block.block, accelerator_entity(block.type)),
        "ports": port_map(
            [("clk", "clk"), ("rst_n", "rst_n"), *((formal, names.port(block.block, formal)) for formal in formals)]
        ),
    }


def _instance(names: _Names, block: str, entity: str) -> Configuration:
    return {"block": block, "label": names.label(block), "entity": entity}


def _connections(names: _Names, connections: Iterable[Connection]) -> list[Configuration]:
    """The assignments of every connection. A sink of several sources takes their parts of a message together."""
    waiting: dict[End, list[str]] = {}
    for connection in connections:
        for sink, (valid, _) in zip(connection.sinks, _handshakes(names, connection), strict=True):
            waiting.setdefault(sink, []).append(valid)
    return [_connection(names, connection, waiting) for connection in connections]


def _connection(names: _Names, connection: Connection, waiting: Mapping[End, list[str]]) -> Configuration:
    """The assignments of a connection; with several sinks, a fork lets each take the message in its own time.

    `waiting` are the valids of all sources of each sink; what they make together is assigned with the last one.
    """
    source, sinks = connection.source, connection.sinks
    pairs: list[tuple[str, str]] = []
    handshakes = _handshakes(names, connection)
    for sink, frame, (valid, ready) in zip(sinks, connection.frames, handshakes, strict=True):
        fields = field_ports(frame)
        pairs += [(names.at(sink, port.name), names.at(source, port.name)) for port in fields]
        sink_valid, sink_ready = f"{names.at(sink, 'segment_valid')}(0)", names.at(sink, "msg_ready")
        if valid == waiting[sink][-1]:
            whole = " and ".join(waiting[sink])
            pairs.append((sink_valid, whole))
            if sink.prefix:
                pairs.append((names.at(sink, "msg_valid"), whole))
        pairs.append((ready, sink_ready if len(waiting[sink]) == 1 else f"{sink_ready} and {sink_valid}"))
    column = max(len(target) for target, _ in pairs)
    return {
        "message": str(connection.frames[0].message),
        "source": source.block,
        "sinks": ", ".join(sink.block for sink in sinks),
        "fork": _fork(names, source, len(sinks)) if len(sinks) > 1 else None,
        "assignments": [{"target": target.ljust(column), "source": value} for target, value in pairs],
    }


def _handshakes(names: _Names, connection: Connection) -> list[tuple[str, str]]:
    """Where each sink has its valid from, and its ready goes to."""
    if len(connection.sinks) == 1:
        source = connection.source
        return [(f"{names.at(source, 'segment_valid')}(0)", names.at(source, "msg_ready"))]
    _, valid, ready = names.fork(connection.source)
    return [(f"{valid}({number})", f"{ready}({number})") for number in range(len(connection.sinks))]


def _fork(names: _Names, source: End, count: int) -> Configuration:
    label, valid, ready = names.fork(source)
    return {
        "label": label,
        "count": count,
        "high": count - 1,
        "valid": valid,
        "ready": ready,
        "source_valid": f"{names.at(source, 'segment_valid')}(0)",
        "source_ready": names.at(source, "msg_ready"),
    }
