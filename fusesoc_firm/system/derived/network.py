"""The network of a system that is itself a node: the specification's `network`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from ipaddress import AddressValueError, IPv4Address, IPv4Network

from fusesoc_firm.message.middleware import MIDDLEWARES
from fusesoc_firm.system.derived.chip import check_chip
from fusesoc_firm.system.derived.ids import ONE_BYTE
from fusesoc_firm.system.derived.model import Converter, Host, Network, NetworkKind, Phy, Scheduling, Software
from fusesoc_firm.system.written.specification import (
    AXI_STREAM,
    CHIPS,
    DHCP,
    ETHERNET,
    NETWORKS,
    NO_STATUS,
    STATUS_AXI_LITE,
    STATUS_FRAMES,
    Block,
    NodeNetwork,
    Project,
    Specification,
)
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.yaml_text import Text

# The ports of higher domains overlap with Linux's default range of ephemeral ports.
_LAST_DOMAIN = 101
# The default port of a ROS 1 master.
_MASTER_PORT = 11311
_HIGHEST_PORT = 0xFFFF
# The middleware of a node by interconnect: the legal word and the version.
_VERSIONS = {ETHERNET: ("ROS2", 2), **dict.fromkeys(CHIPS, ("ROS", 1))}
_MAC = re.compile(r"[0-9A-Fa-f]{2}(:[0-9A-Fa-f]{2}){5}")
_GROUP_BIT = 1
# Half of the packets of firm_ipv4_reassembly; the other half may be complete and waiting.
_MOST_REASSEMBLIES, _LONGEST_PACKET = 4, 65535
# The limit of rmw (RMW_NODE_NAME_MAX_NAME_LENGTH).
_LONGEST_NAME = 255
_WORD = r"[A-Za-z](?:_?[A-Za-z0-9])*_?"
_NAME = re.compile(_WORD)
_NAMESPACE = re.compile(rf"/|(/{_WORD})+")
# A longer prefix leaves no host addresses beside the network and broadcast addresses.
_LONGEST_PREFIX = 30
_UNUSED_ADDRESS = IPv4Address(0)
# At least one letter distinguishes a name from an address.
_HOST_NAME = re.compile(r"(?:[\w-]+\.)*[\w-]*[A-Za-z][\w-]*", re.ASCII)
# The node's program counts host names and topics together in a byte.
_MOST_HOSTS = 64


def network_of(
    specification: Specification,
    scheduling: Scheduling,
    software: Software,
    converters: tuple[Sequence[Converter], Sequence[Converter]],
    faults: Diagnostics,
) -> Network | None:
    """Return the network of a system that is itself a node, or None; note faults, even in an unused `network`.

    The key is legal with each interconnect, since a board or a generator call may replace the interconnect.
    `converters` are the subscribers and the publishers.
    """
    project = specification.project
    section = project.network
    network = _network(section, project, faults) if section else None
    if project.interconnect not in NETWORKS:
        return None
    is_chip = project.interconnect in CHIPS
    if section is None:
        keys = "'mac', 'address' and 'master'" if is_chip else "'mac' and 'address'"
        faults.error(
            f"interconnect '{project.interconnect}' needs the key 'network'",
            project.interconnect.source,
            f"add 'network' with {keys} to 'project'",
        )
    elif is_chip and section.master is None and section.is_sound:
        faults.error(
            f"interconnect '{project.interconnect}' needs the key 'master' in 'network'",
            section.source,
            "add the address of the master of ROS 1, such as 'master: 192.168.1.10:11311'",
        )
    _check_system(specification, scheduling, software, faults)
    blocks = {str(block.name): block for block in specification.blocks}
    namespace = network.namespace if network else ""
    for side in converters:
        _check_topics([item for item in side if not item.service], namespace, blocks, faults)
    if is_chip:
        check_chip(specification, *converters, faults)
    return network


def _check_topics(items: Iterable[Converter], namespace: str, blocks: dict[str, Block], faults: Diagnostics) -> None:
    """Note blocks of one direction with the same topic, since a node in fabric has only one endpoint for each topic."""
    owners: dict[str, str] = {}
    for item in items:
        name = item.ros_name if item.ros_name.startswith("/") else f"{namespace.rstrip('/')}/{item.ros_name}"
        if (owner := owners.setdefault(name, item.block)) != item.block:
            block = blocks[item.block]
            message = f"'{item.block}' and '{owner}' have the same topic {name}"
            hint = "a node in fabric has a topic only once in each direction; connect one block to several others"
            faults.error(message, block.topic.source if block.topic else block.name.source, hint)


def _check_system(written: Specification, scheduling: Scheduling, software: Software, faults: Diagnostics) -> None:
    """Note features that a node in fabric does not support."""
    project = written.project
    message, source = f"interconnect '{project.interconnect}' ", project.interconnect.source
    legal, version = _VERSIONS[project.interconnect]
    if scheduling.is_preemptive:
        hint = "a message is sent whole; use a non-preemptive scheduler"
        faults.error(f"{message}cannot carry the bursts of scheduler '{scheduling.policy}'", source, hint)
    if project.id_bytes != ONE_BYTE:
        faults.error(f"{message}is not possible with 'idBytes: {project.id_bytes}'", source, f"use '{AXI_STREAM}'")
    if project.interconnect in CHIPS and project.status != NO_STATUS:
        hint = f"remove the key, or use '{AXI_STREAM}'"
        faults.error(f"{message}has no host that reads a status", project.status.source, hint)
    elif project.status == STATUS_AXI_LITE:
        hint = f"use 'status: {STATUS_FRAMES}', which is read by UDP"
        faults.error(f"{message}has no port for AXI4-Lite", project.status.source, hint)
    services = dict.fromkeys(block.service_block for block in written.blocks if block.service_block)
    for block in services if project.interconnect == ETHERNET else ():
        place = block.mode.source if block.mode else block.name.source
        faults.error(f"{message}has no services and actions, such as '{block.name}'", place, "legal here: topics")
    for item in software.blocks:
        if item.type.accelerator.sources:
            hint = "without 'sources', the software is another node, on a host"
            faults.error(f"{message}has no host for '{item.block}'", source, hint)
    for block in written.blocks:
        given = version if block.middleware is None else MIDDLEWARES[block.middleware].number
        if block.middleware is not None and given != version:
            faults.error(
                f"{message}is not possible with ROS {MIDDLEWARES[block.middleware].number}",
                block.middleware.source,
                f"legal here: {legal}",
            )


def _network(section: NodeNetwork, project: Project, faults: Diagnostics) -> Network | None:
    """Return the network of a section, or None if it has a fault."""
    mac = _mac(section.mac, faults)
    addresses = _no_addresses if section.address == DHCP else _addresses
    network = addresses(section, project, faults)
    hosts = _hosts(section, faults)
    master = None if section.master is None else _master(section.master, hosts, faults)
    name = _name(section, project, faults)
    if not _NAMESPACE.fullmatch(section.namespace) or len(section.namespace) > _LONGEST_NAME:
        hint = f"legal here: / or, as in /arm/left, up to {_LONGEST_NAME} letters, digits and single '_', letters first"
        faults.error(f"'{section.namespace}' is not a legal namespace", section.namespace.source, hint)
    if not 0 <= section.domain <= _LAST_DOMAIN:
        hint = f"legal here: 0 to {_LAST_DOMAIN}"
        faults.error(f"'domain: {section.domain}' is not possible", section.place("domain"), hint)
    if not 1 <= section.reassemblies <= _MOST_REASSEMBLIES:
        hint = f"legal here: 1 to {_MOST_REASSEMBLIES}"
        faults.error(f"'reassemblies: {section.reassemblies}' is not possible", section.place("reassemblies"), hint)
    if not 0 <= section.reassembly <= _LONGEST_PACKET:
        hint = f"legal here: 0 to {_LONGEST_PACKET}"
        faults.error(f"'reassembly: {section.reassembly}' is not possible", section.place("reassembly"), hint)
    if not section.is_sound or mac is None or network is None:
        return None
    address, netmask, gateway = network
    if master and address != _UNUSED_ADDRESS:
        _check_reachable(section, address, IPv4Network((address, str(netmask)), strict=False), master[0], faults)
    kind = NetworkKind(project.interconnect) if project.interconnect in NETWORKS else NetworkKind.ETHERNET
    namespace, domain, phy = str(section.namespace), section.domain, Phy(section.phy)
    others = (kind, master, hosts, phy, section.reassemblies, section.reassembly)
    return Network(mac, address, netmask, gateway, name, namespace, domain, *others)


def _hosts(section: NodeNetwork, faults: Diagnostics) -> tuple[Host, ...]:
    """Return the hosts with legal names and addresses; note the other hosts."""
    hosts: dict[str, Host] = {}
    for item in section.hosts:
        before = len(faults.found)
        address = _address(item.address, faults) if item.address else None
        if item.name and not _HOST_NAME.fullmatch(item.name):
            hint = "legal here: letters, digits, '-', '_' and '.', with a letter after the last '.'"
            faults.error(f"'{item.name}' is not the name of a host", item.name.source, hint)
        elif item.name in hosts:
            faults.error(f"host '{item.name}' is given twice", item.name.source, "use each name once")
        if address and item.name and len(faults.found) == before:
            hosts[item.name] = Host(str(item.name), address)
    if len(section.hosts) > _MOST_HOSTS:
        hint = f"legal here: up to {_MOST_HOSTS}"
        faults.error(f"{len(section.hosts)} hosts are not possible", section.hosts[_MOST_HOSTS].source, hint)
    return (*hosts.values(),)


def _master(text: Text, hosts: Sequence[Host], faults: Diagnostics) -> tuple[IPv4Address, int] | None:
    """Return address and port of a master; a ROS_MASTER_URI and the name of one of `hosts` are also legal."""
    name, colon, port = text.removeprefix("http://").removesuffix("/").partition(":")
    port = port if colon else str(_MASTER_PORT)
    address = next((str(host.address) for host in hosts if host.name == name), name)
    try:
        found = IPv4Address(address), int(port) if port.isascii() and port.isdecimal() else 0
    except AddressValueError:
        found = _UNUSED_ADDRESS, 0
    if not 0 < found[1] <= _HIGHEST_PORT or found[0] == _UNUSED_ADDRESS or found[0].is_multicast:
        hint = "legal here: an address and a port, such as 192.168.1.10:11311; or the name of one of 'hosts'"
        faults.error(f"'{text}' is not the address of a master", text.source, hint)
        return None
    return found


def _check_reachable(
    section: NodeNetwork, address: IPv4Address, network: IPv4Network, master: IPv4Address, faults: Diagnostics
) -> None:
    """Note a master that the board cannot reach."""
    assert section.master is not None
    if master == address:
        hint = "legal here: the address of another host"
        faults.error(f"the master {master} is the board itself", section.master.source, hint)
    elif master not in network and section.gateway is None:
        hint = "add 'gateway', the router to other networks"
        faults.error(f"the master {master} is not in the board's network {network}", section.master.source, hint)


def _mac(text: Text, faults: Diagnostics) -> bytes | None:
    if not text:
        return None
    if not _MAC.fullmatch(text):
        hint = "legal here: six bytes in hexadecimal, such as 02:00:00:00:00:01"
        faults.error(f"'{text}' is not a MAC address", text.source, hint)
        return None
    mac = bytes.fromhex(text.replace(":", ""))
    if mac[0] & _GROUP_BIT or not any(mac):
        hint = "the first byte of a board's address is even, and not all bytes are 0"
        faults.error(f"'{text}' is not the MAC address of a single board", text.source, hint)
        return None
    return mac


def _addresses(
    section: NodeNetwork, project: Project, faults: Diagnostics
) -> tuple[IPv4Address, IPv4Address, IPv4Address | None] | None:
    """Return address, mask and gateway, or None after a fault."""
    other = f", or '{DHCP}'" if project.interconnect == ETHERNET else ""
    address, netmask = _address(section.address, faults, other), _netmask(section.netmask, faults)
    gateway = None if section.gateway is None else _address(section.gateway, faults)
    if address is None or netmask is None or (section.gateway is not None and gateway is None):
        return None
    network = IPv4Network((address, str(netmask)), strict=False)
    _check_host(section.address, address, network, faults)
    if section.gateway is not None and gateway is not None:
        _check_host(section.gateway, gateway, network, faults)
        if gateway not in network or gateway == address:
            hint = f"legal here: another address of {network}"
            faults.error(f"the gateway {gateway} is not a neighbour of {address}", section.gateway.source, hint)
    return address, netmask, gateway


def _no_addresses(
    section: NodeNetwork, project: Project, faults: Diagnostics
) -> tuple[IPv4Address, IPv4Address, None] | None:
    """Return placeholders for the addresses from a DHCP server; note keys that are illegal with DHCP."""
    before = len(faults.found)
    if project.interconnect in CHIPS:
        hint = f"legal here: an IPv4 address; '{DHCP}' is for interconnect '{ETHERNET}'"
        message = f"'address: {DHCP}' is not possible with interconnect '{project.interconnect}'"
        faults.error(message, section.address.source, hint)
    for name in ("netmask", "gateway"):
        value: Text | None = getattr(section, name)
        if value is not None and value.source:
            hint = "remove the key; the server knows it, and the board sends to its neighbours and routers only"
            faults.error(f"'{name}' is not possible with 'address: {DHCP}'", value.source, hint)
    if len(faults.found) > before:
        return None
    return _UNUSED_ADDRESS, _UNUSED_ADDRESS, None


def _address(text: Text, faults: Diagnostics, other: str = "") -> IPv4Address | None:
    if not text:
        return None
    try:
        return IPv4Address(text)
    except AddressValueError:
        hint = f"legal here: four numbers from 0 to 255, such as 192.168.1.20{other}"
        faults.error(f"'{text}' is not an IPv4 address", text.source, hint)
        return None


def _netmask(text: Text, faults: Diagnostics) -> IPv4Address | None:
    netmask = _address(text, faults)
    if netmask is None:
        return None
    bits = f"{int(netmask):032b}"
    if "01" in bits or not 0 < bits.count("1") <= _LONGEST_PREFIX:
        hint = "legal here: ones followed by at least two zeros, such as 255.255.255.0"
        faults.error(f"'{text}' is not the mask of a network", text.source, hint)
        return None
    return netmask


def _check_host(text: Text, address: IPv4Address, network: IPv4Network, faults: Diagnostics) -> None:
    is_special = address.is_multicast or address.is_loopback or address.is_reserved or address == _UNUSED_ADDRESS
    is_of_all = address in network and address in (network.network_address, network.broadcast_address)
    if is_special or is_of_all:
        other = f"an address of {network} other than its first and last"
        hint = f"legal here: {other if is_of_all else 'addresses of single hosts, neither loopback nor multicast'}"
        faults.error(f"'{text}' is not the address of a host", text.source, hint)


def _name(section: NodeNetwork, project: Project, faults: Diagnostics) -> str:
    if section.name is None:
        return identifier(project.name).lower()
    if not _NAME.fullmatch(section.name) or len(section.name) > _LONGEST_NAME:
        hint = f"legal here: up to {_LONGEST_NAME} letters, digits and single '_', beginning with a letter"
        faults.error(f"'{section.name}' is not a legal name of a node", section.name.source, hint)
    return str(section.name)
