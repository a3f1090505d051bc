"""A node and the reference participant as its peer, over a network that loses packets: nothing is lost or doubled."""

from __future__ import annotations

import random
import struct
from dataclasses import dataclass, field
from ipaddress import IPv4Address

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import LEASE_SECONDS, Endpoint, Node
from fusesoc_firm.system.derived.model import Network, Quality
from tests.cores.announcements import HASH, READ, SURE, WRITTEN, Event, Kind, Results
from tests.cores.rtps_world import World
from tests.fabric.participant import Participant

SEED = 20261127
RELIABLE = Quality(depth=1000)
WRITER = 1  # the one of the node that is reliable
DEPTH = WRITTEN[WRITER][2].depth


def peer_node() -> Node:
    """The peer, which reads the node's reliable topic, and writes one for its reliable reader."""
    network = Network(bytes([2, 0, 0, 0, 0, 1]), IPv4Address("192.0.2.1"), IPv4Address(0), None, "peer", "/", 0)
    graph = Endpoint("ros_discovery_info", "graph", HASH, b"\0\0\1\3", Quality(is_transient_local=True, depth=1))
    (taken, taken_type, _), (given, given_type, _) = WRITTEN[WRITER], READ[SURE]
    reader = Endpoint(taken, taken_type, HASH, bytes([0, 0, 2, rtps.USER_READER]), RELIABLE)
    writer = Endpoint(given, given_type, HASH, bytes([0, 0, 3, rtps.USER_WRITER]), RELIABLE)
    return Node(network, (graph, reader, writer), 16)


@dataclass
class Pair:
    """The node, its peer, and the network between them."""

    world: World
    loss: float
    now: int = 0
    took: list[bytes] = field(default_factory=list)  # by the peer
    frames: list[bytes] = field(default_factory=list)  # of the node
    sent: int = 0

    def __post_init__(self) -> None:
        print(f"seed {SEED}")
        self._chance = random.Random(SEED)
        self.peer = Participant(peer_node(), lambda _, payload: self.took.append(payload))
        self.peer.start(0)

    def step(self) -> None:
        """A millisecond."""
        self.now += 1
        self.peer.tick(self.now)
        self.do(Event(Kind.TICKS, count=1))

    def do(self, event: Event) -> None:
        """An event at the node, and all that follows from it within the same millisecond."""
        self._take(self.world.do(event))
        while self.peer.outbox:
            packets = [packet for _, packet in self.peer.outbox]
            self.peer.outbox.clear()
            for packet in packets:
                if not self._is_lost():
                    self._take(self.world.do(Event(Kind.PACKET, packet)))
        # What the last packet causes comes with the next event, which waits for it.
        self._take(self.world.do(Event(Kind.TICKS, count=0)))

    def _take(self, results: Results) -> None:
        self.frames += results.frames
        for _, packet in results.sent:
            self.sent += 1
            if not self._is_lost():
                self.peer.receive(packet, self.now)

    def _is_lost(self) -> bool:
        return self._chance.random() < self.loss


@pytest.mark.parametrize(
    ("count", "loss"),
    [
        pytest.param(1000, 0.01, marks=pytest.mark.check),
        pytest.param(1000, 0.2, marks=pytest.mark.check),
        pytest.param(100_000, 0.01, marks=pytest.mark.thorough),
    ],
)
def test_every_sample_arrives_once_and_in_order(count: int, loss: float) -> None:
    """The node's writer is given samples as fast as its history holds those that have not arrived."""
    writer = next(item for item in peer_node().writers if item.topic == READ[SURE][0])
    wanted = [rtps.XCDR1 + struct.pack("<I", number) for number in range(count)]
    published = given = 0
    with World() as world:
        pair = Pair(world, loss)
        while not (pair.peer.sources and pair.peer.sinks):
            pair.step()
        while len(pair.took) < count or len(pair.frames) < count:
            while published < min(count, len(pair.took) + DEPTH):
                pair.do(Event(Kind.FRAME, struct.pack("<BI", WRITER, 8) + wanted[published]))
                published += 1
            while given < min(count, len(pair.frames) + 20):
                pair.peer.publish(writer, wanted[given], pair.now)
                given += 1
            pair.step()
        print(f"{pair.now} ms, {pair.sent} packets of the node")
    assert pair.took == wanted
    assert pair.frames == [struct.pack("<BI", SURE, 8) + payload for payload in wanted]


@pytest.mark.check
def test_a_peer_that_is_silent_is_forgotten_when_its_lease_ends() -> None:
    """It is then found again, with the same GUID, and gets the samples that follow."""
    with World() as world:
        pair = Pair(world, 0)
        while not (pair.peer.sources and pair.peer.sinks):
            pair.step()
        assert world.entries == [1, 1, 1]
        world.do(Event(Kind.TICKS, count=1000 * LEASE_SECONDS))
        assert world.entries == [1, 1, 1]
        world.do(Event(Kind.TICKS, count=1000))
        assert world.entries == [0, 0, 0]
        # The peer still knows the node, and announces itself again.
        while world.entries != [1, 1, 1]:
            pair.step()
        for number in range(3):
            payload = rtps.XCDR1 + struct.pack("<I", number)
            pair.do(Event(Kind.FRAME, struct.pack("<BI", WRITER, 8) + payload))
            while pair.took[-1:] != [payload]:
                pair.step()
