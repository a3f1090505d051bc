"""What peers, a host and a clock do to a node, at random, and what the reference participant makes of it."""

from __future__ import annotations

import random
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from ipaddress import IPv4Address

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.control import Sizes
from fusesoc_firm.fabric.node import Endpoint, Node
from fusesoc_firm.fabric.rtps import PUBLICATIONS_WRITER, SUBSCRIPTIONS_WRITER, Durability, Parameter, Reliability
from fusesoc_firm.system.derived.model import Network, Quality
from tests.fabric.messages import (
    AckNack,
    Address,
    Data,
    DataFrag,
    Gap,
    Heartbeat,
    HeartbeatFrag,
    InfoDestination,
    NackFrag,
    Numbers,
    Submessage,
    Writer,
)
from tests.fabric.participant import FRAGMENT_BYTES, Participant
from tests.fabric.participant_tables import DISCOVERY, Limits

HASH = "RIHS01_" + "5af0" * 16
_DURABLE = Quality(is_reliable=False, is_transient_local=True)
_BEST_EFFORT, _LATCHED = Quality(is_reliable=False), Quality(is_transient_local=True, depth=1)
_RELIABLE = Quality(depth=3)
# Of the readers, and of the writers with frames.
READ = (
    ("rt/count_in", "std_msgs::msg::dds_::UInt32_", _BEST_EFFORT),
    ("rt/count_input", "std_msgs::msg::dds_::String_", _DURABLE),
    ("rt/turn", "geometry_msgs::msg::dds_::Quaternion_", _RELIABLE),
)
WRITTEN = (
    ("rt/out", "std_msgs::msg::dds_::UInt32_", _BEST_EFFORT),
    ("rt/sure", "std_msgs::msg::dds_::UInt32_", _RELIABLE),
    ("rt/kept", "std_msgs::msg::dds_::String_", Quality(is_transient_local=True, depth=2)),
)
SURE = 2  # the reader that is reliable
ROOM = Sizes(sources=8, sinks=8)  # in the tables; less than for eight peers
SAMPLE = 64  # bytes of the longest payload that the node sends
LONG = 65536  # the same, if it sends samples in fragments
ASSEMBLED = 4096  # bytes of the longest one that it puts together, if it does
WAITING = 4096  # bytes of payloads that wait
IDLE = -1  # an event that waits until the node has nothing to do
RUSHED = 15  # milliseconds that may come at once
_GAP = 12  # cycles between two packets, at least
_ETHERNET, _UDP = 14, 42  # bytes before the header of IPv4, and before the payload of UDP
_RTPS_HEADER = 20  # bytes
Inline = tuple[tuple[int, bytes], ...]
Sent = tuple[Address, bytes]


def a_node() -> Node:
    """A node that reads and writes three topics; one name begins as another."""
    address = IPv4Address("192.0.2.9")
    network = Network(bytes.fromhex("020000000002"), address, IPv4Address("255.255.255.0"), None, "board", "/", 0)
    graph = Endpoint("ros_discovery_info", "graph", HASH, bytes([0, 0, 1, rtps.USER_WRITER]), _LATCHED)
    kinds = [rtps.USER_READER] * len(READ) + [rtps.USER_WRITER] * len(WRITTEN)
    others = [
        Endpoint(topic, type_, HASH, bytes([0, 0, number, kind]), quality)
        for number, ((topic, type_, quality), kind) in enumerate(zip(READ + WRITTEN, kinds, strict=True), 2)
    ]
    return Node(network, (graph, *others), 16)


class Kind(IntEnum):
    """The kinds of events at a node."""

    PACKET = 0
    ABORTED_PACKET = 1
    TICKS = 2
    FRAME = 3
    ABORTED_FRAME = 4
    RUSHED = 5  # milliseconds, one in each cycle; up to `RUSHED`


@dataclass(frozen=True)
class Event:
    """An event, and the cycles before it; `count` milliseconds, or bytes."""

    kind: Kind
    data: bytes = b""
    count: int = 0
    before: int = IDLE

    @property
    def row(self) -> str:
        """The row for the bench."""
        numbers = self.kind, self.before, self.count or len(self.data), *self.data
        return " ".join(map(str, numbers)) + "\n"


def rushed(count: int) -> list[Event]:
    """Milliseconds as fast as the node can take them."""
    return [Event(Kind.RUSHED, count=min(RUSHED, count - done)) for done in range(0, count, RUSHED)]


@dataclass
class Results:
    """Frames to the host, packets, and how many frames to send were refused."""

    frames: list[bytes] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)
    refused: int = 0
    lossy: int = 0  # packets with a sample without room
    skipped: int = 0  # packets with a sample that is too long


def expected(events: Sequence[Event], assembled: int = 0, sample: int = SAMPLE, waiting: int = WAITING) -> Results:
    """What the reference does; samples in fragments have up to so many bytes, and those that it sends."""
    node, results, now = a_node(), Results(), 0

    def take(endpoint: Endpoint, payload: bytes) -> None:
        results.frames.append(struct.pack("<BI", node.readers.index(endpoint), len(payload)) + payload)

    longest = max(1344, assembled)
    limits = Limits(sources=ROOM.sources, sinks=ROOM.sinks, longest=longest, assembled=assembled, waiting=waiting)
    participant = Participant(node, take, limits)
    participant.start(now)
    for event in events:
        match event.kind:
            case Kind.PACKET:
                participant.receive(event.data, now)
            case Kind.TICKS:
                for _ in range(event.count):
                    now += 1
                    participant.tick(now)
            case Kind.RUSHED:
                now += event.count
                participant.tick(now)
            case Kind.FRAME:
                _publish(participant, event.data, results, now, sample)
        results.sent += participant.outbox
        participant.outbox.clear()
    print(participant.counts)
    results.lossy = participant.counts["packets with samples without room"]
    results.skipped = participant.counts["packets with samples that are too long"]
    return results


def _publish(participant: Participant, frame: bytes, results: Results, now: int, longest: int) -> None:
    if frame[0] >= len(WRITTEN) or not 1 <= len(frame) - 5 <= longest:
        results.refused += 1
    else:
        # A packet has a multiple of four bytes. Only the size in fragments is that of the sample.
        padding = bytes(-len(frame[5:]) % 4) if len(frame) - 5 <= FRAGMENT_BYTES else b""
        participant.publish(participant.node.writers[1 + frame[0]], frame[5:] + padding, now)


def sent(frame: bytes) -> Sent:
    """The address and the message of a frame that a node sent."""
    return Address(str(IPv4Address(frame[30:34])), int.from_bytes(frame[36:38])), frame[_UDP:]


def without_counts(packets: Sequence[Sent]) -> list[Sent]:
    """The same packets without the counts of heartbeats and requests, each of which has to be above the one before.

    A packet that the hardware has prepared may get its count before others that are sent earlier.
    """
    last: dict[tuple[Address, bytes], int] = {}
    results = []
    for address, packet in packets:
        content, place = bytearray(packet), _RTPS_HEADER
        while place < len(packet):
            kind, size = packet[place], int.from_bytes(packet[place + 2 : place + 4], "little")
            ends, end = packet[place + 4 : place + 12], place + 4 + size
            if kind in (rtps.Kind.HEARTBEAT, rtps.Kind.ACKNACK, rtps.Kind.NACK_FRAG):
                count = int.from_bytes(packet[end - 4 : end], "little")
                assert count > last.get((address, ends), 0), f"count {count} of {ends.hex()} comes again"
                last[address, ends] = count
                content[end - 4 : end] = bytes(4)
            place = end
        results.append((address, bytes(content)))
    return results


@dataclass
class _Writer:
    """A peer's writer of samples."""

    entity: bytes
    number: int = 0
    is_sure: bool = False


@dataclass
class _Reader:
    """A peer's reader, and the number of the node's writer."""

    entity: bytes
    ours: int


@dataclass
class _Peer:
    """A peer, and what it has announced."""

    prefix: bytes
    is_little: bool
    told: dict[bytes, int] = field(default_factory=lambda: dict.fromkeys(DISCOVERY, 0))
    writers: list[_Writer] = field(default_factory=list)
    readers: list[_Reader] = field(default_factory=list)


class Peers:
    """Some peers that announce, end, send and leave at random.

    If they exaggerate, so do their lists of encodings. Unless `is_sure`, no writer matches the reliable reader. `burst`
    is the largest number of packets for best effort that are sent one after the other. If it `is_long`, they also send
    samples in fragments; if `waiting` is not 0, also samples of one submessage that find no room in so many bytes.
    `sample` is the size of the longest payload that the node sends; if it may need fragments, the peers ask for some.
    """

    def __init__(
        self,
        count: int,
        seed: int,
        *,
        exaggerate: bool = False,
        is_sure: bool = True,
        burst: int = 5,
        is_long: bool = False,
        waiting: int = 0,
        sample: int = SAMPLE,
    ) -> None:
        self._sample_bytes = sample
        self._is_sure, self._burst, self._is_long, self._waiting = is_sure, burst, is_long, waiting
        self._exaggerates = exaggerate
        self._chance, self._node = random.Random(seed), a_node()
        self._peers = [self._peer(number) for number in range(count)]
        self.events: list[Event] = []
        self._was_slow = True
        self._published = [0] * len(WRITTEN)
        self._requests = 0  # for fragments

    def _peer(self, number: int) -> _Peer:
        # The prefixes of two peers differ in one byte only.
        prefix = bytearray(b"\1\x0f" + bytes(10))
        prefix[self._chance.randrange(12)] ^= number + 1
        prefix[11] = number
        return _Peer(bytes(prefix), self._chance.random() < 0.7)

    def run(self, count: int) -> list[Event]:
        """That many turns, after all peers have come."""
        for peer in self._peers:
            self._come(peer)
        ways = {
            self._announce: 10,
            self._samples: 12,
            self._sure_samples: 12,
            self._user_told: 4,
            self._user_gap: 2,
            self._announce_reader: 8,
            self._ask: 8,
            self._publish: 10,
            self._end: 3,
            self._end_reader: 1,
            self._tell: 3,
            self._ask_discovery: 3,
            self._wait: 8,
            self._leave: 1,
            self._skip: 1,
        }
        if self._is_long:
            ways[self._long_sample] = 40
        if self._waiting:
            ways[self._whole_samples] = 40
        if self._sample_bytes > FRAGMENT_BYTES:
            ways |= {self._ask_for_fragments: 30, self._publish: 30, self._ask: 30}
        for _ in range(count):
            self._chance.choices(list(ways), list(ways.values()))[0](self._chance.choice(self._peers))
        return self.events

    def succession(self) -> list[Event]:
        """A writer ends, and another one gets its place, in one packet with samples that came too early.

        The samples of the second one come when it is asked for them, after its heartbeat. Then come more writers than
        find room.
        """
        peer, (gone, new) = self._peers[0], (bytes([0, 0, number, rtps.USER_WRITER]) for number in (7, 8))
        told = DISCOVERY[PUBLICATIONS_WRITER], PUBLICATIONS_WRITER
        status = (Parameter.STATUS_INFO, bytes([0, 0, 0, 3])), (Parameter.KEY_HASH, peer.prefix + gone)
        early = [Data(rtps.NO_ENTITY, gone, number, rtps.XCDR1) for number in range(5, 9)]
        self._come(peer)
        self._send(peer, Data(*told, 1, self._sure_writer(peer, gone)))
        self._send(peer, Data(*told, 2, None, status), Data(*told, 3, self._sure_writer(peer, new)), *early)
        self._send(peer, Heartbeat(rtps.NO_ENTITY, new, 1, 2, 1, False))
        for number in (1, 2):
            self._send(peer, Data(rtps.NO_ENTITY, new, number, rtps.XCDR1 + bytes([number] * 4)))
        for number in range(4, 12):
            entity = bytes([0, 0, 16 + number, rtps.USER_WRITER])
            self._send(peer, Data(*told, number, self._sure_writer(peer, entity)))
        peer.told[PUBLICATIONS_WRITER] = 11
        return self.events

    def flood(self, count: int) -> dict[int, Event]:
        """A peer announces so many writers in one packet, and says so; the events in which it does so one by one."""
        (peer,), told = self._peers, (DISCOVERY[PUBLICATIONS_WRITER], PUBLICATIONS_WRITER)
        filler = Parameter.USER_DATA, self._octets(peer, bytes(600))
        items = [
            Data(*told, number, self._sure_writer(peer, bytes([0, 0, number, rtps.USER_WRITER]), filler))
            for number in range(1, count + 1)
        ]
        self._come(peer)
        self._send(peer, self._destination(), *items)
        self._send(peer, self._destination(), Heartbeat(*told, 1, count, 7, True))
        writer = Writer(is_little=peer.is_little)
        return {item.number: Event(Kind.PACKET, writer.message(peer.prefix, item)) for item in items}

    def _sure_writer(self, peer: _Peer, entity: bytes, *others: tuple[int, bytes]) -> bytes:
        """The announcement of a writer that matches the reliable reader."""
        topic, type_, _ = READ[SURE]
        return self._parameters(
            peer,
            (Parameter.ENDPOINT_GUID, peer.prefix + entity),
            (Parameter.TOPIC_NAME, self._octets(peer, topic.encode() + b"\0")),
            (Parameter.TYPE_NAME, self._octets(peer, type_.encode() + b"\0")),
            (Parameter.RELIABILITY, self._word(peer, Reliability.RELIABLE) + bytes(8)),
            *others,
        )

    # --- packets -----------------------------------------------------------------------------------------------------

    def _send(self, peer: _Peer, *items: Submessage, is_slow: bool = True) -> None:
        chance = self._chance
        packet = Writer(is_little=peer.is_little).message(peer.prefix, *items)
        before = IDLE if is_slow or self._was_slow else _GAP + chance.choice([0, 0, 3, 100])
        self._was_slow = is_slow
        if chance.random() < 0.1:
            part = packet[: chance.randrange(1, len(packet) + 1)]
            self.events.append(Event(Kind.ABORTED_PACKET, part, before=before))
            before = max(before, _GAP)
        self.events.append(Event(Kind.PACKET, packet, before=before))

    def _parameters(self, peer: _Peer, *items: tuple[int, bytes]) -> bytes:
        order = "<" if peer.is_little else ">"
        texts = [struct.pack(order + "HH", number, len(value)) + value for number, value in items]
        ends = struct.pack(order + "HH", Parameter.SENTINEL, 0)
        return bytes([0, 2 + peer.is_little, 0, 0]) + b"".join(texts) + ends

    def _word(self, peer: _Peer, *numbers: int) -> bytes:
        return struct.pack(("<" if peer.is_little else ">") + f"{len(numbers)}I", *numbers)

    def _octets(self, peer: _Peer, text: bytes) -> bytes:
        # Bytes after the text, if there is a need for some, may be any.
        return self._word(peer, len(text)) + text + self._chance.randbytes(-len(text) % 4)

    def _locator(self, peer: _Peer, port: int) -> bytes:
        return self._word(peer, 1, port) + bytes(12) + bytes([192, 0, 2, 1])

    # --- turns -------------------------------------------------------------------------------------------------------

    def _come(self, peer: _Peer) -> None:
        lease = [(Parameter.LEASE_DURATION, self._word(peer, 1000, 0))] if self._chance.random() < 0.7 else []
        listed = self._parameters(
            peer,
            *lease,
            (Parameter.PARTICIPANT_GUID, peer.prefix + rtps.PARTICIPANT),
            (Parameter.DEFAULT_UNICAST_LOCATOR, self._locator(peer, 7413)),
            (Parameter.METATRAFFIC_UNICAST_LOCATOR, self._locator(peer, 7412)),
        )
        self._send(peer, Data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 1, listed))

    def _leave(self, peer: _Peer) -> None:
        """The farewell of a peer, which comes back at once, and begins anew."""
        status = (Parameter.STATUS_INFO, bytes([0, 0, 0, 3])), (Parameter.KEY_HASH, peer.prefix + rtps.PARTICIPANT)
        self._send(peer, Data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 2, None, status))
        if self._chance.random() < 0.8:
            peer.told, peer.writers, peer.readers = dict.fromkeys(DISCOVERY, 0), [], []
            self._come(peer)

    def _discover(self, peer: _Peer, writer: bytes, payload: bytes | None, inline: Inline, *, is_key: bool) -> None:
        """The next sample of a writer of discovery, which may get lost until it is asked for, or come twice."""
        peer.told[writer] += 1
        item = Data(DISCOVERY[writer], writer, peer.told[writer], payload, inline, is_key)
        if self._chance.random() < 0.2:
            self._tell(peer, writer)
        for _ in range(self._chance.choice([1, 1, 1, 2])):
            self._send(peer, self._destination(), item)

    def _destination(self) -> InfoDestination:
        return InfoDestination(self._chance.choice([self._node.prefix, self._node.prefix, bytes(12)]))

    def _tell(self, peer: _Peer, writer: bytes | None = None) -> None:
        chosen = writer or self._chance.choice(list(DISCOVERY))
        first = self._chance.choice([1, 1, 1, max(1, peer.told[chosen])])
        is_final = self._chance.random() < 0.3
        beat = Heartbeat(DISCOVERY[chosen], chosen, first, peer.told[chosen], 7, is_final)
        self._send(peer, self._destination(), beat)

    def _skip(self, peer: _Peer) -> None:
        """Samples of discovery that their writer no longer has."""
        chosen = self._chance.choice(list(DISCOVERY))
        start = self._chance.randrange(1, peer.told[chosen] + 3)
        end = start + self._chance.randrange(1, 4)
        peer.told[chosen] = max(peer.told[chosen], end - 1)
        self._send(peer, self._destination(), Gap(DISCOVERY[chosen], chosen, start, Numbers(end)))

    def _announce(self, peer: _Peer) -> None:
        """A writer that may match, new or known; sometimes a reader."""
        chance = self._chance
        is_known = bool(peer.writers) and chance.random() < 0.1
        entity = chance.choice(peer.writers).entity if is_known else self._new_entity()
        topic = chance.choice(READ if self._is_sure else READ[:SURE])
        if all(item.entity != entity for item in peer.writers):
            peer.writers.append(_Writer(entity, is_sure=topic == READ[SURE]))
        self._announce_endpoint(peer, PUBLICATIONS_WRITER, entity, topic[:2])

    def _announce_reader(self, peer: _Peer) -> None:
        chance = self._chance
        is_known = bool(peer.readers) and chance.random() < 0.1
        entity = chance.choice(peer.readers).entity if is_known else self._new_entity()[:3] + bytes([rtps.USER_READER])
        ours = chance.randrange(len(WRITTEN) + 1)
        topic = ("ros_discovery_info", "graph") if ours == len(WRITTEN) else WRITTEN[ours][:2]
        if all(item.entity != entity for item in peer.readers):
            peer.readers.append(_Reader(entity, ours))
        self._announce_endpoint(peer, SUBSCRIPTIONS_WRITER, entity, topic)

    def _announce_endpoint(self, peer: _Peer, writer: bytes, entity: bytes, names: tuple[str, str]) -> None:
        chance = self._chance
        guids, inline = self._guids(peer, entity)
        is_durable = writer == PUBLICATIONS_WRITER and chance.random() < 0.7
        listed = [*self._names(peer, *names, is_durable), *guids]
        if chance.random() < 0.4:
            listed.append((Parameter.UNICAST_LOCATOR, self._locator(peer, chance.choice([7500, 9000]))))
        chance.shuffle(listed)
        if chance.random() < 0.1:
            # Of two, the first one counts.
            listed.append((Parameter.TOPIC_NAME, self._octets(peer, READ[0][0].encode() + b"\0")))
        payload = self._parameters(peer, *listed)
        if not inline and chance.random() < 0.05:
            payload = payload[: chance.randrange(len(payload))]
        elif chance.random() < 0.05:
            payload = chance.choice([b"\0\1", b"\1\3"]) + payload[2:]
        self._discover(peer, writer, payload, inline, is_key=False)

    def _new_entity(self) -> bytes:
        return bytes([0, self._chance.randrange(2), self._chance.randrange(256), rtps.USER_WRITER])

    def _guids(self, peer: _Peer, entity: bytes) -> tuple[list[tuple[int, bytes]], Inline]:
        """How a GUID is told: as a parameter, as a key hash, or as both, of which the first one counts."""
        guid = peer.prefix + entity
        other = self._chance.choice([self._node.prefix + entity, bytes(12) + entity])
        way = self._chance.randrange(10)
        parameters = [] if way == 1 else [(Parameter.ENDPOINT_GUID, other if way == 0 else guid)]
        inline: Inline = ((Parameter.KEY_HASH, guid if way == 1 else bytes(16)),) if way in (1, 2) else ()
        return list(parameters), inline

    def _names(self, peer: _Peer, topic: str, type_: str, is_durable: bool) -> list[tuple[int, bytes]]:
        """The parameters of an endpoint, of which one name may be wrong."""
        chance = self._chance
        hash_ = HASH
        # Half of them match whatever the node wants or offers, unless they want something durable.
        way = chance.randrange(40) if not self._exaggerates else 20
        if way > 20:
            return [
                (Parameter.TOPIC_NAME, self._octets(peer, topic.encode() + b"\0")),
                (Parameter.TYPE_NAME, self._octets(peer, type_.encode() + b"\0")),
                (Parameter.RELIABILITY, self._word(peer, chance.choice([1, 2, 2, 2, 2])) + bytes(8)),
                (Parameter.DURABILITY, self._word(peer, int(is_durable or topic == WRITTEN[2][0]))),
            ]
        if way == 0:
            topic = chance.choice([topic[:-1], topic + "s", "", "rt/" + "x" * 300])
        elif way == 1:
            type_ = chance.choice([READ[0][1], READ[1][1], type_ + "_", ""])
        elif way == 2:
            hash_ = chance.choice([HASH[:-1], HASH + "0", HASH[:-1] + "1", "RIHS01_", "1"])
        return [
            (Parameter.TOPIC_NAME, self._octets(peer, topic.encode() + b"\0")),
            (Parameter.TYPE_NAME, self._octets(peer, type_.encode() + b"\0")),
            *self._others(peer, hash_),
        ]

    def _others(self, peer: _Peer, hash_: str) -> list[tuple[int, bytes]]:
        chance, word = self._chance, self._word
        hash_texts = [
            f"typehash={hash_};",
            f"typehash={hash_}",
            f"enclave=/;typehash={hash_};x",
            f"a;typehash={hash_};",
        ]
        texts = [*hash_texts, f"typehash={hash_};typehash={HASH};"] * 3 + ["", "typehash=;", "typehas", "x" * 300]
        order = "<" if peer.is_little else ">"
        encodings = chance.choice([[0], [0, 2], [2, 0], [], [7] * 15 + [0], [0], [0], [2], [256]])
        if self._exaggerates:
            encodings = [7] * 16
        some = {
            Parameter.USER_DATA: self._octets(peer, chance.choice(texts).encode()),
            Parameter.RELIABILITY: word(peer, chance.choice([Reliability.BEST_EFFORT, Reliability.RELIABLE]))
            + bytes(8),
            Parameter.DURABILITY: word(peer, chance.choice([Durability.VOLATILE] + [Durability.TRANSIENT_LOCAL] * 3)),
            Parameter.PARTITION: word(peer, chance.choice([0] * 9 + [1])) + bytes(8),
            Parameter.DATA_REPRESENTATION: word(peer, 65536 if self._exaggerates else len(encodings))
            + struct.pack(f"{order}{len(encodings)}H", *encodings)
            + bytes(2 * (len(encodings) % 2)),
            Parameter.PROTOCOL_VERSION: bytes(chance.choice([0, 4])),
        }
        return [
            (number, value)
            for number, value in some.items()
            if chance.random() < (0.9 if number == Parameter.DURABILITY else 0.6)
        ]

    def _end(self, peer: _Peer) -> None:
        """A writer ends; its key is told by a payload or inline."""
        if not peer.writers:
            return
        gone = self._chance.choice(peer.writers)
        status = (Parameter.STATUS_INFO, bytes([0, 0, 0, self._chance.choice([1, 2, 3])]))
        guid = peer.prefix + gone.entity
        if self._chance.random() < 0.5:
            key = self._parameters(peer, (Parameter.ENDPOINT_GUID, guid))
            self._discover(peer, PUBLICATIONS_WRITER, key, (status,), is_key=True)
        else:
            self._discover(peer, PUBLICATIONS_WRITER, None, (status, (Parameter.KEY_HASH, guid)), is_key=False)

    def _end_reader(self, peer: _Peer) -> None:
        if peer.readers:
            status = (Parameter.STATUS_INFO, bytes([0, 0, 0, 3]))
            key = (Parameter.KEY_HASH, peer.prefix + self._chance.choice(peer.readers).entity)
            self._discover(peer, SUBSCRIPTIONS_WRITER, None, (status, key), is_key=False)

    def _samples(self, peer: _Peer) -> None:
        """Packets with samples for best effort, one after the other."""
        writers = [item for item in peer.writers if not item.is_sure] or [_Writer(b"none")]
        for _ in range(self._chance.randrange(1, self._burst + 1)):
            items: list[Submessage] = []
            for _ in range(self._chance.randrange(1, 5)):
                if self._chance.random() < 0.5:
                    others = (
                        [self._node.prefix] * 6 + [bytes(12)] * 2 + [bytes(11) + b"\1", self._node.prefix[:11] + b"\1"]
                    )
                    items.append(InfoDestination(self._chance.choice(others)))
                items.append(self._sample(self._chance.choice(writers)))
            self._send(peer, *items, is_slow=False)
            if self._chance.random() < 0.1:
                event = self.events[-1]
                part = event.data[: self._chance.randrange(1, len(event.data))]
                self.events[-1] = Event(Kind.PACKET, part, before=event.before)

    def _sample(self, writer: _Writer) -> Data:
        chance = self._chance
        writer.number += chance.choice([1, 1, 1, 1, 3, 0, -1, 255, 1 << 32 if chance.random() < 0.05 else 1])
        return self._data(writer, max(0, writer.number))

    def _data(self, writer: _Writer, number: int) -> Data:
        chance = self._chance
        readers = [item.entity for item in self._node.readers]
        reader = chance.choice([rtps.NO_ENTITY, *readers, *readers, bytes([0, 0, 4, rtps.USER_WRITER])])
        payload = rtps.XCDR1 + chance.randbytes(chance.choice([0, 1, 4, 8, 60]))
        return Data(reader, writer.entity, number, payload)

    def _sure(self, peer: _Peer) -> _Writer:
        # Later ones seldom found room.
        return self._chance.choice([item for item in peer.writers if item.is_sure][:2] or [_Writer(b"none")])

    def _sure_samples(self, peer: _Peer) -> None:
        """Samples for a reliable reader: some are lost, repeated or sent late, without a payload or in fragments."""
        chance, writer = self._chance, self._sure(peer)
        numbers = [writer.number + chance.choice([1, 1, 1, 1, 1, 2, 3, 0, -1])]
        if chance.random() < 0.5:
            # As if they had been asked for.
            numbers = list(range(max(1, writer.number - 8), writer.number + 2))
        for number in numbers:
            writer.number = max(writer.number, number)
            item: Data | DataFrag = self._data(writer, max(0, number))
            if chance.random() < 0.9:
                item = replace(item, reader=chance.choice([rtps.NO_ENTITY, self._node.readers[SURE].entity]))
            way = chance.randrange(12)
            if way == 0:
                item = Data(item.reader, item.writer, item.number, None)
            elif way == 1:
                item = DataFrag(item.reader, item.writer, item.number, 1, 1, 1024, 4096, chance.randbytes(1024))
            self._send(peer, self._destination(), item)

    def _long_sample(self, peer: _Peer) -> None:
        """A sample in fragments, some of which are lost, damaged, repeated, or beside those of another writer."""
        chance, other = self._chance, self._chance.choice(self._peers)
        parts = self._parts(peer)
        others = self._parts(other) if chance.random() < 0.3 else []
        while parts:
            items = [parts.pop(0)]
            if parts and chance.random() < 0.3:
                items.append(parts.pop(0))
            way = chance.randrange(14)
            if way == 0:
                items[0] = self._damaged(items[0])
            elif way == 1:
                self._send(peer, self._destination(), self._told_of(items[0]))
            elif way == 2:
                # Each is many cycles of work.
                few = [[Event(Kind.TICKS, count=count)] for count in (1, 20)]
                self.events += chance.choice([*few, rushed(1000)])
            elif way == 3 and others:
                self._send(other, self._destination(), others.pop(0))
            for _ in range({4: 0, 5: 2}.get(way, 1)):
                self._send(peer, self._destination(), *items)
            if way == 6:
                event = self.events[-1]
                self.events[-1] = replace(event, data=event.data[: chance.randrange(20, len(event.data))])
        for item in others:
            self._send(other, self._destination(), item)

    def _whole_samples(self, peer: _Peer) -> None:
        """Packets of samples of all sizes in one submessage each, and fragments; some are cut, aborted or repeated.

        Best-effort readers get no fragments, and their packets keep their order.
        """
        chance, is_sure = self._chance, self._is_sure
        for _ in range(chance.randrange(1, 4)):
            other = [item for item in peer.writers if not item.is_sure] or [_Writer(b"none")]
            writer = self._sure(peer) if is_sure and chance.random() < 0.6 else chance.choice(other)
            parts = self._parts(peer) if is_sure and chance.random() < 0.3 else []
            number = max(1, writer.number + chance.choice([1, 1, 1, 1, 1, 0, -1, 2]))
            items: list[Data | DataFrag] = []
            for _ in range(chance.choice([1, 1, 1, 2, 2, 3])):
                if parts and chance.random() < 0.5:
                    items.append(parts.pop(0))
                items.append(self._whole(writer, number))
                writer.number = max(writer.number, number)
                number += chance.choice([1, 1, 1, 0])
            # The reference asks for a sample at once, and not after the packet, which may have it.
            items.sort(key=lambda item: item.number)
            for _ in range(chance.choice([1, 1, 1, 2])):
                self._send(peer, self._destination(), *items, is_slow=is_sure)
            # A cut sample takes the place of an older one of its writer, which the reference does not see.
            if len(items) == 1 and chance.random() < 0.2:
                event = self.events[-1]
                self.events[-1] = replace(event, data=event.data[: chance.randrange(20, len(event.data))])
            for part in parts:
                self._send(peer, self._destination(), part)
            if is_sure and chance.random() < 0.3:
                told = Heartbeat(rtps.NO_ENTITY, writer.entity, 1, writer.number, 4, chance.random() < 0.5)
                self._send(peer, self._destination(), told)

    def _whole(self, writer: _Writer, number: int) -> Data:
        chance = self._chance
        sizes = [self._waiting + place for place in (-1, 0, 1)] + [ASSEMBLED + place for place in (-1, 0, 1, 900)]
        size = chance.choice([*sizes, *range(1, 9), self._waiting // 2, self._waiting // 2 + 1, 2 * self._waiting])
        inline = ((Parameter.STATUS_INFO, bytes(4)),) if chance.random() < 0.2 else ()
        reader = chance.choice([rtps.NO_ENTITY] * 9 + [self._node.readers[0].entity])
        return Data(reader, writer.entity, number, chance.randbytes(size), inline)

    def _parts(self, peer: _Peer) -> list[DataFrag]:
        """The fragments of a sample, some of them twice, as if they had been asked for."""
        chance = self._chance
        writer = chance.choice([item for item in peer.writers if not item.is_sure] or [_Writer(b"none")])
        if chance.random() < 0.7:
            writer = self._sure(peer)
        number = max(0, writer.number + chance.choice([1, 1, 1, 1, 1, 1, 0, 2]))
        writer.number = max(writer.number, number)
        size = chance.choice([*range(90, 100), 1000, 2047, ASSEMBLED - 1, ASSEMBLED, ASSEMBLED + 1])
        each = chance.choice([8, 50, 256, 1000, ASSEMBLED]) if size < 300 else chance.choice([256, 1000, 2000])
        payload = rtps.XCDR1 + chance.randbytes(size - 4)
        found, first = [], 1
        while (start := (first - 1) * each) < size:
            count = chance.choice([1, 1, 1, 2, 3])
            count = min(count, -(-(size - start) // each))
            content = payload[start : start + count * each]
            # The last submessage may be padded.
            content += bytes(chance.choice([0, -len(content) % 4])) if start + count * each >= size else b""
            found.append(DataFrag(rtps.NO_ENTITY, writer.entity, number, first, count, each, size, content))
            first += count
        again = chance.randrange(len(found)) if chance.random() < 0.4 else len(found)
        return [*found, *found[again:]]

    def _damaged(self, part: DataFrag) -> DataFrag:
        chance, is_short = self._chance, part.size <= ASSEMBLED
        return chance.choice(
            [
                replace(part, fragment_bytes=chance.choice([0, part.fragment_bytes - 1, 65535])),
                replace(part, first=chance.choice([0, part.first + 1, 65536 + part.first, 1 << 31])),
                replace(part, count=chance.choice([0, part.count + 1, 65535])),
                replace(part, size=chance.choice([0, part.size - 1, part.size + 65536, 1 << 31, 65535])),
                replace(part, payload=part.payload[: chance.randrange(len(part.payload))]),
                replace(part, payload=part.payload + chance.randbytes(chance.randrange(1, 40))),
                # The program knows the lower 32 bits of numbers only.
                replace(part, number=part.number + chance.choice([1, 1 << 32, 1 << 48][: 1 + 2 * is_short])),
                replace(part, is_key=True),
            ]
        )

    def _told_of(self, part: DataFrag) -> Heartbeat | HeartbeatFrag:
        if self._chance.random() < 0.5:
            last = max(0, part.first + self._chance.choice([-2, -1, 0, 5]))
            return HeartbeatFrag(rtps.NO_ENTITY, part.writer, part.number, last, 3)
        return Heartbeat(rtps.NO_ENTITY, part.writer, 1, part.number, 4, self._chance.random() < 0.5)

    def _user_told(self, peer: _Peer) -> None:
        writer, chance = self._sure(peer), self._chance
        first = max(0, chance.choice([1, 1, 1, writer.number, writer.number + 1, writer.number - 3]))
        last = max(0, writer.number + chance.choice([0, 0, 0, 2, -1]))
        writer.number = max(writer.number, last)
        reader = chance.choice([rtps.NO_ENTITY, self._node.readers[SURE].entity, self._node.readers[0].entity])
        self._send(peer, self._destination(), Heartbeat(reader, writer.entity, first, last, 9, chance.random() < 0.5))

    def _user_gap(self, peer: _Peer) -> None:
        writer, chance = self._sure(peer), self._chance
        start = max(1, writer.number + chance.choice([-2, 0, 1, 1, 2]))
        base = start + chance.choice([0, 1, 1, 3])
        others = Numbers.of([base + place for place in range(20) if chance.random() < 0.6], base)
        self._send(peer, self._destination(), Gap(self._node.readers[SURE].entity, writer.entity, start, others))
        writer.number = max(writer.number, base - 1)

    def _ask(self, peer: _Peer) -> None:
        """A reader acknowledges, and asks for samples."""
        chance = self._chance
        if not peer.readers:
            return
        reader = chance.choice(peer.readers[:3])
        last = 1 if reader.ours == len(WRITTEN) else self._published[reader.ours]
        base = max(0, last + chance.choice([1, 1, 1, 0, -1, -2, -5, -5, -6, -300]))
        wanted = [base + place for place in range(chance.choice([0, 0, 1, 5, 8, 40])) if chance.random() < 0.7]
        writer = self._node.writers[0 if reader.ours == len(WRITTEN) else 1 + reader.ours]
        if chance.random() < 0.1:
            writer = chance.choice(self._node.writers)
        answer = AckNack(reader.entity, writer.entity, Numbers.of(wanted, base), 3, chance.random() < 0.6)
        self._send(peer, self._destination(), answer)

    def _ask_discovery(self, peer: _Peer) -> None:
        chance = self._chance
        writer = chance.choice(list(DISCOVERY))
        base = chance.randrange(6)
        wanted = [base + place for place in range(chance.choice([0, 3, 9])) if chance.random() < 0.7]
        answer = AckNack(DISCOVERY[writer], writer, Numbers.of(wanted, base), 3, chance.random() < 0.5)
        self._send(peer, self._destination(), answer)

    def _publish(self, _: _Peer) -> None:
        """A frame of the Manager, seldom one that is refused or aborted."""
        chance = self._chance
        size = self._size()
        number = chance.choice([*range(len(WRITTEN)), *range(len(WRITTEN)), *range(len(WRITTEN)), len(WRITTEN), 255])
        frame = bytes([number]) + struct.pack("<I", size) + rtps.XCDR1 + chance.randbytes(size - 4)
        is_aborted = chance.random() < 0.1
        self.events.append(Event(Kind.ABORTED_FRAME if is_aborted else Kind.FRAME, frame))
        if number < len(WRITTEN) and size <= self._sample_bytes and not is_aborted:
            self._published[number] += 1
        self._was_slow = True

    def _size(self) -> int:
        """The size of a sample; most of those that need fragments have few."""
        chance, longest = self._chance, self._sample_bytes
        if longest <= FRAGMENT_BYTES or chance.random() < 0.4:
            sizes = [4, 8, 12, SAMPLE, SAMPLE, SAMPLE + 1, SAMPLE + 40 if chance.random() < 0.2 else 8]
            return chance.choice(sizes)
        if chance.random() < 0.1:
            return chance.choice([65280, longest - 1, longest, longest + 1])
        return FRAGMENT_BYTES * chance.choice([1, 1, 1, 2, 3]) + chance.choice([-3, -1, 0, 0, 1, 2, 700])

    def _ask_for_fragments(self, peer: _Peer) -> None:
        """A reader lacks fragments of a sample, which may be another one than it has got, or says so."""
        chance = self._chance
        reader = chance.choice(peer.readers[:3] or [_Reader(b"none", 0)])
        # The writer of ros_discovery_info has no bit of its own here.
        ours = reader.ours if chance.random() < 0.9 else chance.randrange(len(WRITTEN) + 1)
        last = 1 if ours == len(WRITTEN) else self._published[ours]
        number = max(0, last + chance.choice([0, 0, 0, 0, -1, -1, -2, -3, 1, -last, 1 << 32]))
        base = chance.choice([1, 1, 1, 2, 3, 40, 0, 48, 50, 60, 300, (1 << 32) - 2])
        wanted = [base + place for place in range(chance.choice([0, 1, 2, 3, 49, 256])) if chance.random() < 0.7]
        writer = self._node.writers[0 if ours == len(WRITTEN) else 1 + ours]
        # Most counts are new, and some old ones come again.
        self._requests += 1
        count = self._requests if chance.random() < 0.8 else chance.choice([0, self._requests - 1, (1 << 32) - 1])
        request = NackFrag(reader.entity, writer.entity, number, Numbers.of(wanted, base), count)
        self._send(peer, self._destination(), request)

    def _wait(self, _: _Peer) -> None:
        self.events.append(Event(Kind.TICKS, count=self._chance.choice([1, 3, 19, 20, 21, 40])))
        self._was_slow = True
