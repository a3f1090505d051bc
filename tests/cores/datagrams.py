"""UDP datagrams in frames to the host 192.0.2.2, and what a receiver says of any frame (RFC 768, RFC 791, RFC 1112)."""

from __future__ import annotations

import random
import struct
from dataclasses import dataclass

from tests.cores.ethernet import checksum, padded

MAC, PEER_MAC = bytes.fromhex("020000000002"), bytes.fromhex("020000000001")
ADDRESS, PEER_ADDRESS, GROUP = bytes([192, 0, 2, 2]), bytes([192, 0, 2, 1]), bytes([239, 255, 0, 1])
GROUP_MAC = bytes.fromhex("01005e7f0001")
PORTS = (7400, 7410, 7411)
_IPV4, _UDP = b"\x08\x00", 17


@dataclass(frozen=True)
class Packet:
    """The fields of a datagram in a frame; a length or checksum of None is the right one."""

    data: bytes = b""
    mac: bytes = MAC
    address: bytes = ADDRESS
    port: int = 7411
    sender: bytes = PEER_MAC
    kind: bytes = _IPV4
    version: int = 4
    options: bytes = b""
    protocol: int = _UDP
    fragment: int = 0x4000  # the flags and the offset
    further: bytes = b""  # bytes of the packet after the datagram
    total: int | None = None
    length: int | None = None
    header_checksum: int | None = None
    udp_checksum: int | None = None

    def frame(self) -> bytes:
        """The frame, with padding."""
        length = 8 + len(self.data) if self.length is None else self.length
        udp = struct.pack(">HHH", 7410, self.port, length & 0xFFFF)
        summed = PEER_ADDRESS + self.address + struct.pack(">HH", _UDP, length & 0xFFFF) + udp + b"\0\0" + self.data
        # A sum of 0 is sent as ffff, since 0 says that there is none.
        right = checksum(summed + bytes(len(summed) % 2)) or 0xFFFF
        udp += struct.pack(">H", right if self.udp_checksum is None else self.udp_checksum)
        header = self._header(len(udp + self.data + self.further))
        return padded(self.mac + self.sender + self.kind + header + udp + self.data + self.further)

    def _header(self, size: int) -> bytes:
        words = 5 + len(self.options) // 4
        total = 4 * words + size if self.total is None else self.total
        fields = (self.version << 4 | words & 15, 0, total & 0xFFFF, 7, self.fragment, 64, self.protocol)
        rest = PEER_ADDRESS + self.address + self.options
        right = checksum(struct.pack(">BBHHHBBH", *fields, 0) + rest)
        return struct.pack(">BBHHHBBH", *fields, right if self.header_checksum is None else self.header_checksum) + rest


def judged(frame: bytes, *, is_aborted: bool = False) -> list[str]:
    """The rows that the bench of the receiver writes for a frame."""
    header_bytes = 4 * (frame[14] & 15) if len(frame) > 14 else 0
    packet = frame[14:]
    if len(packet) < 20 or not _is_mine(frame, header_bytes):
        return []
    header, rest = packet[:header_bytes], packet[header_bytes:]
    (total,), (fragment,) = struct.unpack(">H", header[2:4]), struct.unpack(">H", header[6:8])
    if not rest or checksum(header):
        return ["broken"] * (not is_aborted)
    if fragment & 0x3FFF:
        return ["fragment"] * (not is_aborted)
    if total < header_bytes + 8:
        return ["broken"] * (not is_aborted)
    is_whole = total <= len(packet)
    told = ["broken"] * (not is_aborted and not is_whole)
    if len(rest) < 8:
        return told
    source_port, port, length, sum_ = struct.unpack(">HHHH", rest[:8])
    if port not in PORTS:
        return told
    if not 8 <= length <= total - header_bytes:
        return ["broken"] * (not is_aborted)
    datagram = rest[:length]
    summed = header[12:20] + struct.pack(">HH", _UDP, length) + datagram
    is_right = not sum_ or not checksum(summed + bytes(len(summed) % 2))
    is_good = is_whole and is_right and not is_aborted
    data = datagram[8:]
    numbers = [PORTS.index(port), *frame[6:12], *header[12:16], source_port >> 8, source_port & 255, len(data), *data]
    row = " ".join(map(str, ["datagram" if is_good else "aborted", *numbers]))
    return [*([row] if data else []), *["broken"] * (not is_aborted and not is_good)]


def _is_mine(frame: bytes, header_bytes: int) -> bool:
    packet = frame[14:]
    targets = [(MAC, ADDRESS), (GROUP_MAC, GROUP)]
    return (
        (frame[:6], packet[16:20]) in targets
        and not frame[6] & 1
        and frame[12:14] == _IPV4
        and packet[0] >> 4 == 4
        and header_bytes >= 20
        and packet[9] == _UDP
    )


def random_frames(count: int, seed: int) -> list[bytes]:
    """Datagrams of all sizes; half of them have something that is unusual or wrong, or a damaged byte, or are cut."""
    chance = random.Random(seed)
    return [_random_frame(chance) for _ in range(count)]


def _random_frame(chance: random.Random) -> bytes:
    size = chance.choice([0, 1, 2, 17, 18, 19, 40, 41, chance.randrange(200), chance.randrange(100)])
    fields: dict[str, object] = {
        "data": chance.choice([chance.randbytes(size), bytes(size), b"\xff" * size]),
        "port": chance.choice(PORTS),
    }
    if chance.random() < 0.3:
        fields |= {"mac": GROUP_MAC, "address": GROUP}
    if chance.random() < 0.5:
        fields |= chance.choice(
            [
                {"mac": chance.choice([MAC, GROUP_MAC, b"\xff" * 6, bytes.fromhex("01005eff0001")])},
                {"address": chance.choice([ADDRESS, GROUP, bytes([192, 0, 2, 3])])},
                {"port": chance.choice([7401, 7412, 0, chance.randrange(1 << 16)])},
                {"sender": bytes.fromhex("030000000001")},
                {"kind": chance.choice([b"\x08\x06", b"\x86\xdd"])},
                {"version": 6},
                {"options": chance.randbytes(4 * chance.randrange(1, 11))},
                {"protocol": chance.choice([1, 6, 16, 19])},
                {"fragment": chance.choice([0x2000, 1, 0x1FFF, 0x8000, 0])},
                {"further": chance.randbytes(chance.randrange(1, 40))},
                {"total": chance.choice([0, 3, 19, 20, 27, 28, 29, 28 + size + 1, 28 + size - 1, 1500, 0xFFFF])},
                {"length": chance.choice([0, 7, 8, 9, 8 + size + 1, 8 + size - 1, 0xFFFF])},
                {"header_checksum": chance.randrange(1 << 16)},
                {"udp_checksum": chance.choice([0, 1, 0xFFFF, chance.randrange(1 << 16)])},
            ]
        )
    frame = bytearray(Packet(**fields).frame())  # type: ignore[arg-type]
    if chance.random() < 0.1:
        frame[chance.randrange(len(frame))] ^= 1 << chance.randrange(8)
    if chance.random() < 0.1:
        frame = frame[: chance.randrange(1, len(frame) + 1)]
    return bytes(frame)
