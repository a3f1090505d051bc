"""A node that sends samples in fragments, and the reference participant as its peers: nothing is lost or doubled."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Sequence

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.control import Sizes
from tests.cores.announcements import Event, Kind, Results
from tests.cores.rtps_peers import DEPTH, Host, Net, a_node_with, peer_of
from tests.cores.rtps_world import World
from tests.fabric.messages import (
    AckNack,
    Data,
    DataFrag,
    Heartbeat,
    InfoDestination,
    Numbers,
    Submessage,
    Writer,
    parse,
)
from tests.fabric.participant import FRAGMENT_BYTES, LATER

SEED = 20261127
TOPICS = 2
NODE = a_node_with(TOPICS)
SIZES = Sizes.of(NODE)
# Bytes of a slot, of which there are 32.
SAMPLE = 32768
# Readers of a topic at one peer, as many as find room.
READERS = 7
# Cycles in which the first reader gets a part of a sample.
SOON_CYCLES = 20_000

pytestmark = [pytest.mark.check, pytest.mark.xdist_group("rtps_long")]


def _world() -> World:
    return World(0, NODE, SIZES, sample=SAMPLE)


def _payload(chance: random.Random, size: int) -> bytes:
    return rtps.XCDR1 + chance.randbytes(size - len(rtps.XCDR1))


@pytest.mark.parametrize(("count", "loss"), [(20, 0), (60, 0.03), (40, 0.2)])
def test_samples_of_all_sizes_arrive_once_and_in_order(count: int, loss: float) -> None:
    """At two peers, whose requests for samples and fragments get lost, too; each topic has samples under way."""
    chance = random.Random(SEED)
    sizes = [8, 1344, 1348, 2688, 2692, 9000, SAMPLE]
    wanted = [[_payload(chance, chance.choice(sizes)) for _ in range(count)] for _ in range(TOPICS)]
    with _world() as world:
        peers = [Host(peer_of(NODE, number)) for number in (1, 2)]
        net = Net(world, peers, loss)
        net.run(lambda: world.entries == [2, 2 * TOPICS, 2 * (TOPICS + 1)])
        published = [0] * TOPICS
        while any(len(items) < count for peer in peers for items in peer.topics):
            for topic in range(TOPICS):
                arrived = min(len(peer.topics[topic]) for peer in peers)
                if published[topic] < min(count, arrived + min(DEPTH, 3)):
                    net.publish(topic, wanted[topic][published[topic]])
                    published[topic] += 1
            net.step()
        print(f"{net.now} ms, {net.sent} packets of the node")
        assert all(peer.topics == wanted for peer in peers)


def _matched(world: World) -> Net:
    """A peer with several readers of each topic, at rest."""
    net = Net(world, [Host(peer_of(NODE, 1, READERS))])
    net.run(lambda: world.entries == [1, TOPICS, READERS * TOPICS + 1])
    for _ in range(600):
        net.step()
    return net


def _items(results: Sequence[Results]) -> list[Submessage]:
    packets = [packet for result in results for _, packet in result.sent]
    return [item for packet in packets if (message := parse(packet)) for item in message.submessages]


def _frame(payload: bytes) -> Event:
    return Event(Kind.FRAME, bytes([0]) + len(payload).to_bytes(4, "little") + payload)


def _from(net: Net, item: Submessage, before: int) -> Event:
    """A packet of the peer, while the node is sending."""
    prefix = net.peers[0].node.prefix
    return Event(Kind.PACKET, Writer().message(prefix, InfoDestination(NODE.prefix), item), before=before)


def _sent(net: Net, *events: Event) -> list[Submessage]:
    """What events cause until all is done."""
    return _items([net.world.do(event) for event in (*events, Event(Kind.TICKS))])


def _readers(net: Net) -> list[bytes]:
    """The readers of the first topic."""
    topic = NODE.writers[1].topic
    return [item.entity for item in net.peers[0].node.readers if item.topic == topic]


def _parts(items: Sequence[Submessage]) -> Counter[bytes]:
    """The fragments for each reader."""
    return Counter(item.reader for item in items if isinstance(item, DataFrag))


COUNT = -(-SAMPLE // FRAGMENT_BYTES)


def test_others_are_served_between_the_readers_of_a_sample() -> None:
    """The request of a writer is answered long before the last reader has got the sample."""
    payload = _payload(random.Random(SEED), SAMPLE)
    with _world() as world:
        net = _matched(world)
        writer = net.peers[0].node.writers[-1]
        wants = Heartbeat(NODE.readers[-1].entity, writer.entity, 1, 0, 1, False)
        items = _sent(net, _frame(payload), _from(net, wants, SOON_CYCLES))
        (answer,) = (place for place, item in enumerate(items) if isinstance(item, AckNack))
        assert set(_parts(items[:answer]).values()) == {COUNT} and len(_parts(items[:answer])) <= 2
        assert _parts(items) == dict.fromkeys(_readers(net), COUNT)


@pytest.mark.parametrize("number", [1, 2])
def test_a_reader_that_asks_before_its_turn_gets_each_sample_once(number: int) -> None:
    """The one before, or the one that is being sent to other readers."""
    chance = random.Random(SEED)
    with _world() as world:
        net = _matched(world)
        readers = _readers(net)
        _sent(net, _frame(_payload(chance, SAMPLE)))
        asks = AckNack(readers[-1], NODE.writers[1].entity, Numbers.of([number], number), 99)
        items = _sent(net, _frame(_payload(chance, SAMPLE)), _from(net, asks, SOON_CYCLES))
        assert list(_parts(items)).index(readers[-1]) <= 2
        parts = Counter((item.reader, item.number) for item in items if isinstance(item, DataFrag))
        assert parts == {(readers[-1], number): COUNT} | {(reader, 2): COUNT for reader in readers}


def test_readers_that_leave_get_no_more_and_the_next_sample_begins() -> None:
    chance = random.Random(SEED)
    with _world() as world:
        net = _matched(world)
        peer = net.peers[0]
        peer.participant.leave()
        (_, farewell), *_ = peer.participant.outbox
        peer.participant.outbox.clear()
        items = _sent(net, _frame(_payload(chance, SAMPLE)), Event(Kind.PACKET, farewell, before=SOON_CYCLES))
        assert 1 <= len(_parts(items)) <= 2
        assert not _parts(_sent(net, _frame(_payload(chance, SAMPLE))))
        # The peer comes back, and gets what follows, also by the packet that is prepared.
        net.run(lambda: world.entries == [1, TOPICS, READERS * TOPICS + 1])
        for _ in range(600):
            net.step()
        readers = _readers(net)
        short = [item.reader for item in _sent(net, _frame(_payload(chance, 8))) if isinstance(item, Data)]
        assert sorted(short) == sorted(readers)


def test_no_millisecond_is_lost_while_a_sample_is_sent() -> None:
    """Three thousand come while the first reader gets its fragments. In such a time, one announcement is due."""
    rushed = [Event(Kind.RUSHED, count=15, before=100) for _ in range(LATER // 15)]
    with _world() as world:
        net = _matched(world)
        items = _sent(net, _frame(_payload(random.Random(SEED), SAMPLE)), *rushed)
        announced = [item for item in items if isinstance(item, Data) and item.writer == rtps.PARTICIPANT_WRITER]
        assert len(announced) == 1
