"""ARP and ICMP echo requests of the host 192.0.2.1 to 192.0.2.2, and the replies, as in RFC 826 and RFC 792."""

from __future__ import annotations

import random
import struct

from tests.cores.ethernet import checksum, padded

ADDRESS, PEER_ADDRESS = bytes([192, 0, 2, 2]), bytes([192, 0, 2, 1])
MAC, PEER_MAC = bytes.fromhex("020000000002"), bytes.fromhex("020000000001")
BROADCAST = b"\xff" * 6
_ARP, _IPV4 = b"\x08\x06", b"\x08\x00"
_ARP_KINDS = b"\0\1\x08\0\6\4"
_REQUEST, _REPLY = b"\0\1", b"\0\2"
_ICMP = 1


def arp_request(target: bytes = MAC) -> bytes:
    """Who has ADDRESS? Sent to `target`."""
    return padded(target + PEER_MAC + _ARP + _ARP_KINDS + _REQUEST + PEER_MAC + PEER_ADDRESS + bytes(6) + ADDRESS)


def arp_reply() -> bytes:
    return PEER_MAC + MAC + _ARP + _ARP_KINDS + _REPLY + MAC + ADDRESS + PEER_MAC + PEER_ADDRESS


def ipv4(payload: bytes, source: bytes, destination: bytes, identification: int = 1) -> bytes:
    """An ICMP message in an IPv4 packet."""
    fields = (0x45, 0, 20 + len(payload), identification, 0x4000, 64, _ICMP)
    total = checksum(struct.pack(">BBHHHBBH", *fields, 0) + source + destination)
    return struct.pack(">BBHHHBBH", *fields, total) + source + destination + payload


def _echo(kind: int, data: bytes) -> bytes:
    message = struct.pack(">BBHHH", kind, 0, 0, 7, 9) + data
    total = checksum(message + bytes(len(message) % 2))
    return struct.pack(">BBHHH", kind, 0, total, 7, 9) + data


def echo_request(data: bytes, identification: int = 1) -> bytes:
    packet = ipv4(_echo(8, data), PEER_ADDRESS, ADDRESS, identification)
    return padded(MAC + PEER_MAC + _IPV4 + packet)


def echo_reply(data: bytes, identification: int = 1) -> bytes:
    packet = ipv4(_echo(0, data), ADDRESS, PEER_ADDRESS, identification)
    return PEER_MAC + MAC + _IPV4 + packet


def reply(frame: bytes) -> bytes | None:
    """The reply to a frame, as long as the frame, or None: the rules of the RFCs and of the responder's header."""
    source = frame[6:12]
    if source[0] & 1:
        return None
    if frame[12:22] == _ARP + _ARP_KINDS + _REQUEST and frame[38:42] == ADDRESS:
        if frame[:6] not in (MAC, BROADCAST):
            return None
        sender = frame[22:32]
        return source + MAC + frame[12:20] + _REPLY + MAC + ADDRESS + sender + frame[42:]
    header, icmp = frame[14:34], frame[34:]
    (length,) = struct.unpack(">H", header[2:4])
    is_echo = (
        frame[:6] == MAC
        and frame[12:15] == _IPV4 + b"\x45"
        and 28 <= length <= len(frame) - 14
        and header[6] & 0x3F == 0
        and header[7] == 0
        and header[9] == _ICMP
        and checksum(header) == 0
        and header[16:20] == ADDRESS
        and icmp[:2] == b"\x08\0"
    )
    if not is_echo:
        return None
    # RFC 1624: the word of type and code was 0800 and is 0000. Of the two zeros, ffff is right even if all words are 0.
    (old,) = struct.unpack(">H", icmp[2:4])
    new = old + 0x0800
    new = (new & 0xFFFF) + (new >> 16)
    swapped = header[:12] + ADDRESS + header[12:16]
    return source + MAC + frame[12:14] + swapped + b"\0\0" + struct.pack(">H", new) + icmp[4:]


def random_requests(number: int, seed: int) -> list[bytes]:
    """Requests of all sizes, of which two thirds have a random byte or bit in the headers; and random frames."""
    random_ = random.Random(seed)
    frames = []
    for _ in range(number):
        data = random_.randbytes(random_.choice([random_.randrange(40), random_.randrange(300)]))
        echo = echo_request(data, random_.randrange(65536))
        frame = bytearray(random_.choice([arp_request(BROADCAST), arp_request(), echo, echo]))
        match random_.randrange(10):
            case 0 | 1:
                frame[random_.randrange(44)] ^= 1 << random_.randrange(8)
            case 2:
                frame[random_.randrange(44)] = random_.randrange(256)
            case 3:
                frame = bytearray(random_.randbytes(random_.randrange(60, 200)))
            case 4:  # checksums whose upper byte overflows in the reply; nobody verifies them here
                frame[36:38] = bytes([random_.randrange(0xF6, 0x100), random_.choice([0, 0xFE, 0xFF])])
            case 5:  # too long for the frame, or too short for an echo request, with a right sum
                _set_length(frame, random_.choice([27, 28, len(frame) - 14, len(frame) - 13, 65535]))
        frames.append(bytes(frame))
    return frames


def _set_length(frame: bytearray, length: int) -> None:
    if frame[12:14] == _IPV4:
        struct.pack_into(">HHHBBH", frame, 16, length, 1, 0, 64, _ICMP, 0)
        struct.pack_into(">H", frame, 24, checksum(bytes(frame[14:34])))
