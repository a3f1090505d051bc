"""UDP datagrams in fragments, and a model of firm_ipv4_reassembly."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass, field

from tests.cores.ethernet import checksum, padded
from tests.cores.requests import ADDRESS, MAC, PEER_MAC

_UDP = 17
_MORE = 0x2000
_HEADER = ">BBHHHBBH4s4s"


@dataclass(frozen=True)
class Host:
    """A sender."""

    mac: bytes
    address: bytes


HOSTS = [Host(PEER_MAC[:-1] + bytes([16 + number]), bytes([192, 0, 2, 16 + number])) for number in range(8)]


def packet(host: Host, number: int, data: bytes, *, offset: int = 0, more: bool = False, protocol: int = _UDP) -> bytes:
    """A frame with a part of a packet; `offset` is in bytes."""
    fields = [0x45, 0, 20 + len(data), number, (_MORE if more else 0) | offset // 8, 64, protocol]
    total = checksum(struct.pack(_HEADER, *fields, 0, host.address, ADDRESS))
    header = struct.pack(_HEADER, *fields, total, host.address, ADDRESS)
    return padded(MAC + host.mac + b"\x08\0" + header + data)


def fragments(host: Host, number: int, data: bytes, size: int = 1480) -> list[bytes]:
    """The frames of a packet, as a host sends them."""
    return [
        packet(host, number, data[at : at + size], offset=at, more=at + size < len(data))
        for at in range(0, len(data), size)
    ]


def is_fragment(frame: bytes) -> bool:
    """Whether a frame has a fragment for the host, as the hardware takes it."""
    size, word = struct.unpack_from(">HxxH", frame, 16)
    is_ours = frame[:6] == MAC and not frame[6] & 1 and frame[12:15] == b"\x08\0\x45" and frame[30:34] == ADDRESS
    if not is_ours or frame[23] != _UDP or not word & 0x3FFF or size <= 20 or checksum(frame[14:34]):
        return False
    return not word & _MORE or (size - 20) % 8 == 0


@dataclass
class Reassembly:
    """The model: packets in the order of their completion, and the number of what was dropped."""

    packets: int
    longest: int
    whole: list[bytes] = field(default_factory=list)
    dropped: int = 0
    _parts: dict[bytes, tuple[bytes, bytes]] = field(default_factory=dict)

    def take(self, frames: Iterable[bytes]) -> None:
        """Frames that are not aborted; a packet is sent before the next one begins."""
        for frame in frames:
            self._take(frame)

    def _take(self, frame: bytes) -> None:
        if not is_fragment(frame):
            return
        size, number, word = struct.unpack_from(">HHH", frame, 16)
        offset, more = 8 * (word & 0x1FFF), bool(word & _MORE)
        data = frame[34 : 14 + size]
        key = frame[26:30] + number.to_bytes(2)
        header, known = self._parts.get(key, (frame[:34], b""))
        end = offset + size - 20
        if key in self._parts and end <= len(known):
            return
        has_room = key in self._parts or len(self._parts) < self.packets
        if end > min(self.longest, 65515) or offset != len(known) or not has_room:
            self.dropped += 1
            self._parts.pop(key, None)
            return
        if len(data) != size - 20:
            # It may be repeated.
            self.dropped += 1
            return
        self._parts[key] = header, known + data
        if not more:
            self._end(key)

    def _end(self, key: bytes) -> None:
        header, data = self._parts.pop(key)
        fields = header[14:16] + (20 + len(data)).to_bytes(2) + header[18:20] + b"\0\0" + header[22:24]
        ends = header[26:34]
        self.whole.append(header[:14] + fields + checksum(fields + b"\0\0" + ends).to_bytes(2) + ends + data)
