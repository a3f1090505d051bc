"""The reference of a node in fabric: with others of its kind, over a network that loses, repeats and delays packets."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from ipaddress import IPv4Address

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import LEASE_SECONDS, Endpoint, Node
from fusesoc_firm.system.derived.model import Network, Quality
from tests.fabric.messages import AckNack, Address, Data, Heartbeat, Message, parse
from tests.fabric.participant import FRAGMENT_BYTES, Participant
from tests.fabric.participant_tables import Limits, Source
from tests.fabric.test_messages import random_packets
from tests.seeds import seeded

SEED = seeded(20261126)
TYPE, HASH = "std_msgs::msg::dds_::String_", "RIHS01_" + "0" * 64
RELIABLE, BEST_EFFORT = Quality(depth=1000), Quality(is_reliable=False, depth=1000)
LATCHED = Quality(is_transient_local=True, depth=3)
Topics = dict[str, Quality]
DEFAULT = Limits()


def a_node(number: int, writes: Topics, reads: Topics, type_: str = TYPE, hash_: str = HASH) -> Node:
    """A node with an address of its own."""
    address, mask = IPv4Address(f"192.0.2.{number}"), IPv4Address("255.255.255.0")
    network = Network(bytes([2, 0, 0, 0, 0, number]), address, mask, None, f"node{number}", "/", 0)
    graph = Endpoint("ros_discovery_info", "graph", HASH, b"\0\0\1\3", Quality(is_transient_local=True, depth=1))
    writers = [Endpoint(f"rt/{name}", type_, hash_, bytes([0, 0, 9, 3]), quality) for name, quality in writes.items()]
    readers = [Endpoint(f"rt/{name}", type_, hash_, bytes([0, 1, 0, 4]), quality) for name, quality in reads.items()]
    numbered = [replace(item, entity=bytes([0, 0, place, item.entity[3]])) for place, item in enumerate(writers, 2)]
    numbered += [replace(item, entity=bytes([0, 1, place, item.entity[3]])) for place, item in enumerate(readers, 2)]
    return Node(network, (graph, *numbered), 16)


@dataclass
class Station:
    """A participant at the network, and what its readers took."""

    participant: Participant
    took: list[tuple[str, bytes]]

    @property
    def node(self) -> Node:
        return self.participant.node


@dataclass
class Ether:
    """A network with a clock: each packet is lost, comes twice, or comes late."""

    loss: float = 0
    seed: int = SEED
    now: int = 0
    stations: list[Station] = field(default_factory=list)
    sent: list[tuple[str, Message]] = field(default_factory=list)

    def __post_init__(self) -> None:
        print(f"seed {self.seed}")
        self.chance = random.Random(self.seed)
        self.under_way: list[tuple[int, Address, bytes]] = []

    def add(self, node: Node, limits: Limits = DEFAULT, kind: type[Participant] = Participant) -> Station:
        took: list[tuple[str, bytes]] = []
        participant = kind(node, lambda endpoint, payload: took.append((endpoint.topic, payload)), limits)
        station = Station(participant, took)
        self.stations.append(station)
        participant.start(self.now)
        return station

    def publish(self, station: Station, payload: bytes, place: int = 1) -> None:
        station.participant.publish(station.node.writers[place], payload, self.now)

    def step(self) -> None:
        """One millisecond."""
        self.now += 1
        for station in self.stations:
            station.participant.tick(self.now)
        self._send()
        due = [item for item in self.under_way if item[0] <= self.now]
        self.under_way = [item for item in self.under_way if item[0] > self.now]
        for _, address, packet in due:
            for station in self.stations:
                if address.host in (rtps.MULTICAST, str(station.node.network.address)):
                    station.participant.receive(packet, self.now)
        self._send()

    def _send(self) -> None:
        for station in self.stations:
            for address, packet in station.participant.outbox:
                message = parse(packet)
                assert message is not None and message.is_whole and len(packet) <= 1472
                self.sent.append((str(station.node.network.address), message))
                for _ in range(1 + (self.loss > 0 and self.chance.random() < 0.05)):
                    if self.chance.random() >= self.loss:
                        late = self.chance.randrange(1, 9) if self.loss else 1
                        self.under_way.append((self.now + late, address, packet))
            station.participant.outbox.clear()

    def run(self, until: Callable[[], bool], limit: int = 60_000) -> None:
        end = self.now + limit
        while not until():
            assert self.now < end, [station.participant.counts for station in self.stations]
            self.step()

    def wait(self, milliseconds: int) -> None:
        end = self.now + milliseconds
        self.run(lambda: self.now >= end, milliseconds + 1)


def is_matched(*stations: Station, count: int = 1) -> Callable[[], bool]:
    return lambda: all(len(item.participant.sources) + len(item.participant.sinks) == count for item in stations)


def samples(count: int, seed: int = SEED) -> list[bytes]:
    """Payloads of all sizes, some of which need fragments; each is like no other."""
    chance = random.Random(seed)
    sizes = [0, FRAGMENT_BYTES - 8, FRAGMENT_BYTES - 4, *(chance.choice([10, 1000, 5000]) for _ in range(count - 3))]
    return [struct.pack(">I", number) + chance.randbytes(4 + size) for number, size in enumerate(sizes)]


def pair(network: Ether, quality: Quality = RELIABLE, other: Quality | None = None) -> tuple[Station, Station]:
    """A node that writes topic `a` and one that reads it."""
    return network.add(a_node(1, {"a": quality}, {})), network.add(a_node(2, {}, {"a": other or quality}))


@pytest.mark.parametrize("loss", [0, 0.2, 0.4])
def test_every_sample_arrives_once_and_in_order(loss: float) -> None:
    network = Ether(loss)
    writer, reader = pair(network)
    network.run(is_matched(writer, reader))
    wanted = samples(100)
    for payload in wanted:
        network.publish(writer, payload)
        network.step()
    network.run(lambda: len(reader.took) == len(wanted))
    assert reader.took == [("rt/a", payload) for payload in wanted]
    network.run(lambda: all(sink.acknowledged == len(wanted) + 1 for sink in writer.participant.sinks))
    # The samples themselves, some of them in fragments, announcements, and a few requests.
    assert len(network.sent) < (400 if loss == 0 else 4000)
    before = len(network.sent)
    network.wait(1000)
    others = [item for _, message in network.sent[before:] for item in message.submessages]
    # When all is told, only the announcements go on.
    assert [item for item in others if isinstance(item, Heartbeat | AckNack)] == []


class SkippingReader(Participant):
    """A reader that takes no sample before its first heartbeat, and skips what that tells of, as Cyclone DDS does."""

    def _sample(self, source: Source, item: Data) -> None:
        if source.is_heard:
            super()._sample(source, item)

    def _told(self, source: Source, item: Heartbeat) -> None:
        if not source.is_heard:
            source.advance(item.last + 1)
        super()._told(source, item)


@pytest.mark.parametrize("seed", range(20))
def test_a_reader_that_skips_to_its_first_heartbeat_misses_nothing(seed: int) -> None:
    """Its request for a heartbeat is not an acknowledgement, although the heartbeat may get lost."""
    network = Ether(0.3, seed)
    writer = network.add(a_node(1, {"a": RELIABLE}, {}))
    reader = network.add(a_node(2, {}, {"a": RELIABLE}), kind=SkippingReader)
    network.run(is_matched(writer, reader))
    for payload in (b"1", b"2"):
        network.publish(writer, payload)
        network.wait(300)
    network.run(lambda: not any(sink.is_behind for sink in writer.participant.sinks))
    assert reader.took == [("rt/a", b"1"), ("rt/a", b"2")]


def test_best_effort_keeps_the_order_and_asks_for_nothing() -> None:
    network = Ether(0.2)
    writer, reader = pair(network, BEST_EFFORT)
    network.run(is_matched(writer, reader))
    wanted = samples(100)
    for payload in wanted:
        network.publish(writer, payload)
        network.wait(20)
    came = [payload for _, payload in reader.took]
    left = iter(wanted)
    assert all(payload in left for payload in came)
    assert 30 < len(came) < 100
    user = [item for _, message in network.sent for item in message.submessages if isinstance(item, AckNack)]
    assert all(item.writer in (rtps.PUBLICATIONS_WRITER, rtps.SUBSCRIPTIONS_WRITER) for item in user)


@pytest.mark.parametrize(
    ("offered", "wanted", "does_match"),
    [
        (RELIABLE, BEST_EFFORT, True),
        (BEST_EFFORT, RELIABLE, False),
        (RELIABLE, LATCHED, False),
        (LATCHED, RELIABLE, True),
        (LATCHED, BEST_EFFORT, True),
    ],
)
def test_what_is_offered_has_to_be_enough(offered: Quality, wanted: Quality, does_match: bool) -> None:
    network = Ether()
    writer, reader = pair(network, offered, wanted)
    network.wait(1000)
    assert is_matched(writer, reader, count=int(does_match))()
    for station in (writer, reader):
        assert (station.participant.counts["other qualities"] > 0) == (not does_match)


def test_a_late_reader_gets_the_history_of_a_transient_local_writer_alone() -> None:
    network = Ether(0.2)
    writer = network.add(a_node(1, {"a": RELIABLE, "b": LATCHED}, {}))
    for number in range(5):
        network.publish(writer, bytes([number]), 1)
        network.publish(writer, bytes([number]), 2)
    reader = network.add(a_node(2, {}, {"a": RELIABLE, "b": LATCHED}))
    network.run(is_matched(writer, reader, count=2))
    network.publish(writer, b"new", 1)
    network.run(lambda: len(reader.took) == 4)
    network.wait(500)
    assert [item for item in reader.took if item[0] == "rt/a"] == [("rt/a", b"new")]
    assert [item for item in reader.took if item[0] == "rt/b"] == [("rt/b", bytes([number])) for number in (2, 3, 4)]


def test_what_is_no_longer_in_the_history_is_passed_over() -> None:
    network = Ether(1.0)
    writer, reader = pair(network, Quality(depth=10))
    network.loss = 0
    network.run(is_matched(writer, reader))
    network.loss = 1.0
    for number in range(30):
        network.publish(writer, bytes([number]))
        network.step()
    network.loss = 0
    network.run(lambda: len(reader.took) == 10)
    network.wait(500)
    assert reader.took == [("rt/a", bytes([number])) for number in range(20, 30)]


@pytest.mark.parametrize(
    ("type_", "hash_", "reason"), [("other", HASH, "other types"), (TYPE, "RIHS01_1", "other hashes")]
)
def test_another_type_does_not_match(type_: str, hash_: str, reason: str) -> None:
    network = Ether()
    writer = network.add(a_node(1, {"a": RELIABLE}, {}))
    reader = network.add(a_node(2, {}, {"a": RELIABLE}, type_, hash_))
    network.wait(1000)
    assert is_matched(writer, reader, count=0)()
    assert writer.participant.counts[reason] == reader.participant.counts[reason] == 1


def test_a_peer_without_room_is_counted_and_disturbs_nobody() -> None:
    network = Ether()
    board = network.add(a_node(1, {"a": RELIABLE}, {}))
    peers = [network.add(a_node(number, {}, {"a": RELIABLE})) for number in range(2, 10)]
    network.run(is_matched(board, count=8))
    ninth = network.add(a_node(10, {}, {"a": RELIABLE}))
    network.run(lambda: board.participant.counts["peers without room"] > 0)
    for payload in samples(20):
        network.publish(board, payload)
    network.run(lambda: all(len(peer.took) == 20 for peer in peers))
    assert ninth.took == []
    # When one leaves, there is room.
    peers[0].participant.leave()
    network.run(lambda: len(board.participant.peers) == 7)
    network.stations.remove(peers[0])
    network.run(lambda: len(board.participant.peers) == 8)
    assert ninth.node.prefix in board.participant.peers


def test_a_peer_that_is_silent_is_forgotten_after_its_lease() -> None:
    network = Ether()
    board, peer = pair(network)
    network.run(is_matched(board, peer))
    network.stations.remove(peer)
    network.wait(1000 * LEASE_SECONDS - 4000)
    assert is_matched(board)()
    network.wait(5000)
    assert board.participant.peers == {} and is_matched(board, count=0)()


def test_a_node_that_restarts_has_the_same_name_and_is_found_at_once() -> None:
    network = Ether()
    board, peer = pair(network)
    network.run(is_matched(board, peer))
    network.publish(board, b"before")
    network.run(lambda: len(peer.took) == 1)
    network.stations.remove(board)
    again = network.add(board.node)
    begun = network.now
    network.run(is_matched(again, peer))
    assert network.now - begun < 1000
    network.publish(again, b"after")
    network.run(lambda: len(peer.took) == 2)
    assert peer.took[1] == ("rt/a", b"after")


def test_long_samples_of_several_writers_wait_for_each_other() -> None:
    """The second one waits for the place of the first, and then arrives as well."""
    network = Ether()
    writers = [network.add(a_node(number, {"a": RELIABLE}, {})) for number in (1, 2, 3)]
    reader = network.add(a_node(4, {}, {"a": RELIABLE}), DEFAULT)
    network.run(is_matched(reader, count=3))
    network.loss = 0.3
    for writer in writers:
        network.publish(writer, bytes([writer.node.network.mac[5]]) * 20_000)
    network.run(lambda: len(reader.took) == 3)
    assert reader.participant.counts["samples without room"] > 0
    assert sorted(payload[0] for _, payload in reader.took) == [1, 2, 3]


def test_a_payload_that_is_too_long_is_passed_over() -> None:
    network = Ether()
    writer = network.add(a_node(1, {"a": RELIABLE}, {}))
    reader = network.add(a_node(2, {}, {"a": RELIABLE}), Limits(longest=5000))
    network.run(is_matched(writer, reader))
    for size in (5001, 5000, 1000, 60_000, 10):
        network.publish(writer, bytes(size))
    network.run(lambda: len(reader.took) == 3)
    assert [len(payload) for _, payload in reader.took] == [5000, 1000, 10]
    assert reader.participant.counts["payloads that are too long"] >= 2


def hostile_packets(known: bytes, reader: bytes, writer: bytes) -> Iterator[bytes]:
    """Random packets; half of them come from a participant and for an endpoint that the node knows."""
    for packet, _, _ in random_packets(2000, SEED):
        mixed = bytearray(packet)
        if mixed[-1] & 1:
            mixed[8:20] = known
            mixed = bytearray(bytes(mixed).replace(rtps.NO_ENTITY, reader, 1))
        yield bytes(mixed)
        yield bytes(mixed[: len(mixed) // 2])
    yield Data(reader, writer, 1, b"").kind.to_bytes(1, "big") * 100


def test_good_messages_arrive_between_random_packets() -> None:
    network = Ether()
    writer, reader = pair(network)
    network.run(is_matched(writer, reader))
    ours = reader.node.readers[0].entity, b"\0\0\2\3"
    stranger = bytes(range(12))
    wanted = samples(40)
    packets = list(hostile_packets(stranger, *ours))
    for number, packet in enumerate(packets):
        reader.participant.receive(packet, network.now)
        writer.participant.receive(packet, network.now)
        if number % (len(packets) // len(wanted)) == 0 and number // (len(packets) // len(wanted)) < len(wanted):
            network.publish(writer, wanted[number // (len(packets) // len(wanted))])
        network.step()
    network.run(lambda: len(reader.took) == len(wanted))
    assert [payload for _, payload in reader.took] == wanted
    assert reader.participant.counts["faulty packets"] > 100
