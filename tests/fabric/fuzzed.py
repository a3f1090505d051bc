"""Lines of an Ethernet with bad packets: those of scapy's fuzz(), and captured ones with damage.

scapy is GPL. It is a program beside the tests, which only import it; nothing of it is in the package.
"""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable, Sequence
from typing import Any

from tests.cores.datagrams import ADDRESS, GROUP_MAC, MAC, PORTS

LONGEST, SHORTEST = 1514, 60
_PREAMBLE = b"\x55" * 7 + b"\xd5"
_STRANGER = "02:00:00:00:00:99"
_BROADCAST = b"\xff" * 6
# Of 100 lines, those with a wrong checksum.
_BROKEN = 10


class Fuzz:
    """A row of lines that depends only on its seed and on the captured frames."""

    def __init__(self, seed: int, captured: Sequence[bytes]) -> None:
        print(f"seed {seed}")
        self._chance, self._captured = random.Random(seed), captured
        self._layers = _layers()
        # scapy draws from the module's own generator.
        self._state = random.Random(seed).getstate()
        self.lines = self.broken = 0

    def line(self) -> bytes:
        """The next line; its checksum is wrong sometimes."""
        frame = self._damaged() if self._chance.random() < 0.5 else self._made()
        frame = frame[:LONGEST].ljust(SHORTEST, b"\0")
        checksum = zlib.crc32(frame)
        self.lines += 1
        if self._chance.randrange(100) < _BROKEN:
            self.broken += 1
            checksum ^= 1 << self._chance.randrange(32)
        return _PREAMBLE + frame + struct.pack("<I", checksum)

    def _made(self) -> bytes:
        """A frame of scapy, from layers of which the last ones, or all, are fuzzed."""
        outside, random_state = random.getstate(), self._state
        random.setstate(random_state)
        try:
            while True:
                try:
                    return bytes(self._chance.choice(self._layers)(self._chance))
                except (struct.error, OverflowError, ValueError, TypeError, AttributeError, IndexError):
                    # A drawn value that scapy cannot write.
                    continue
        finally:
            self._state = random.getstate()
            random.setstate(outside)

    def _damaged(self) -> bytes:
        """A captured frame with other bytes, without some, or with some twice; its sums may be wrong."""
        frame = bytearray(self._chance.choice(self._captured))
        for _ in range(self._chance.randrange(1, 5)):
            # Few of the changes are in the addresses, without which nothing is looked at.
            place = self._chance.randrange(14 if self._chance.random() < 0.9 else 0, len(frame))
            action = self._chance.randrange(6)
            if action < 3:
                frame[place] = self._chance.choice((0, 1, 0x7F, 0x80, 0xFF, self._chance.randrange(256)))
            elif action == 3:
                frame[place] ^= 1 << self._chance.randrange(8)
            elif action == 4:
                del frame[place : place + self._chance.randrange(1, 40)]
            else:
                frame[place:place] = frame[place : place + self._chance.randrange(1, 200)]
            if len(frame) < SHORTEST:
                break
        if self._chance.random() < 0.8:
            _sum(frame)
        return bytes(frame)


def _sum(frame: bytearray) -> None:
    """Make the lengths and sums of IPv4 and UDP right, so that what is inside is looked at."""
    if len(frame) < 42 or frame[12:14] != b"\x08\0" or frame[14] != 0x45:
        return
    struct.pack_into(">H", frame, 16, len(frame) - 14)
    struct.pack_into(">H", frame, 24, 0)
    words = struct.unpack(">10H", frame[14:34])
    total = sum(words)
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    struct.pack_into(">H", frame, 24, total ^ 0xFFFF)
    if frame[23] == 17:
        struct.pack_into(">HH", frame, 38, len(frame) - 34, 0)


def _layers() -> list[Callable[[random.Random], Any]]:
    """What makes a packet, for each protocol that a node speaks."""
    from scapy.contrib import rtps
    from scapy.layers import igmp
    from scapy.layers.inet import ICMP, IP, UDP
    from scapy.layers.l2 import ARP, Ether
    from scapy.packet import Raw, fuzz

    address = ".".join(map(str, ADDRESS))

    def ether(chance: random.Random) -> Any:
        to = chance.choice((MAC, MAC, GROUP_MAC, _BROADCAST))
        return Ether(dst=":".join(f"{byte:02x}" for byte in to), src=_STRANGER)

    def ip(chance: random.Random) -> Any:
        packet = IP(src="192.0.2.99", dst=chance.choice((address, "239.255.0.1")))
        return fuzz(packet) if chance.random() < 0.2 else packet

    def udp(chance: random.Random) -> Any:
        packet = UDP(sport=7411, dport=chance.choice((*PORTS, 7399)))
        return fuzz(packet) if chance.random() < 0.2 else packet

    submessages: list[Any] = [
        rtps.RTPSSubMessage_DATA,
        rtps.RTPSSubMessage_DATA_FRAG,
        rtps.RTPSSubMessage_HEARTBEAT,
        rtps.RTPSSubMessage_ACKNACK,
        rtps.RTPSSubMessage_GAP,
        rtps.RTPSSubMessage_INFO_DST,
        rtps.RTPSSubMessage_INFO_TS,
        rtps.RTPSSubMessage_PAD,
    ]

    def message(chance: random.Random) -> Any:
        header = rtps.RTPS() if chance.random() < 0.8 else fuzz(rtps.RTPS())
        items = [bytes(fuzz(chance.choice(submessages)())) for _ in range(chance.randrange(1, 5))]
        return ether(chance) / ip(chance) / udp(chance) / header / Raw(b"".join(items))

    return [
        lambda chance: ether(chance) / fuzz(ARP()),
        lambda chance: ether(chance) / fuzz(ARP(pdst=address)),
        lambda chance: ether(chance) / ip(chance) / fuzz(ICMP()) / Raw(chance.randbytes(chance.randrange(64))),
        lambda chance: ether(chance) / ip(chance) / fuzz(igmp.IGMP()),
        lambda chance: ether(chance) / ip(chance) / udp(chance) / Raw(chance.randbytes(chance.randrange(1400))),
        lambda chance: fuzz(ether(chance)) / Raw(chance.randbytes(chance.randrange(1500))),
        message,
        message,
        message,
        message,
    ]
