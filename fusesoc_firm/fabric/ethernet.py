"""The hardware of a node of ROS 2 by Ethernet: its memories, and the entity that connects them with `firm_net_link`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fusesoc_firm.fabric import dhcp, rtps
from fusesoc_firm.fabric.control import Sizes, generics_of, memory_of_control, slots_of
from fusesoc_firm.fabric.names import LONGEST_NAME, memory_of_names
from fusesoc_firm.fabric.node import Node, node_of
from fusesoc_firm.fabric.packets import Words, memory_of, plain_program, programs_of
from fusesoc_firm.fabric.presence import PROBE, REPORT, frames_of
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.system.derived.ethernet import (
    LEAST_REASSEMBLED,
    WAITING_BYTES,
    assembled_bytes,
    discovery_bytes,
    reassembled_bytes,
    slot_bytes,
)
from fusesoc_firm.system.derived.model import DerivedSystem, NetworkKind
from fusesoc_firm.system.hardware.interconnect import NETWORK_FAULTS, node_entity
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.render import Context, Rendering, render

# The memory bits of each waiting byte of discovery (firm_rtps_inbox).
_DISCOVERY_BITS = 17
# Packets in memory for each reassembly (firm_net_link).
_PLACES = 2
_NODE_TEMPLATE = "vhdl/net_node.vhd"


def node_files(system: DerivedSystem, libraries: Mapping[Middleware, MessageLibrary]) -> dict[str, str]:
    """Return the VHDL of a node, by its files' names, in compilation order; nothing for other systems.

    Raise `InputError` if a name is too long.
    """
    node, entity = ethernet_node(system, libraries), node_entity(system)
    if node is None:
        return {}
    memories = {name: f"{system.entity}_{name}" for name in ("control", "packets", "names")}
    made = [
        memory_of_control(node, memories["control"], Sizes.of(node)),
        memory_of(node, memories["packets"], _others(node)),
        memory_of_names(node.compared, memories["names"]),
        Rendering(_NODE_TEMPLATE, _configuration(system, node, {"entity": entity, **memories})),
    ]
    return {f"{item.context['entity']}.vhd": render(item.template, item.context) for item in made}


def ethernet_node(system: DerivedSystem, libraries: Mapping[Middleware, MessageLibrary]) -> Node | None:
    """Return the node of a system by Ethernet, or None for other systems.

    Raise `InputError` if a name is too long for the hardware's comparison.
    """
    if system.network is None or system.network.kind is not NetworkKind.ETHERNET:
        return None
    node = node_of(system, libraries)
    for item in node.compared:
        for name in (item.topic, item.type):
            if len(name) > LONGEST_NAME:
                fail(
                    f"the name {name} of '{system.name}' has {len(name)} characters in ROS 2's network",
                    hint=f"a node by Ethernet compares up to {LONGEST_NAME}",
                )
    return node


def history_bytes(system: DerivedSystem, node: Node) -> int:
    """Return the bytes of the memory of the last samples."""
    return slots_of(node) * slot_bytes(system.publishers)


def fragment_bytes(system: DerivedSystem, node: Node) -> int:
    """Return the bytes of the memories for messages in several packets, which are in use until they have left."""
    longest = reassembled_bytes(system)
    places = 1 << (_PLACES * node.network.reassemblies - 1).bit_length()
    waiting = WAITING_BYTES + discovery_bytes(system) * _DISCOVERY_BITS // 8
    return longest * places + assembled_bytes(system) + waiting if longest else 0


def _others(node: Node) -> dict[str, Words]:
    """Return the programs of the packets other than RTPS."""
    network = node.network
    if network.has_dhcp:
        return dhcp.programs_of(network)
    return {name: plain_program(network, frame) for name, frame in frames_of(network).items()}


def _configuration(system: DerivedSystem, node: Node, entities: Context) -> Context:
    """Return the configuration of the node."""
    assert system.clock is not None
    network, programs = node.network, programs_of(node, _others(node))
    numbers = {name: number for number, name in enumerate(programs.entries)}
    ports = {
        "all participants": rtps.multicast_port(network.domain),
        "discovery": rtps.metatraffic_port(network.domain),
        "messages": rtps.user_port(network.domain),
    }
    return {
        **entities,
        "node": network.name,
        "width": system.width,
        "lanes": system.width // 8,
        "readers": [{"id": number, "topic": item.topic} for number, item in enumerate(node.readers)],
        "writers": [{"id": number, "topic": item.topic} for number, item in enumerate(node.writers[1:])],
        "fault_count": len(NETWORK_FAULTS),
        "mac": network.mac.hex(),
        "address": network.address.packed.hex(),
        "dotted": "by DHCP" if network.has_dhcp else str(network.address),
        "ports": ", ".join(f"{port} ({name})" for name, port in ports.items()),
        "udp_ports": "".join(f"{port:04x}" for port in reversed(ports.values())),
        "generics": [{"name": name, "value": value} for name, value in generics_of(node, Sizes.of(node)).items()],
        "endpoint_count": len(node.compared),
        "name_bits": 8 * len(node.compared),
        "are_reliable": _bits(item.quality.is_reliable for item in node.compared),
        "are_transient": _bits(item.quality.is_transient_local for item in node.compared),
        "program_bits": programs.address_bits,
        "clock_hz": round(system.clock),
        "sample": slot_bytes(system.publishers),
        "report_packet": numbers[REPORT],
        "probe_packet": numbers[PROBE],
        "has_dhcp": str(network.has_dhcp).lower(),
        # Without DHCP they have no effect.
        **{f"{name}_packet": numbers.get(name, 0) for name in dhcp.PACKETS},
        "discovery": discovery_bytes(system),
        "waiting": WAITING_BYTES,
        "assembled": assembled_bytes(system),
        "reassemblies": node.network.reassemblies if reassembled_bytes(system) else 0,
        # Without a reassembly it has no effect.
        "reassembled": reassembled_bytes(system) or LEAST_REASSEMBLED,
        "has_status": str(bool(system.status)).lower(),
    }


def _bits(values: Iterable[bool]) -> str:
    """Return the digits of a vector whose lowest bit is the first value."""
    return "".join("01"[value] for value in reversed([*values]))
