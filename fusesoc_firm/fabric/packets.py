"""The programs from which the hardware builds a node's packets (`firm_packet_builder`), made from constant payloads.

A program is a list of words, one for each byte of the frame: a constant, a byte of a field that the hardware fills in,
a length or checksum that it computes, or the payload of a sample. RTPS is little-endian here. If the node obtains its
address by DHCP, the bytes of the address are separate words (`Own`).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from ipaddress import IPv4Address
from itertools import chain
from types import MappingProxyType

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Endpoint, Node
from fusesoc_firm.fabric.rtps import Kind, Parameter
from fusesoc_firm.system.derived.ethernet import LONGEST_IN_FRAME
from fusesoc_firm.system.derived.model import Network
from fusesoc_firm.text.render import Rendering

# Bytes of a sample in each fragment but the last.
FRAGMENT_BYTES = LONGEST_IN_FRAME

_LAST = 1 << 10
_FROM_FIELD, _FROM_PAYLOAD, _FROM_RESULT = 1 << 8, 2 << 8, 3 << 8
# A field that the host obtains at run time.
_OWN = 1 << 7
# The arguments of the results that depend on the bytes before the payload, the low byte first.
_DATA_BYTES = 6, 7
_LITTLE, _INLINE, _DATA, _KEY = 1, 2, 4, 8
_IP_BYTES, _UDP_BYTES = 20, 8
# Words of the prelude, and the following ones of a host with DHCP.
_PRELUDE_WORDS, _OWN_WORDS = 8, 4
# Values in the IPv4 header: version 4 without options, the time to live, the protocol UDP, and Don't Fragment.
_IPV4, _TIME_TO_LIVE, _UDP, _DO_NOT_FRAGMENT = 0x45, 64, 17, 0x4000
_TYPE_IPV4, _NO_CHECKSUM = b"\x08\x00", bytes(2)
# The Ethernet multicast address of the group of all participants (RFC 1112).
_GROUP_MAC = bytes.fromhex("01005e7f0001")
# The values of octetsToInlineQos: bytes between this field and the inline parameters.
_TO_INLINE, _TO_INLINE_OF_FRAGMENT = 16, 28

Words = list[int]


class Field(Enum):
    """The fields that the hardware fills in: address and number of bytes. Multi-byte values are in wire order."""

    MAC = 0, 6
    FLAGS = 6, 1
    ADDRESS = 8, 4
    PORT = 12, 2
    PREFIX = 16, 12
    READER = 28, 4
    WRITER = 32, 4
    COUNT = 36, 4
    NUMBER = 40, 8
    FIRST = 48, 8
    LAST = 56, 8
    SET_SIZE = 64, 4
    SET = 68, 4
    FRAGMENT = 72, 4
    FRAGMENT_SET_SIZE = 76, 4
    FRAGMENT_SET = 80, 4
    SAMPLE_BYTES = 84, 4
    SECOND_COUNT = 88, 4

    @property
    def address(self) -> int:
        """The address of its first byte."""
        return int(self.value[0])

    @property
    def size(self) -> int:
        """Its number of bytes."""
        return int(self.value[1])


class Result(Enum):
    """The results that the hardware computes: the argument of each byte, in wire order."""

    PACKET_BYTES = 0, 1
    DATAGRAM_BYTES = 2, 3
    HEADER_CHECKSUM = 4, 5


class Payload(Enum):
    """The payload of a sample, padded to a multiple of four bytes."""

    SAMPLE = 0


@dataclass(frozen=True)
class DataBytes:
    """The size of the submessage with the payload: the hardware adds the payload's size to `before`."""

    before: int


@dataclass(frozen=True)
class Own:
    """Bytes that a host with DHCP obtains at run time, numbered as in `own_select` of `firm_dhcp_client`."""

    selects: tuple[int, ...]


OWN_ADDRESS = Own((0, 1, 2, 3))
"""The address of a host with DHCP."""

Part = bytes | Field | Result | DataBytes | Payload | Own


@dataclass(frozen=True)
class Packet:
    """A datagram: `parts` after the header of UDP, to the group of all participants or to a peer."""

    parts: tuple[Part, ...]
    to_group: bool = False


@dataclass(frozen=True)
class Programs:
    """All programs of a node in one memory, and the start of each."""

    words: tuple[int, ...]
    entries: Mapping[str, int]

    @property
    def address_bits(self) -> int:
        """The number of bits in an address."""
        return max(4, (len(self.words) - 1).bit_length())


def programs_of(node: Node, others: Mapping[str, Words] = MappingProxyType({})) -> Programs:
    """Return the programs of a node, in the order of `packets_of`, and `others`."""
    words: Words = []
    entries = {}
    made = {name: program(node, packet) for name, packet in packets_of(node).items()}
    for name, items in {**made, **others}.items():
        entries[name] = len(words)
        words += items
    return Programs(tuple(words), entries)


def plain_program(network: Network, *parts: Part) -> Words:
    """Return the program of a frame without results, whose prelude has no effect."""
    return program_of([bytes(_PRELUDE_WORDS + _OWN_WORDS * network.has_dhcp)], parts)


def program_of(prelude: Iterable[Part], parts: Iterable[Part]) -> Words:
    """Return the program of a frame with a prelude, which is not sent."""
    words = list(chain.from_iterable(map(_words, (*prelude, *parts))))
    words[-1] |= _LAST
    return words


def packets_of(node: Node) -> dict[str, Packet]:
    """Return the packets of a node: the announcements of the node and its endpoints, and the kinds of all others."""
    announcement = _constant_data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 1, *_participant_data(node))
    graph = _constant_data(Field.READER, node.writers[0].entity, 1, node.graph)
    publications = rtps.PUBLICATIONS_READER, rtps.PUBLICATIONS_WRITER
    subscriptions = rtps.SUBSCRIPTIONS_READER, rtps.SUBSCRIPTIONS_WRITER
    return {
        "announce_to_group": _to_group(node, announcement),
        "announce": _to_all(node, announcement),
        "leave_group": _to_group(node, _farewell(node)),
        "leave": _to_all(node, _farewell(node)),
        **_endpoints(node, "writer", node.writers, publications),
        **_endpoints(node, "reader", node.readers, subscriptions),
        "graph": _to_peer(node, graph),
        "graph_told": _to_peer(node, graph, _heartbeat()),
        "sample": _to_peer(node, _sample()),
        "sample_told": _to_peer(node, _sample(), _heartbeat()),
        "fragment": _to_peer(node, _fragment()),
        "fragment_told": _to_peer(node, _fragment(), _heartbeat()),
        "heartbeat": _to_peer(node, _heartbeat()),
        "acknowledge": _to_peer(node, _acknack(has_set=False)),
        "request": _to_peer(node, _acknack(has_set=True)),
        "request_fragments": _to_peer(node, _acknack(has_set=False), _nack_frag()),
        "gap": _to_peer(node, _gap()),
    }


def program(node: Node, packet: Packet) -> Words:
    """Return the words of a packet's program: the prelude, which is not sent, the headers, and the packet's parts."""
    network = node.network
    target: Part = IPv4Address(rtps.MULTICAST).packed if packet.to_group else Field.ADDRESS
    port: Part = struct.pack(">H", rtps.multicast_port(network.domain)) if packet.to_group else Field.PORT
    ports = struct.pack(">H", rtps.metatraffic_port(network.domain)), port
    mac = _GROUP_MAC if packet.to_group else Field.MAC
    source = OWN_ADDRESS if network.has_dhcp else network.address.packed
    return datagram(network, mac, (source, target), ports, packet.parts)


def datagram(
    network: Network, mac: Part, ends: tuple[Part, Part], ports: tuple[Part, Part], parts: Sequence[Part]
) -> Words:
    """Return the program of a datagram with `parts`, from an address and a port to others at `mac`."""
    source, target = ends
    header = struct.pack(">BBH", _IPV4, 0, 0), struct.pack(">HHBB", 0, _DO_NOT_FRAGMENT, _TIME_TO_LIVE, _UDP)
    length = _IP_BYTES + _UDP_BYTES + sum(map(_size, parts))
    ip = header[0][:2], Result.PACKET_BYTES, header[1], Result.HEADER_CHECKSUM, source, target
    udp = *ports, Result.DATAGRAM_BYTES, _NO_CHECKSUM
    prelude = header_prelude(network, b"".join(header), length, source, target)
    return program_of(prelude, (mac, network.mac, _TYPE_IPV4, *ip, *udp, *parts))


def header_prelude(network: Network, constant: bytes, length: int, source: Part, target: Part) -> tuple[Part, ...]:
    """Return the prelude for a header of IPv4: `constant` contains its words except length and addresses.

    The address of a host with DHCP is part of the prelude; otherwise it is a constant of the sum.
    """
    own = (source,) if network.has_dhcp else ()
    known = b"" if own or not isinstance(source, bytes) else source
    return struct.pack(">HH", sum_of_words(constant + known), length), target, *own


def _words(part: Part) -> Iterable[int]:
    match part:
        case bytes():
            return part
        case Field():
            return (_FROM_FIELD | part.address + place for place in range(part.size))
        case Result():
            return (_FROM_RESULT | argument for argument in part.value)
        case DataBytes():
            return (_FROM_RESULT | part.before // 4 << 3 | argument for argument in _DATA_BYTES)
        case Payload():
            return (_FROM_PAYLOAD,)
        case Own():
            return (_FROM_FIELD | _OWN | select for select in part.selects)


def _size(part: Part) -> int:
    """The number of bytes in a part, without the payload."""
    match part:
        case bytes():
            return len(part)
        case Field():
            return part.size
        case Result():
            return len(part.value)
        case DataBytes():
            return len(_DATA_BYTES)
        case Payload():
            return 0
        case Own():
            return len(part.selects)


def sum_of_words(data: bytes) -> int:
    """Return the sum for a checksum of the Internet (RFC 1071) over an even number of bytes; carries are added once."""
    total: int = sum(struct.unpack(f">{len(data) // 2}H", data))
    return (total & 0xFFFF) + (total >> 16)


# --- submessages -----------------------------------------------------------------------------------------------------

Submessage = tuple[Part, ...]


def _header(node: Node) -> bytes:
    return rtps.HEADER + rtps.VENDOR + node.prefix


def _to_group(node: Node, *submessages: Submessage) -> Packet:
    return Packet((_header(node), *chain.from_iterable(submessages)), to_group=True)


def _to_all(node: Node, *submessages: Submessage) -> Packet:
    """A packet to the address of a peer, without a named receiver."""
    return Packet((_header(node), *chain.from_iterable(submessages)))


def _to_peer(node: Node, *submessages: Submessage) -> Packet:
    destination = _submessage(Kind.INFO_DESTINATION, _LITTLE, Field.PREFIX)
    return Packet((_header(node), *destination, *chain.from_iterable(submessages)))


def _submessage(kind: Kind, flags: int | Field, *parts: Part) -> Submessage:
    """A submessage of a constant size."""
    shown: Part = flags if isinstance(flags, Field) else bytes([flags])
    return bytes([kind]), shown, struct.pack("<H", sum(map(_size, parts))), *parts


def _number(number: int) -> bytes:
    return struct.pack("<iI", number >> 32, number & 0xFFFFFFFF)


def _constant_data(reader: bytes | Field, writer: bytes, number: int, *payload: Part) -> Submessage:
    padding = bytes(-sum(map(_size, payload)) % 4)
    head = struct.pack("<HH", 0, _TO_INLINE)
    return _submessage(Kind.DATA, _LITTLE | _DATA, head, reader, writer, _number(number), *payload, padding)


def _participant_data(node: Node) -> Iterator[Part]:
    """The announcement of the node; its own address is the end of each locator."""
    data = node.participant_data
    for locator in node.locators if node.network.has_dhcp else ():
        before, _, data = data.partition(locator)
        yield from (before + locator[: -len(OWN_ADDRESS.selects)], OWN_ADDRESS)
    yield data


def _farewell(node: Node) -> Submessage:
    inline, key = node.farewell
    listed = b"".join(rtps.parameter(number, value) for number, value in inline.items())
    listed += rtps.parameter(Parameter.SENTINEL, b"")
    head = struct.pack("<HH", 0, _TO_INLINE)
    ends = rtps.NO_ENTITY + rtps.PARTICIPANT_WRITER + _number(2)
    return _submessage(Kind.DATA, _LITTLE | _INLINE | _KEY, head, ends, listed, key)


def _endpoints(node: Node, name: str, items: Sequence[Endpoint], ends: tuple[bytes, bytes]) -> dict[str, Packet]:
    """The packets that announce writers or readers, numbered from 1, and the heartbeat about them."""
    told = _number(1), _number(len(items)), Field.COUNT
    packets = {
        f"{name}_{number}": _to_peer(node, _constant_data(*ends, number, node.endpoint_data(item)))
        for number, item in enumerate(items, 1)
    }
    return {**packets, f"{name}s_told": _to_peer(node, _submessage(Kind.HEARTBEAT, _LITTLE, *ends, *told))}


def _sample() -> Submessage:
    head = struct.pack("<HH", 0, _TO_INLINE)
    return _with_payload(Kind.DATA, _LITTLE | _DATA, head, Field.READER, Field.WRITER, Field.NUMBER)


def _fragment() -> Submessage:
    head = struct.pack("<HH", 0, _TO_INLINE_OF_FRAGMENT)
    one = struct.pack("<HH", 1, FRAGMENT_BYTES)
    fields = Field.READER, Field.WRITER, Field.NUMBER, Field.FRAGMENT, one, Field.SAMPLE_BYTES
    return _with_payload(Kind.DATA_FRAG, _LITTLE, head, *fields)


def _with_payload(kind: Kind, flags: int, *parts: Part) -> Submessage:
    """A submessage of `parts`, whose size is a multiple of four bytes, and the payload."""
    return bytes([kind, flags]), DataBytes(sum(map(_size, parts))), *parts, Payload.SAMPLE


def _heartbeat() -> Submessage:
    return _submessage(Kind.HEARTBEAT, _LITTLE, Field.READER, Field.WRITER, Field.FIRST, Field.LAST, Field.COUNT)


def _acknack(*, has_set: bool) -> Submessage:
    """A request; the flags are a field, since they determine whether an answer is required."""
    listed: Sequence[Part] = (Field.SET_SIZE, Field.SET) if has_set else (bytes(4),)
    return _submessage(Kind.ACKNACK, Field.FLAGS, Field.READER, Field.WRITER, Field.NUMBER, *listed, Field.COUNT)


def _nack_frag() -> Submessage:
    listed = Field.FRAGMENT, Field.FRAGMENT_SET_SIZE, Field.FRAGMENT_SET, Field.SECOND_COUNT
    return _submessage(Kind.NACK_FRAG, _LITTLE, Field.READER, Field.WRITER, Field.NUMBER, *listed)


def _gap() -> Submessage:
    return _submessage(Kind.GAP, _LITTLE, Field.READER, Field.WRITER, Field.FIRST, Field.LAST, bytes(4))


# --- hardware --------------------------------------------------------------------------------------------------------

_WORDS_IN_ROW = 8


def memory_of(node: Node, entity: str, others: Mapping[str, Words] = MappingProxyType({})) -> Rendering:
    """Return the memory of the programs of a node and of others, as an entity for `firm_packet_builder`."""
    programs = programs_of(node, others)
    words = [f'"{word:011b}"' for word in programs.words]
    return Rendering(
        "vhdl/packets.vhd",
        {
            "entity": entity,
            "node": node.network.name,
            "address_bits": programs.address_bits,
            "packets": [
                {"name": name, "number": number, "entry": entry}
                for number, (name, entry) in enumerate(programs.entries.items())
            ],
            "word_count": len(words),
            "rows": [", ".join(words[at : at + _WORDS_IN_ROW]) for at in range(0, len(words), _WORDS_IN_ROW)],
        },
    )
