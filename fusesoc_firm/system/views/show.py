"""The derived System as plain data, with the contents of the dissertation's listings 6.7 and 6.9."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.frame.length import length_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.system.derived.longest import LINK_DEFAULT
from fusesoc_firm.system.derived.model import (
    AcceleratorBlock,
    Connection,
    Converter,
    DerivedSystem,
    End,
    MessageSide,
    Network,
    PayloadLength,
    PublisherTimes,
    Queue,
    Scheduling,
)
from fusesoc_firm.system.derived.python_function import function_name
from fusesoc_firm.system.derived.sides import side_ports
from fusesoc_firm.system.derived.timing import bounds_of
from fusesoc_firm.system.hardware.configuration import top_level_pins
from fusesoc_firm.system.hardware.crossings import all_crossings
from fusesoc_firm.system.views.inner_topics import topics_description
from fusesoc_firm.system.written.specification import AXI_STREAM, DHCP

if TYPE_CHECKING:
    from fusesoc_firm.scheduling.analysis import Bound


def derived_description(system: DerivedSystem) -> dict[str, Any]:
    """Return the converters, accelerators and all connections as plain data, with ports written as `block/port`."""
    pins = top_level_pins(system)
    return {
        "System": {
            "name": system.name,
            "top": system.entity,
            "fpgaPart": system.fpga_part,
            "width": system.width,
            "interconnect": way.kind.value if (way := system.link or system.network) else AXI_STREAM,
            **_network(system.network),
            **_scheduling(system.scheduling),
            **_clocks(system),
        },
        "Converters": {
            "AXIS_to_msg": [
                _converter(item, subscriber_entity(item.frame, item.suffix), system) for item in system.subscribers
            ],
            "msg_to_AXIS": [
                _converter(item, publisher_entity(item.frame, item.suffix), system)
                | _length(item, system.length_to(item))
                | _times(times)
                | _bound(bound)
                for item, times, bound in zip_longest(system.publishers, system.scheduling.times, bounds_of(system))
            ],
        },
        "Accelerators": [
            {
                "name": block.block,
                "entity": block.type.entity,
                "type": str(block.type.accelerator.type),
                "sources": [str(source) for source in block.type.accelerator.sources],
                **_domain(system, block),
                **_pins(block, pins),
                **_parameters(block),
            }
            for block in system.accelerators
        ],
        "Connections": list(_connections(system.connections, system.width)),
        **topics_description(system),
        **_software(system),
        **_crossings(system),
    }


def _network(network: Network | None) -> dict[str, Any]:
    if network is None:
        return {}
    addresses: dict[str, object] = {"address": DHCP}
    if not network.has_dhcp:
        addresses = {"address": network.address, "netmask": network.netmask, "gateway": network.gateway}
    return {
        "network": {
            "mac": network.mac.hex(":"),
            **{name: str(value) for name, value in addresses.items() if value},
            "name": network.name,
            "namespace": network.namespace,
            **_way(network),
        }
    }


def _way(network: Network) -> dict[str, Any]:
    if network.master:
        hosts = {host.name: str(host.address) for host in network.hosts}
        return {"master": "{}:{}".format(*network.master), **({"hosts": hosts} if hosts else {})}
    sizes = {"reassemblies": network.reassemblies, **({"reassembly": network.reassembly} if network.reassembly else {})}
    return {"domain": network.domain, "phy": network.phy.value, **sizes}


def default_lengths(system: DerivedSystem) -> list[str]:
    """Return a line for each converter whose longest payload is a default."""
    return [
        f"{item.block}: {item.frame.message} has no bounds and no 'maxLength'; payloads of more than"
        f" {item.max_length} bytes are refused{_with_link(system, item)}"
        for item in (*system.subscribers, *system.publishers)
        if item.has_default_length and (system.link or item.software is None)
    ]


def _with_link(system: DerivedSystem, converter: Converter) -> str:
    """Return the default of a subscriber on a board whose host is at a UART or SPI, if the system is on no board."""
    is_shorter = converter in system.subscribers and (converter.max_length or 0) > LINK_DEFAULT and not system.network
    return f" (of more than {LINK_DEFAULT} on a board with UART or SPI)" if is_shorter else ""


def counts(system: DerivedSystem) -> str:
    """Return a phrase with the number of blocks of each kind in a system."""
    found = [
        (len(system.subscribers), "subscriber"),
        (len(system.accelerators), "accelerator"),
        (len(system.publishers), "publisher"),
    ]
    if system.software.blocks:
        found.append((len(system.software.blocks), "accelerator"))
    words = ", ".join(f"{count} {word}{'' if count == 1 else 's'}" for count, word in found)
    return words + (" in software" if system.software.blocks else "")


def _clocks(system: DerivedSystem) -> dict[str, Any]:
    """Return all clocks other than clk, with port and frequency in Hz."""
    clocks = [{"name": item.name, "port": item.port, "hertz": float(item.frequency)} for item in system.clocks]
    return {"clocks": clocks} if clocks else {}


def _domain(system: DerivedSystem, block: AcceleratorBlock) -> dict[str, Any]:
    """Return the differences between a block and the system: the block's clock and stream width."""
    clock = system.clock_of(block.block)
    shown: dict[str, Any] = {"clock": clock.port} if clock else {}
    return shown | ({"width": block.type.width} if block.type.width != system.width else {})


def _crossings(system: DerivedSystem) -> dict[str, Any]:
    """Return the differences in clock and width between the two ends of each crossing."""
    found = []
    for item in all_crossings(system):
        ends = {"from": _side(item.source), "to": _side(item.sink)}
        found.append(ends | {name: words for name in ("clocks", "widths") if (words := getattr(item, name))})
    return {"Crossings": found} if found else {}


def _side(end: End) -> str:
    return f"{end.block}/{end.prefix.rstrip('_')}".rstrip("/")


def _pins(block: AcceleratorBlock, names: Mapping[tuple[str, str], str]) -> dict[str, Any]:
    """Return the pins of a block, with the corresponding ports of the top level."""
    pins = [
        {
            "name": str(pin.name),
            "direction": str(pin.direction),
            "bits": pin.bits or 1,
            "port": names[block.block, pin.name],
        }
        for pin in block.type.accelerator.pins
    ]
    return {"pins": pins} if pins else {}


def _parameters(block: AcceleratorBlock) -> dict[str, Any]:
    """Return the parameters of a block."""
    parameters = [
        {"name": item.name, "type": item.type.name, "default": item.default, "range": item.range}
        for item in block.type.parameters
    ]
    return {"parameters": parameters} if parameters else {}


def _software(system: DerivedSystem) -> dict[str, Any]:
    """Return the blocks in software, with the routes of their messages on the host."""
    blocks = [
        {
            "name": block.block,
            "type": str(block.type.accelerator.type),
            **_function(block),
            "inputs": [_taken(End(block.block, side.prefix), side, system) for side in block.type.inputs],
            "outputs": [_given(End(block.block, side.prefix), side, system) for side in block.type.outputs],
        }
        for block in system.software.blocks
    ]
    return {"Software": blocks} if blocks else {}


def _function(block: AcceleratorBlock) -> dict[str, Any]:
    sources = [str(source) for source in block.type.accelerator.sources]
    return {"function": function_name(block.type), "sources": sources} if sources else {}


def _taken(end: End, side: MessageSide, system: DerivedSystem) -> dict[str, Any]:
    """Return a message that software receives, with its source."""
    sources = [item.source for item in system.software.connections if end in item.sinks]
    return {**_message(end, side, system), "from": [_place(source, system.publishers, system) for source in sources]}


def _given(end: End, side: MessageSide, system: DerivedSystem) -> dict[str, Any]:
    """Return a message that software sends, with its sinks."""
    sinks = [sink for item in system.software.connections if item.source == end for sink in item.sinks]
    return {**_message(end, side, system), "to": [_place(sink, system.subscribers, system) for sink in sinks]}


def _message(end: End, side: MessageSide, system: DerivedSystem) -> dict[str, Any]:
    return {"name": system.names[end], "nameMW": str(side.frame.message), "ROS": side.frame.ros.number}


def _place(end: End, converters: Iterable[Converter], system: DerivedSystem) -> dict[str, Any]:
    """Return the other end of a message to or from software: another block, a hardware converter, or a topic."""
    if end.prefix:
        return {"block": end.block, "message": system.names[end]}
    crossing = [item for item in converters if item.block == end.block]
    return {"converter": end.block, "id": crossing[0].id} if crossing else {"topic": end.block}


def _converter(converter: Converter, entity: str, system: DerivedSystem) -> dict[str, Any]:
    return {
        "nameBD": entity,
        "nameMW": str(converter.frame.message),
        "ROS": converter.frame.ros.number,
        "block": converter.block,
        **_host_end(converter, system),
        "id": converter.id,
        "payloadBytes": _payload_bytes(converter.frame),
        **_queue(converter.queue),
    }


def _host_end(converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the host end of a converter's messages: a block in software, a service, an action, or a topic."""
    if converter.software:
        return {"software": converter.software.block}
    if converter.service:
        is_action = any(action.block == converter.service for action in system.actions)
        return {"action" if is_action else "service": converter.service}
    return {"topic": converter.name}


def _queue(queue: Queue | None) -> dict[str, Any]:
    """Return the queue of a subscriber, with the size of its memory in bytes of payload, or its watchdog."""
    if queue is None:
        return {}
    if queue.limit:
        return {"overflow": queue.overflow.value, "watchdog": queue.limit}
    size = queue.frames * queue.longest
    return {"queue": queue.frames, "overflow": queue.overflow.value, "queueBytes": size}


def _payload_bytes(frame: Frame) -> int | str:
    length = length_of(frame)
    if length.maximum is None:
        return f"{length.minimum} or more"
    return length.minimum if frame.is_fixed_size else f"{length.minimum} to {length.maximum}"


def _length(publisher: Converter, length: PayloadLength | None) -> dict[str, Any]:
    """Return the source of a payload's length for a publisher, with the reason for the choice, and the buffer size."""
    if length is None:
        return {}
    buffer = {"buffer": publisher.buffer} if publisher.buffer else {}
    return {"length": length.source.value, "because": length.reason, **buffer}


def _scheduling(scheduling: Scheduling) -> dict[str, Any]:
    shown: dict[str, Any] = {"scheduler": scheduling.policy}
    if scheduling.reasons:
        shown["because"] = [*scheduling.reasons]
    if scheduling.groups:
        shown["groups"] = [{"scheduler": item.policy, "publishers": [*item.blocks]} for item in scheduling.groups]
    return shown | ({"shortestRun": scheduling.shortest_run} if scheduling.is_preemptive else {})


def _times(times: PublisherTimes) -> dict[str, int]:
    """Return the known times of a publisher, in cycles."""
    found = {"periodCycles": times.period, "wcetCycles": times.transfer_time, "deadlineCycles": times.deadline}
    return {name: cycles for name, cycles in found.items() if cycles is not None}


def _bound(bound: Bound | None) -> dict[str, int | str]:
    """Return the bounds for a publisher's frames, and the number of bytes that its accelerator may have to store."""
    if bound is None:
        return {}
    if bound.response is None or bound.lateness is None or bound.buffer is None:
        return {"worstLatenessCycles": "no bound: it may never be served"}
    return {
        "worstResponseCycles": bound.response,
        "worstLatenessCycles": bound.lateness,
        "latenessBufferBytes": bound.buffer,
    }


def _connections(connections: Iterable[Connection], width: int) -> Iterator[dict[str, str]]:
    for connection in connections:
        source = connection.source
        for sink, frame in zip(connection.sinks, connection.frames, strict=True):
            for port in side_ports(frame, width, gives=True, has_valid=False):
                at_source, at_sink = (f"{end.block}/{end.prefix}{port.name}" for end in (source, sink))
                yield {"from": at_source, "to": at_sink} if port.is_output else {"from": at_sink, "to": at_source}
