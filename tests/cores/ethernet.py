"""Ethernet frames on the line of a GMII: bursts of bytes, what a receiver makes of them, captures for tshark.

A row of a file for the benches is a burst: the idle bytes before it, the byte at which the PHY reports an error or -1,
the number of bytes, and the bytes.
"""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

PREAMBLE = b"\x55" * 7 + b"\xd5"
FCS_BYTES = 4
GAP_BYTES = 12
SHORTEST, LONGEST = 60, 1514  # without FCS
# LINKTYPE_ETHERNET, with the number of FCS bytes at the end of each packet.
_CAPTURE_LINK = 1 | 1 << 26 | FCS_BYTES // 2 << 28


def fcs(frame: bytes) -> bytes:
    """The frame check sequence of a padded frame, as it is sent."""
    return zlib.crc32(frame).to_bytes(FCS_BYTES, "little")


def padded(frame: bytes) -> bytes:
    return frame.ljust(SHORTEST, b"\0")


def on_line(frame: bytes) -> bytes:
    """All bytes of a frame on the line."""
    return PREAMBLE + padded(frame) + fcs(padded(frame))


@dataclass(frozen=True)
class Burst:
    """Bytes that follow each other on the line; `fault` is the place of the PHY's error, or -1."""

    data: bytes
    idle: int = GAP_BYTES
    fault: int = -1

    def row(self) -> str:
        return " ".join(map(str, (self.idle, self.fault, len(self.data), *self.data))) + "\n"


def read_bursts(path: Path) -> list[Burst]:
    bursts = []
    for row in path.read_text(encoding="ascii").splitlines():
        idle, fault, size, *data = map(int, row.split())
        assert len(data) == size
        bursts.append(Burst(bytes(data), idle, fault))
    return bursts


@dataclass(frozen=True)
class Verdict:
    """What becomes of a burst: the pulse `good`, `broken` or `long`; the bytes that leave the receiver, maybe none."""

    pulse: str
    frame: bytes


def verdict(burst: Burst, longest: int = LONGEST) -> Verdict:
    """What IEEE 802.3 and the receiver's limits say of a burst."""
    start = len(burst.data) - len(burst.data.lstrip(b"\x55"))
    if burst.data[start : start + 1] != b"\xd5" or 0 <= burst.fault <= start:
        return Verdict("broken", b"")
    body = burst.data[start + 1 :]
    if len(body) > longest + FCS_BYTES:
        return Verdict("long", body[:longest])
    frame = body[:-FCS_BYTES]
    is_good = len(frame) >= SHORTEST and body == frame + fcs(frame) and burst.fault < 0
    return Verdict("good" if is_good else "broken", frame)


def random_bursts(number: int, longest: int, seed: int) -> Iterator[Burst]:
    """Frames of all sizes, half of them damaged: bits, lost and additional bytes, preamble, PHY, length."""
    random_ = random.Random(seed)
    for _ in range(number):
        frame = random_.randbytes(random_.choice([random_.randrange(80), random_.randrange(longest + 1), longest]))
        yield _damaged(on_line(frame), longest, random_)


def _damaged(data: bytes, longest: int, random_: random.Random) -> Burst:
    place = random_.randrange(len(data))
    fault = -1
    match random_.randrange(14):
        case 0:
            data = data[:place] + bytes([data[place] ^ 1 << random_.randrange(8)]) + data[place + 1 :]
        case 1:
            data = data[:place] + data[place + 1 :]
        case 2:
            data = data[:place] + random_.randbytes(1) + data[place:]
        case 3:
            data = data[: place + 1]
        case 4:
            data = data[: random_.randrange(1, 20)]
        case 5:
            fault = place
        case 6:
            data = on_line(random_.randbytes(longest + 1 + random_.randrange(30)))
        case 7:  # a PHY may swallow any number of the preamble's bytes
            data = data[random_.randrange(8) :]
    return Burst(data, random_.choice([1, 2, GAP_BYTES, 40]), fault)


def write_capture(path: Path, frames: Iterable[bytes]) -> None:
    """A file of frames with their FCS for tshark (pcap)."""
    header = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, _CAPTURE_LINK)
    packets = (struct.pack("<IIII", 0, 0, len(frame), len(frame)) + frame for frame in frames)
    path.write_bytes(header + b"".join(packets))


def is_set(flag: str) -> bool:
    """A flag as tshark shows it: 0 or 1, or in other formats and from version 4.2 on a word."""
    return {"0": False, "False": False, "1": True, "True": True}[flag]


def checksum(data: bytes) -> int:
    """The checksum of IPv4, ICMP and UDP (RFC 1071) of an even number of bytes."""
    total: int = sum(struct.unpack(f">{len(data) // 2}H", data))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return total ^ 0xFFFF


def udp_frame(payload: bytes, target: bytes = b"\xff" * 6) -> bytes:
    """A UDP datagram from 192.0.2.1 to 192.0.2.2 in an Ethernet frame, without a UDP checksum."""
    size = 28 + len(payload)
    fields = (0x45, 0, size, 0, 0x4000, 64, 17)
    addresses = bytes([192, 0, 2, 1, 192, 0, 2, 2])
    total = checksum(struct.pack(">BBHHHBBH", *fields, 0) + addresses)
    header = struct.pack(">BBHHHBBH", *fields, total) + addresses
    return target + b"\x02\0\0\0\0\1\x08\0" + header + struct.pack(">HHHH", 7410, 7411, size - 20, 0) + payload
