"""A node that sends samples in fragments, and the reference participant as its peers: nothing is lost or doubled."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.control import Sizes
from tests.cores.announcements import IDLE, Event, Kind, Results
from tests.cores.rtps_peers import Host, Net, a_node_with, peer_of
from tests.cores.rtps_world import World
from tests.fabric.messages import (
    AckNack,
    Data,
    DataFrag,
    Heartbeat,
    InfoDestination,
    NackFrag,
    Numbers,
    Submessage,
    Writer,
    parse,
)
from tests.fabric.participant import FRAGMENT_BYTES, LATER, USER_HEARTBEAT
from tests.seeds import seeded

SEED = seeded(20261127)
TOPICS = 2
NODE = a_node_with(TOPICS)
SIZES = Sizes.of(NODE)
# Bytes of a slot, of which there are 32.
SAMPLE = 32768
# Samples of a topic.
UNDER_WAY = 3
# Cycles of a millisecond of a node that does not end what it does.
PACE = 3000
# Peers that leave, and samples for each of them.
TURNS, EACH = 6, 5
# Readers of a topic at one peer, as many as find room.
READERS = 7
# Cycles in which the first reader gets a part of a sample.
SOON_CYCLES = 20_000

pytestmark = [pytest.mark.check, pytest.mark.xdist_group("rtps_long")]


def _world() -> World:
    return World(0, NODE, SIZES, sample=SAMPLE)


def _payload(chance: random.Random, size: int) -> bytes:
    return rtps.XCDR1 + chance.randbytes(size - len(rtps.XCDR1))


def _payloads(count: int) -> list[list[bytes]]:
    """So many samples of all sizes for each topic."""
    chance = random.Random(SEED)
    sizes = [8, 1344, 1348, 2688, 2692, 9000, SAMPLE]
    return [[_payload(chance, chance.choice(sizes)) for _ in range(count)] for _ in range(TOPICS)]


def _send(net: Net, wanted: Sequence[Sequence[bytes]], numbers: range, peers: Sequence[Host]) -> None:
    """Send the samples with these numbers, a few of which are under way, until the last ones are at these peers."""
    following = [numbers.start] * TOPICS

    def has_come(topic: int, number: int) -> bool:
        return number not in numbers or all(wanted[topic][number] in peer.topics[topic] for peer in peers)

    def publish() -> None:
        for topic, number in enumerate(following):
            if number in numbers and has_come(topic, number - UNDER_WAY):
                net.publish(topic, wanted[topic][number])
                following[topic] += 1

    net.run(lambda: all(has_come(topic, numbers[-1]) for topic in range(TOPICS)), publish)


@pytest.mark.parametrize(("count", "loss", "pace"), [(20, 0, 0), (30, 0.03, 0), (20, 0.2, 0), (30, 0.03, PACE)])
def test_samples_of_all_sizes_arrive_once_and_in_order(count: int, loss: float, pace: int) -> None:
    """At two peers, whose requests for samples and fragments get lost, too; also while the node is sending."""
    wanted = _payloads(count)
    with _world() as world:
        peers = [Host(peer_of(NODE, number)) for number in (1, 2)]
        net = Net(world, peers, loss, pace=pace)
        net.run(lambda: world.entries == [2, 2 * TOPICS, 2 * (TOPICS + 1)])
        _send(net, wanted, range(count), peers)
        print(f"{net.now} ms, {net.sent} packets of the node")
        assert all(peer.topics == wanted for peer in peers)


def test_peers_that_come_and_go_while_samples_are_sent_disturb_nobody() -> None:
    """One of two peers leaves in the middle of a sample, and the next one takes its place."""
    chance, wanted = random.Random(SEED), _payloads(TURNS * EACH)
    with _world() as world:
        stays, *others = [Host(peer_of(NODE, number)) for number in range(1, TURNS + 3)]
        net = Net(world, [stays, others[0]], pace=PACE)
        for turn, (leaves, comes) in enumerate(pairwise(others)):
            net.run(lambda: world.entries == [2, 2 * TOPICS, 2 * (TOPICS + 1)])
            first = turn * EACH
            _send(net, wanted, range(first, first + 2), [stays, leaves])
            for topic in range(TOPICS):
                net.publish(topic, wanted[topic][first + 2])
            for _ in range(chance.randrange(8)):
                net.step()
            leaves.participant.leave()
            net.step()
            net.peers.remove(leaves)
            net.add(comes)
            _send(net, wanted, range(first + 3, first + EACH), [stays])
            for took, sent in zip(leaves.topics, wanted, strict=True):
                begin = sent.index(took[0])
                assert took == sent[begin : begin + len(took)]
        assert stays.topics == wanted


def _matched(world: World, readers: int = READERS) -> Net:
    """A peer with so many readers of each topic, at rest."""
    net = Net(world, [Host(peer_of(NODE, 1, readers))])
    net.run(lambda: world.entries == [1, TOPICS, readers * TOPICS + 1])
    for _ in range(600):
        net.step()
    return net


def _items(results: Sequence[Results]) -> list[Submessage]:
    packets = [packet for result in results for _, packet in result.sent]
    return [item for packet in packets if (message := parse(packet)) for item in message.submessages]


def _frame(payload: bytes, topic: int = 0, before: int = IDLE) -> Event:
    return Event(Kind.FRAME, bytes([topic]) + len(payload).to_bytes(4, "little") + payload, before=before)


def _from(net: Net, item: Submessage, before: int = IDLE) -> Event:
    """A packet of the peer."""
    prefix = net.peers[0].node.prefix
    return Event(Kind.PACKET, Writer().message(prefix, InfoDestination(NODE.prefix), item), before=before)


def _sent(net: Net, *events: Event) -> list[Submessage]:
    """What events cause until all is done."""
    return _items([net.world.do(event) for event in (*events, Event(Kind.TICKS))])


def _readers(net: Net, place: int = 0) -> list[bytes]:
    """The readers of a topic."""
    topic = NODE.writers[1 + place].topic
    return [item.entity for item in net.peers[0].node.readers if item.topic == topic]


def _parts(items: Sequence[Submessage]) -> Counter[bytes]:
    """The fragments for each reader."""
    return Counter(item.reader for item in items if isinstance(item, DataFrag))


COUNT = -(-SAMPLE // FRAGMENT_BYTES)


def _fragment(payload: bytes, place: int) -> bytes:
    return payload[(place - 1) * FRAGMENT_BYTES : place * FRAGMENT_BYTES]


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


def test_a_short_sample_leaves_between_fragments_that_are_asked_for() -> None:
    """Its packet is prepared, so it starts whatever the program does. Each payload is the right one."""
    chance = random.Random(SEED)
    long, short = _payload(chance, SAMPLE), [_payload(chance, size) for size in (8, 60, 1000)]
    between = 0
    with _world() as world:
        net = _matched(world, readers=1)
        ends = _readers(net)[0], NODE.writers[1].entity
        _sent(net, _frame(long))
        for count, before in enumerate(range(0, 3000, 13), 1):
            payload = chance.choice(short)
            asks = NackFrag(*ends, 1, Numbers.of([2, COUNT], 2), count)
            items = _sent(net, _from(net, asks), _frame(payload, topic=1, before=before))
            parts = {item.first: item.payload for item in items if isinstance(item, DataFrag)}
            assert parts == {place: _fragment(long, place) for place in (2, COUNT)}, before
            assert [(item.reader, item.payload) for item in items if isinstance(item, Data)] == [
                (_readers(net, 1)[0], payload)
            ], before
            kinds = [type(item) for item in items if isinstance(item, Data | DataFrag)]
            between += kinds == [DataFrag, Data, DataFrag]
    print(f"{between} between the fragments")
    assert between > 50


def test_fragments_that_are_asked_for_while_a_sample_is_sent() -> None:
    """Those of the sample before, and of the new one before the reader's turn; each reader gets the new one whole."""
    chance = random.Random(SEED)
    old, new = _payload(chance, SAMPLE), _payload(chance, SAMPLE)
    with _world() as world:
        net = _matched(world)
        readers, writer = _readers(net), NODE.writers[1].entity
        _sent(net, _frame(old))
        asks = [
            _from(net, NackFrag(reader, writer, number, Numbers.of([1, 3], 1), 1), before=SOON_CYCLES)
            for reader, number in ((readers[0], 1), (readers[-1], 2))
        ]
        items = [item for item in _sent(net, _frame(new), *asks) if isinstance(item, DataFrag)]
        assert {item.payload == _fragment(new if item.number == 2 else old, item.first) for item in items} == {True}
        found = Counter((item.reader, item.number, item.first) for item in items)
        again = [(readers[0], 1, 1), (readers[0], 1, 3), (readers[-1], 2, 1), (readers[-1], 2, 3)]
        assert found == Counter(again) + Counter(
            (reader, 2, place) for reader in readers for place in range(1, COUNT + 1)
        )


def test_a_request_for_fragments_that_comes_twice_is_answered_once() -> None:
    payload = _payload(random.Random(SEED), SAMPLE)
    with _world() as world:
        net = _matched(world, readers=1)
        ends = _readers(net)[0], NODE.writers[1].entity
        _sent(net, _frame(payload))
        counts = []
        for count in (0, 1, 1, 0, 2, (1 << 32) - 1, 0):
            items = _sent(net, _from(net, NackFrag(*ends, 1, Numbers.of([3], 3), count)))
            counts.append(sum(isinstance(item, DataFrag) for item in items))
        assert counts == [1, 1, 0, 0, 1, 1, 1]


def test_what_is_prepared_for_another_topic_stays_prepared() -> None:
    """Also if its first reader gets a heartbeat while a sample is sent: the next message leaves at once."""
    chance = random.Random(SEED)
    with _world() as world:
        net = _matched(world)
        _sent(net, _frame(_payload(chance, 8), topic=1))
        prompt = world.latency
        wants = AckNack(_readers(net, 1)[0], NODE.writers[2].entity, Numbers(1), 99, is_final=False)
        items = _sent(net, _frame(_payload(chance, SAMPLE)), _from(net, wants, SOON_CYCLES))
        assert any(isinstance(item, Heartbeat) and item.reader == wants.reader for item in items)
        _sent(net, _frame(_payload(chance, 8), topic=1))
        assert 0 < world.latency == prompt < 100


# Milliseconds that pass while the first reader gets its fragments.
RUSHED = 300


def _rushed() -> list[Event]:
    return [Event(Kind.RUSHED, count=15, before=1400) for _ in range(RUSHED // 15)]


def test_the_timers_do_not_lose_the_time_in_which_a_sample_is_sent() -> None:
    """Each reader that does not answer gets the next heartbeat after 100 ms, and not earlier."""
    with _world() as world:
        net = _matched(world)
        _sent(net, _frame(_payload(random.Random(SEED), SAMPLE)), *_rushed())

        def told() -> list[bytes]:
            items = _sent(net, Event(Kind.TICKS, count=1))
            return [item.reader for item in items if isinstance(item, Heartbeat) and item.reader in _readers(net)]

        assert not any(told() for _ in range(USER_HEARTBEAT - 1))
        assert sorted(told()) == sorted(_readers(net))


def test_no_millisecond_is_lost_while_a_sample_is_sent() -> None:
    """The next announcement comes as long after the last one as without a sample."""
    with _world() as world:
        net = _matched(world)

        def is_announced() -> bool:
            items = _sent(net, Event(Kind.TICKS, count=1))
            return any(isinstance(item, Data) and item.writer == rtps.PARTICIPANT_WRITER for item in items)

        assert any(is_announced() for _ in range(LATER))
        _sent(net, _frame(_payload(random.Random(SEED), SAMPLE)), *_rushed())
        assert next(number for number in range(1, LATER) if is_announced()) == LATER - RUSHED
