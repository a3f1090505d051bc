"""Frames that concern the presence of the board 192.0.2.2, 02:00:00:00:00:02, in its network, and what it does."""

from __future__ import annotations

import random
import struct

from tests.cores.ethernet import checksum, padded
from tests.cores.requests import ADDRESS, BROADCAST, MAC, PEER_ADDRESS, PEER_MAC

GROUP = bytes([239, 255, 0, 1])
ALL_SYSTEMS = bytes([224, 0, 0, 1])
_ROUTER_ALERT = b"\x94\x04\0\0"
_QUERY, _REPORT = 0x11, 0x16


def query(
    group: bytes = bytes(4),
    *,
    options: bytes = _ROUTER_ALERT,
    further: bytes = b"",
    kind: int = _QUERY,
    tenths: int = 10,
) -> bytes:
    """A query about a group or about all (RFC 2236); with `further`, one of version 3 (RFC 3376)."""
    message = struct.pack(">BBH4s", kind, tenths, 0, group) + further
    message = message[:2] + struct.pack(">H", checksum(message)) + message[4:]
    target = group if any(group) else ALL_SYSTEMS
    length = 20 + len(options) + len(message)
    header = struct.pack(">BBHHHBBH4s4s", 0x45 + len(options) // 4, 0, length, 0, 0, 1, 2, 0, PEER_ADDRESS, target)
    header += options
    header = header[:10] + struct.pack(">H", checksum(header)) + header[12:]
    return padded(b"\x01\0\x5e" + bytes([target[1] & 0x7F]) + target[2:] + PEER_MAC + b"\x08\0" + header + message)


def arp(operation: int, sender: bytes, sender_address: bytes, target_address: bytes = PEER_ADDRESS) -> bytes:
    """An ARP packet of a host."""
    ends = sender + sender_address + bytes(6) + target_address
    return padded(BROADCAST + sender + b"\x08\x06\0\1\x08\0\6\4" + operation.to_bytes(2) + ends)


def is_query(frame: bytes) -> bool:
    """Whether the board has to answer: a query about its group, or about all."""
    header = 4 * (frame[14] & 15)
    message = frame[14 + header :]
    is_igmp = frame[12:14] == b"\x08\0" and frame[14] >> 4 == 4 and header >= 20 and frame[23] == 2
    return is_igmp and len(message) >= 8 and message[0] == _QUERY and message[4:8] in (bytes(4), GROUP)


def is_conflict(frame: bytes) -> bool:
    """Whether another host uses the board's address."""
    is_arp = frame[12:20] == b"\x08\x06\0\1\x08\0\6\4"
    return is_arp and frame[28:32] == ADDRESS and frame[22:28] != MAC


def is_probe(frame: bytes) -> bool:
    """Whether another host probes for the board's address, too."""
    is_arp = frame[12:20] == b"\x08\x06\0\1\x08\0\6\4"
    return is_arp and frame[28:32] == bytes(4) and frame[38:42] == ADDRESS and frame[22:28] != MAC


def random_frame(chance: random.Random) -> bytes:
    """A query or an ARP packet; about half of them concern the board."""
    if chance.random() < 0.5:
        groups = (bytes(4), GROUP, bytes([239, 255, 0, 2]), bytes([239, 127, 0, 1]))
        options, further = chance.choice((b"", _ROUTER_ALERT, bytes(40))), chance.choice((b"", bytes(4), bytes(8)))
        frame = query(chance.choice(groups), options=options, further=further, kind=chance.choice((_QUERY, _REPORT)))
    else:
        sender, address = chance.choice((PEER_MAC, MAC)), chance.choice((ADDRESS, PEER_ADDRESS, bytes(4)))
        frame = arp(chance.choice((1, 2)), sender, address, chance.choice((ADDRESS, PEER_ADDRESS)))
    if chance.random() < 0.3:
        # A wrong byte in a header, or a cut frame.
        place = chance.choice((12, 13, 14, *range(16, 42)))
        frame = frame[:place] + bytes([frame[place] ^ 1 << chance.randrange(8)]) + frame[place + 1 :]
    return frame
