"""A node with eight topics each way and eight peers, whose tables are full, and the time that its program needs."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.control import MOST_PEERS, Sizes
from fusesoc_firm.fabric.node import Node
from tests.cores.announcements import Event, Kind
from tests.cores.rtps_peers import Host, Net, a_node_with, peer_of
from tests.cores.rtps_world import World
from tests.fabric.messages import AckNack, Heartbeat, InfoDestination, Submessage, Writer, parse
from tests.hdl.ghdl import REPOSITORY

TOPICS = 8
NODE = a_node_with(TOPICS)
SIZES = Sizes.of(NODE)
FULL = [MOST_PEERS, SIZES.sources, SIZES.sinks]
# A smaller node, whose pass of the timers is told in the pages, too.
FEW_TOPICS = 2
# Of a millisecond at 125 MHz, the clock of a GMII.
CYCLES = 125_000
# Of the time of the timers, a packet waits for that of one packet at most; it takes its own time, too.
FEW = 6

# From the end of a frame to the first byte of its packet; the MAC and the pins are not counted.
LATENCY = 12

# Milliseconds without a packet of the node, after which nothing is repeated.
QUIET = 110

PAGE = REPOSITORY / "docs" / "reference" / "ethernet.md"
README = REPOSITORY / "cores" / "net" / "README.md"

# The eight peers are matched in one process.
pytestmark = [pytest.mark.check, pytest.mark.xdist_group("rtps_full")]


@contextmanager
def _matched(node: Node) -> Iterator[Net]:
    """All peers match all topics."""
    sizes = Sizes.of(node)
    with World(0, node, sizes) as world:
        net = Net(world, [Host(peer_of(node, number)) for number in range(1, MOST_PEERS + 1)])
        net.run(lambda: world.entries == [MOST_PEERS, sizes.sources, sizes.sinks])
        yield net


def _come_to_rest(net: Net) -> None:
    """Wait until nothing is under way."""
    sent, quiet = net.sent, 0
    while quiet < QUIET:
        net.step()
        quiet = quiet + 1 if net.sent == sent else 0
        sent = net.sent


@pytest.fixture(scope="module")
def matched() -> Iterator[Net]:
    with _matched(NODE) as net:
        yield net


@pytest.fixture
def net(matched: Net) -> Net:
    """The same, with nothing under way."""
    _come_to_rest(matched)
    return matched


def _exchange(net: Net, peers: list[Host], count: int) -> None:
    """Samples of all writers, which all their readers get once and in order."""
    net.frames.clear()
    before = [[len(items) for items in peer.topics] for peer in peers]
    wanted = [rtps.XCDR1 + struct.pack("<I", number) for number in range(count)]
    for payload in wanted:
        for topic in range(TOPICS):
            net.publish(topic, payload)
            for peer in peers:
                peer.participant.publish(peer.node.writers[1 + topic], payload, net.now)
            net.step()
    net.run(lambda: len(net.frames) == count * TOPICS * len(peers))
    for peer, counts in zip(peers, before, strict=True):
        net.run(lambda peer=peer, counts=counts: sum(map(len, peer.topics)) == sum(counts) + count * len(counts))  # type: ignore[misc]
        assert [items[first:] for items, first in zip(peer.topics, counts, strict=True)] == [wanted] * len(counts)
    for topic in range(TOPICS):
        frames = [frame[5:] for frame in net.frames if frame[0] == topic]
        # All peers send the same samples, each of them in order.
        assert frames == sorted(frames)
        assert sorted(frames) == sorted(wanted * len(peers))


def test_a_ninth_peer_is_refused_and_disturbs_nobody(net: Net) -> None:
    peers = list(net.peers)
    _exchange(net, peers, 3)
    ninth = Host(peer_of(NODE, MOST_PEERS + 1))
    net.add(ninth)
    net.run(lambda: net.world.pulses["peer"] > 0)
    assert net.world.entries == FULL
    _exchange(net, peers, 3)
    assert not any(ninth.took.values())
    # When one leaves, there is room.
    peers[0].participant.leave()
    net.run(lambda: net.world.entries[0] < MOST_PEERS)
    net.peers.remove(peers[0])
    net.run(lambda: net.world.entries == FULL)
    _exchange(net, [*peers[1:], ninth], 2)


def test_several_readers_of_a_topic_at_one_peer_get_all() -> None:
    """One peer has seven readers of each topic, and room is left for the writer and the readers of another one."""
    with World(0, NODE, SIZES) as world:
        several, other = Host(peer_of(NODE, 1, readers=7)), Host(peer_of(NODE, 2))
        net = Net(world, [several, other])
        net.run(lambda: world.entries == [2, 2 * TOPICS, 7 * TOPICS + 1 + TOPICS + 1])
        assert world.pulses["endpoint"] == 0
        _exchange(net, [several, other], 3)


def test_the_timers_leave_time(net: Net) -> None:
    """Those of a millisecond need less than it lasts, whatever is due."""
    # Of all topics, a sample is under way to all peers, which are silent.
    for topic in range(TOPICS):
        net.world.do(Event(Kind.FRAME, struct.pack("<BI", topic, 8) + bytes(8)))
    due = []
    for _ in range(101):
        found = net.world.do(Event(Kind.TICKS, count=1))
        due.append((net.world.cycles, len(found.sent)))
    print(f"{max(due)} cycles and packets at most")
    assert max(count for _, count in due) >= MOST_PEERS * TOPICS
    assert max(cycles for cycles, _ in due) < CYCLES


def test_a_message_leaves_at_once_while_the_program_looks_at_the_timers(net: Net) -> None:
    seed = 20261127
    print(f"seed {seed}")
    chance, payload = random.Random(seed), rtps.XCDR1 + bytes(4)
    latencies = []
    for turn in range(3 * TOPICS):
        _come_to_rest(net)
        net.world.do(Event(Kind.RUSHED, count=1))
        before, packets = chance.randrange(2500), net.sent
        frame = struct.pack("<BI", turn % TOPICS, len(payload)) + payload
        net.do(Event(Kind.FRAME, frame, before=before))
        assert net.sent == packets + MOST_PEERS
        latencies.append(net.world.latency)
    assert latencies == [LATENCY] * len(latencies)


def _idle_cycles(net: Net) -> int:
    """Cycles for the timers of a millisecond in which nothing is due."""
    cycles = []
    for _ in range(20):
        net.step()
        net.world.do(Event(Kind.TICKS, count=1))
        cycles.append(net.world.cycles)
    return min(cycles)


def test_the_pages_tell_the_time_of_the_timers(net: Net) -> None:
    """A pass without anything due, for two sizes of the tables: the difference is the cost of their entries."""
    many = _idle_cycles(net)
    node = a_node_with(FEW_TOPICS)
    with _matched(node) as small:
        _come_to_rest(small)
        few = _idle_cycles(small)
    sizes = Sizes.of(node)
    entries = SIZES.sources + SIZES.sinks - sizes.sources - sizes.sinks
    print(f"{few} and {many} cycles, {(many - few) / entries:.2f} for each entry")
    assert _told(PAGE, r"takes ([\d,]+) cycles with two topics each way") == few
    assert _told(PAGE, r"and ([\d,]+) with eight topics, if nothing is due") == many
    assert _told(README, r"An idle source or sink costs ([\d,]+) cycles in a pass") == round((many - few) / entries)


def _told(page: Path, pattern: str) -> int:
    """The number in a sentence, whose blanks may be ends of lines."""
    found = re.search(pattern.replace(" ", r"\s+"), page.read_text(encoding="utf-8"))
    assert found, pattern
    return int(found[1].replace(",", ""))


def test_a_packet_does_not_wait_for_the_timers(net: Net) -> None:
    for topic in range(TOPICS):
        net.world.do(Event(Kind.FRAME, struct.pack("<BI", topic, 8) + bytes(8)))
    net.world.do(Event(Kind.TICKS, count=99))
    peer = net.peers[-1].node
    writer = peer.writers[-1]
    wants = Heartbeat(NODE.readers[-1].entity, writer.entity, 1, 0, 1, False)
    packet = Writer().message(peer.prefix, InfoDestination(NODE.prefix), wants)
    # The heartbeats to all sinks are due.
    net.world.do(Event(Kind.RUSHED, count=1))
    sent = [*net.world.do(Event(Kind.PACKET, packet, before=1000)).sent, *net.world.do(Event(Kind.TICKS)).sent]
    items: list[Submessage] = [item for _, text in sent if (message := parse(text)) for item in message.submessages]
    kinds = [type(item) for item in items if isinstance(item, AckNack | Heartbeat)]
    assert kinds.count(Heartbeat) >= MOST_PEERS * TOPICS and kinds.count(AckNack) == 1
    # Some left before the packet came.
    print(f"{kinds.index(AckNack)} of {len(kinds)} packets left before the answer")
    assert kinds.index(AckNack) <= FEW + 1000 // 100
