"""Packets of peers that announce writers and send samples, and what a node's readers make of them: the reference."""

from __future__ import annotations

import random
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from ipaddress import IPv4Address

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Endpoint, Node
from fusesoc_firm.fabric.rtps import PUBLICATIONS_WRITER, SUBSCRIPTIONS_WRITER, Durability, Parameter, Reliability
from fusesoc_firm.system.derived.model import Network, Quality
from tests.fabric.messages import AckNack, Data, Gap, Heartbeat, InfoDestination, Numbers, Submessage, Writer, parse
from tests.fabric.participant import DISCOVERY, Limits, Participant

HASH = "RIHS01_" + "5af0" * 16
TOPICS = (("rt/count_in", "std_msgs::msg::dds_::UInt32_"), ("rt/count_input", "std_msgs::msg::dds_::String_"))
_DURABLE = Quality(is_reliable=False, is_transient_local=True)
_BEST_EFFORT, _LATCHED = Quality(is_reliable=False), Quality(is_transient_local=True, depth=1)
# Cycles after a packet of discovery, in which the node has done what it has to.
_LONG = 1300
Inline = tuple[tuple[int, bytes], ...]


def a_node() -> Node:
    """A node that reads two topics; one name begins as the other. The second reader wants durable writers."""
    address = IPv4Address("192.0.2.9")
    network = Network(bytes.fromhex("020000000002"), address, IPv4Address("255.255.255.0"), None, "board", "/", 0)
    readers = [
        Endpoint(topic, type_, HASH, bytes([0, 0, number, rtps.USER_READER]), quality)
        for number, ((topic, type_), quality) in enumerate(zip(TOPICS, (_BEST_EFFORT, _DURABLE), strict=True), 2)
    ]
    graph = Endpoint("ros_discovery_info", "graph", HASH, bytes([0, 0, 1, rtps.USER_WRITER]), _LATCHED)
    writer = Endpoint("rt/out", "type", HASH, bytes([0, 0, 4, rtps.USER_WRITER]), _BEST_EFFORT)
    return Node(network, (graph, *readers, writer), 16)


@dataclass(frozen=True)
class Step:
    """A packet at the node, with the cycles before it."""

    before: int
    packet: bytes
    is_aborted: bool = False

    @property
    def row(self) -> str:
        """The row for the bench."""
        numbers = self.before, int(self.is_aborted), len(self.packet), *self.packet
        return " ".join(map(str, numbers)) + "\n"


@dataclass
class Results:
    """Frames to the host; requests as destination, reader, writer, base and size of the set; sizes of sent samples."""

    frames: list[bytes] = field(default_factory=list)
    requests: list[tuple[bytes, bytes, bytes, int, int]] = field(default_factory=list)
    samples: list[int] = field(default_factory=list)


def expected(steps: Sequence[Step], sources: int) -> Results:
    """What the reference does with packets."""
    node, results = a_node(), Results()

    def take(endpoint: Endpoint, payload: bytes) -> None:
        results.frames.append(struct.pack("<BI", node.readers.index(endpoint), len(payload)) + payload)

    participant = Participant(node, take, Limits(peers=8, matches=sources))
    for step in steps:
        if step.is_aborted:
            continue
        participant.receive(step.packet, 0)
        for _, packet in participant.outbox:
            message = parse(packet)
            assert message
            results.requests += _requests(message.submessages)
        participant.outbox.clear()
    print(participant.counts)
    return results


def _requests(items: Sequence[Submessage]) -> list[tuple[bytes, bytes, bytes, int, int]]:
    """The answers to heartbeats."""
    prefix, found = b"", []
    for item in items:
        if isinstance(item, InfoDestination):
            prefix = item.prefix
        elif isinstance(item, AckNack) and item.is_final:
            found.append((prefix, item.reader, item.writer, item.missing.base, item.missing.size))
    return found


@dataclass
class _Writer:
    """A peer's writer of samples."""

    entity: bytes
    number: int = 0


@dataclass
class _Peer:
    """A peer, and what it has announced."""

    prefix: bytes
    is_little: bool
    told: dict[bytes, int] = field(default_factory=lambda: dict.fromkeys(DISCOVERY, 0))
    writers: list[_Writer] = field(default_factory=list)


class Peers:
    """Some peers that announce, end, send and leave at random; if they exaggerate, so do their lists of encodings."""

    def __init__(self, count: int, seed: int, *, exaggerate: bool = False) -> None:
        self._exaggerates = exaggerate
        self._chance, self._node = random.Random(seed), a_node()
        self._peers = [self._peer(number) for number in range(count)]
        self.steps: list[Step] = []
        self._was_slow = False

    def _peer(self, number: int) -> _Peer:
        # The prefixes of two peers differ in one byte only.
        prefix = bytearray(b"\1\x0f" + bytes(10))
        prefix[self._chance.randrange(12)] ^= number + 1
        prefix[11] = number
        return _Peer(bytes(prefix), self._chance.random() < 0.7)

    def run(self, count: int) -> list[Step]:
        """That many turns, after all peers have come."""
        for peer in self._peers:
            self._come(peer)
        ways = {self._announce: 6, self._samples: 20, self._end: 3, self._tell: 3, self._leave: 1, self._skip: 1}
        for _ in range(count):
            self._chance.choices(list(ways), list(ways.values()))[0](self._chance.choice(self._peers))
        return self.steps

    # --- packets -----------------------------------------------------------------------------------------------------

    def _send(self, peer: _Peer, *items: Submessage, is_slow: bool = True) -> None:
        chance = self._chance
        packet = Writer(is_little=peer.is_little).message(peer.prefix, *items)
        before = _LONG if self._was_slow else chance.choice([0, 0, 3, 100])
        self._was_slow = is_slow
        if chance.random() < 0.1:
            self.steps.append(Step(before, packet[: chance.randrange(1, len(packet) + 1)], is_aborted=True))
        self.steps.append(Step(before, packet))

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
        listed = self._parameters(
            peer,
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
            peer.told, peer.writers = dict.fromkeys(DISCOVERY, 0), []
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
        writer = SUBSCRIPTIONS_WRITER if chance.random() < 0.1 else PUBLICATIONS_WRITER
        if writer == PUBLICATIONS_WRITER and all(item.entity != entity for item in peer.writers):
            peer.writers.append(_Writer(entity))
        guids, inline = self._guids(peer, entity)
        listed = [*self._names(peer), *guids]
        chance.shuffle(listed)
        if chance.random() < 0.1:
            # Of two, the first one counts.
            listed.append((Parameter.TOPIC_NAME, self._octets(peer, TOPICS[0][0].encode() + b"\0")))
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

    def _names(self, peer: _Peer) -> list[tuple[int, bytes]]:
        """The parameters of a writer, of which one name may be wrong."""
        chance = self._chance
        topic, type_ = chance.choice(TOPICS)
        hash_ = HASH
        way = chance.randrange(20)
        if way == 0:
            topic = chance.choice([topic[:-1], topic + "s", "", "rt/" + "x" * 300])
        elif way == 1:
            type_ = chance.choice([TOPICS[0][1], TOPICS[1][1], type_ + "_", ""])
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

    def _samples(self, peer: _Peer) -> None:
        """Packets with samples, one after the other."""
        for _ in range(self._chance.randrange(1, 6)):
            items: list[Submessage] = []
            for _ in range(self._chance.randrange(1, 5)):
                if self._chance.random() < 0.5:
                    others = (
                        [self._node.prefix] * 6 + [bytes(12)] * 2 + [bytes(11) + b"\1", self._node.prefix[:11] + b"\1"]
                    )
                    items.append(InfoDestination(self._chance.choice(others)))
                items.append(self._sample(self._chance.choice(peer.writers) if peer.writers else _Writer(b"none")))
            self._send(peer, *items, is_slow=False)
            if self._chance.random() < 0.1:
                step = self.steps[-1]
                self.steps[-1] = Step(step.before, step.packet[: self._chance.randrange(1, len(step.packet))])

    def _sample(self, writer: _Writer) -> Data:
        chance = self._chance
        writer.number += chance.choice([1, 1, 1, 1, 3, 0, -1, 255, 1 << 32 if chance.random() < 0.05 else 1])
        readers = [item.entity for item in self._node.readers]
        reader = chance.choice([rtps.NO_ENTITY, *readers, *readers, bytes([0, 0, 4, rtps.USER_READER])])
        payload = rtps.XCDR1 + chance.randbytes(chance.choice([0, 1, 4, 8, 60]))
        return Data(reader, writer.entity, max(0, writer.number), payload)
