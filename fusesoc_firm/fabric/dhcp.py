"""The packets of a node with an address by DHCP (`firm_dhcp_client`), as programs for `firm_packet_builder`.

Messages follow RFC 2131, their options RFC 2132. An option of only some messages is replaced by pads in the others, or
follows the end option in a DHCPDECLINE, which must not contain it.
"""

from __future__ import annotations

import re
import struct
from enum import IntEnum

from fusesoc_firm.fabric.packets import OWN_ADDRESS, Own, Part, Words, datagram, plain_program
from fusesoc_firm.fabric.presence import ALL_HOSTS, ARP_REQUEST, PROBE, REPORT, TYPE_ARP, report_program
from fusesoc_firm.system.derived.model import Network

DHCP, RENEWAL, ANNOUNCEMENT = "dhcp", "renewal", "announcement"
PACKETS = DHCP, RENEWAL, ANNOUNCEMENT

_CLIENT_PORT, _SERVER_PORT = 68, 67
_TO_ALL = b"\xff" * 4
_REQUEST, _ETHERNET, _MAC_BYTES = 1, 1, 6
_HARDWARE_BYTES, _NAME_BYTES, _FILE_BYTES, _SHORTEST = 16, 64, 128, 300
_MAGIC = bytes.fromhex("63825363")
_LONGEST_LABEL = 63
# The forms of `own_select`: bytes that are 0 without an address, bytes that are 0 in a message without a selected
# server and address, and constants that are 0 in such a message.
_IF_BOUND, _IF_CHOSEN, _CONSTANT = 1 << 5, 2 << 5, 3 << 5
_SERVER_SLOT, _NUMBER_SLOT, _SENDER_SLOT, _END_SLOT, _TYPE_SLOT = 4, 8, 12, 30, 31
# Bits 5 and 4 of such a constant are the same.
_CONSTANT_BITS = 0x1F


class Option(IntEnum):
    """The tags of options."""

    HOST_NAME = 12
    REQUESTED_ADDRESS = 50
    LEASE = 51
    TYPE = 53
    SERVER = 54
    LIST = 55
    RENEWAL = 58
    REBINDING = 59
    CLIENT = 61
    END = 255


_WANTED = Option.LEASE, Option.SERVER, Option.RENEWAL, Option.REBINDING
_CURRENT = Own(tuple(_IF_BOUND | select for select in OWN_ADDRESS.selects))
_NUMBER = Own(tuple(range(_NUMBER_SLOT, _NUMBER_SLOT + 4)))
_SERVER = Own(tuple(range(_SERVER_SLOT, _SERVER_SLOT + 4)))
_SENDER = Own(tuple(range(_SENDER_SLOT, _SENDER_SLOT + _MAC_BYTES)))


def programs_of(network: Network) -> dict[str, Words]:
    """Return the programs of the packets that keep a node with DHCP in its network."""
    head = ALL_HOSTS, network.mac, TYPE_ARP + ARP_REQUEST + network.mac
    ports = struct.pack(">H", _CLIENT_PORT), struct.pack(">H", _SERVER_PORT)
    parts = _message(network)
    return {
        REPORT: report_program(network),
        PROBE: plain_program(network, *head, bytes(4 + _MAC_BYTES), OWN_ADDRESS),
        DHCP: datagram(network, ALL_HOSTS, (_CURRENT, _TO_ALL), ports, parts),
        RENEWAL: datagram(network, _SENDER, (_CURRENT, _SERVER), ports, parts),
        ANNOUNCEMENT: plain_program(network, *head, OWN_ADDRESS, bytes(_MAC_BYTES), OWN_ADDRESS),
    }


def host_name(network: Network) -> str:
    """Return the node's name as a host name: letters, digits and single '-' (RFC 1123), up to 63 of them."""
    return re.sub("_+", "-", network.name)[:_LONGEST_LABEL].strip("-")


def _message(network: Network) -> tuple[Part, ...]:
    """Return the parts of all messages; the client supplies the bytes that differ.

    The broadcast flag is not set, and the seconds since the first message are 0.
    """
    head = struct.pack(">BBBB", _REQUEST, _ETHERNET, _MAC_BYTES, 0)
    hardware = network.mac.ljust(_HARDWARE_BYTES, b"\0")
    name = host_name(network).encode()
    identity = _option(Option.CLIENT, bytes([_ETHERNET]) + network.mac)
    told = _option(Option.HOST_NAME, name) + _option(Option.LIST, bytes(_WANTED)) + bytes([Option.END])
    chosen = *_chosen(Option.REQUESTED_ADDRESS, OWN_ADDRESS), *_chosen(Option.SERVER, _SERVER)
    fixed = bytes(12) + hardware + bytes(_NAME_BYTES + _FILE_BYTES) + _MAGIC
    type_ = bytes([Option.TYPE, 1]), Own((_TYPE_SLOT,))
    size = len(head) + 12 + len(fixed) + 3 + len(identity) + 2 * 6 + 1 + len(told)
    padding = bytes(max(0, _SHORTEST - size))
    options = *type_, identity, *chosen, Own((_END_SLOT,)), told + padding
    return head, _NUMBER, bytes(4), _CURRENT, fixed, *options


def _option(tag: Option, value: bytes) -> bytes:
    return bytes([tag, len(value)]) + value


def _chosen(tag: Option, value: Own) -> tuple[Part, ...]:
    """An option of messages with a selected server and address only."""
    constants = tuple(_CONSTANT | number & _CONSTANT_BITS for number in (tag, len(value.selects)))
    return Own(constants), Own(tuple(_IF_CHOSEN | select for select in value.selects))
