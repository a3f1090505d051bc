"""The constant frames with which a board keeps its place in its network (`firm_net_presence`)."""

from __future__ import annotations

import struct
from ipaddress import IPv4Address

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.packets import OWN_ADDRESS, Result, Words, header_prelude, program_of, sum_of_words
from fusesoc_firm.system.derived.model import Network

REPORT, PROBE = "report", "probe"

_TYPE_IPV4, TYPE_ARP = b"\x08\x00", b"\x08\x06"
ALL_HOSTS = b"\xff" * 6
_GROUP_PREFIX = bytes.fromhex("01005e")
# An IPv4 header with the precedence of control, and with the option that makes routers examine the packet.
_IPV4, _PRECEDENCE, _DO_NOT_FRAGMENT, _TO_NEIGHBOURS, _IGMP = 0x46, 0xC0, 0x4000, 1, 2
_ROUTER_ALERT = b"\x94\x04\x00\x00"
_REPORT_TYPE = 0x16
# The fields of an ARP request: Ethernet and IPv4, the sizes of their addresses, and the operation.
ARP_REQUEST = bytes.fromhex("0001 0800 06 04 0001")


def frames_of(network: Network) -> dict[str, bytes]:
    """Return the report of a membership in the group of all participants, and the probe for the own address."""
    return {REPORT: _report(network), PROBE: _probe(network)}


def _report(network: Network) -> bytes:
    """A membership report of IGMP version 2 (RFC 2236, section 2), which routers of version 3 accept."""
    target, head, length, group, message = _report_parts()
    addresses = network.address.packed + group
    total = head[:2] + length + head[2:]
    header = total + struct.pack(">H", _checksum(total + addresses + _ROUTER_ALERT)) + addresses + _ROUTER_ALERT
    return target + network.mac + _TYPE_IPV4 + header + message


def report_program(network: Network) -> Words:
    """Return the program of the same report of a node with DHCP."""
    target, head, length, group, message = _report_parts()
    prelude = header_prelude(network, head + _ROUTER_ALERT, int.from_bytes(length), OWN_ADDRESS, group)
    header = head[:2] + length + head[2:], Result.HEADER_CHECKSUM, OWN_ADDRESS, group + _ROUTER_ALERT
    return program_of(prelude, (target, network.mac, _TYPE_IPV4, *header, message))


def _report_parts() -> tuple[bytes, bytes, bytes, bytes, bytes]:
    """The group's MAC address, the header of IPv4 up to its checksum without the length, the length, group, message."""
    group = IPv4Address(rtps.MULTICAST).packed
    message = struct.pack(">BBH", _REPORT_TYPE, 0, 0) + group
    message = struct.pack(">BBH", _REPORT_TYPE, 0, _checksum(message)) + group
    head = struct.pack(">BBHHBB", _IPV4, _PRECEDENCE, 0, _DO_NOT_FRAGMENT, _TO_NEIGHBOURS, _IGMP)
    # The lower 23 bits of the group's address (RFC 1112, section 6.4).
    target = _GROUP_PREFIX + bytes([group[1] & 0x7F, *group[2:]])
    return target, head, struct.pack(">H", 4 * (_IPV4 & 0xF) + len(message)), group, message


def _probe(network: Network) -> bytes:
    """A request for the own address whose sender has no address yet (RFC 5227, section 2.1.1)."""
    sender, target = network.mac + bytes(4), bytes(6) + network.address.packed
    return ALL_HOSTS + network.mac + TYPE_ARP + ARP_REQUEST + sender + target


def _checksum(data: bytes) -> int:
    """The checksum of an even number of bytes (RFC 1071)."""
    total = sum_of_words(data)
    return ~(total + (total >> 16)) & 0xFFFF
