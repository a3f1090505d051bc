"""A node in fabric with topics each way, and reference participants as its peers, over a network that loses packets."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from ipaddress import IPv4Address

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Endpoint, Node
from fusesoc_firm.system.derived.model import Network, Quality
from tests.cores.announcements import HASH, Event, Kind, Results, a_node
from tests.cores.rtps_world import World
from tests.fabric.messages import Address
from tests.fabric.participant import Participant
from tests.fabric.participant_tables import Limits

TYPE = "std_msgs::msg::dds_::UInt32_"
DEPTH = 15  # of the node's topics
RELIABLE, GRAPH = Quality(depth=DEPTH), Quality(is_transient_local=True, depth=1)
_FIRST_PEER = 10  # the last byte of the addresses of the first one
_MOST = 60_000  # milliseconds for anything
_GAP = 100  # cycles before a packet
_GROUP = Address(rtps.MULTICAST, rtps.multicast_port(0))


def a_node_with(topics: int) -> Node:
    """A node with so many topics each way, all of them reliable."""
    kinds = [rtps.USER_READER] * topics + [rtps.USER_WRITER] * topics
    names = [f"rt/{way}{number}" for way in ("in", "out") for number in range(topics)]
    ends = [
        Endpoint(name, TYPE, HASH, bytes([0, 0, number, kind]), RELIABLE)
        for number, (name, kind) in enumerate(zip(names, kinds, strict=True), 2)
    ]
    return Node(a_node().network, (_graph(rtps.USER_WRITER, 1), *ends), 16)


def _network(number: int) -> Network:
    mac, address = bytes([2, 0, 0, 0, 0, number]), IPv4Address(f"192.0.2.{number}")
    return Network(mac, address, IPv4Address("255.255.255.0"), None, f"node{number}", "/", 0)


def _graph(kind: int, number: int) -> Endpoint:
    return Endpoint("ros_discovery_info", "graph", HASH, bytes([0, 0, number, kind]), GRAPH)


def peer_of(node: Node, number: int, readers: int = 1) -> Node:
    """A peer with a writer and so many readers for each topic of a node, that of its graph included."""
    reads = [item for item in node.writers for _ in range(readers if item.topic != "ros_discovery_info" else 1)]
    ends = [(item, rtps.USER_READER) for item in reads] + [(item, rtps.USER_WRITER) for item in node.readers]
    others = [
        Endpoint(item.topic, item.type, HASH, bytes([0, 0, place, kind]), item.quality)
        for place, (item, kind) in enumerate(ends, 2)
    ]
    return Node(_network(_FIRST_PEER + number), (_graph(rtps.USER_WRITER, 1), *others), 16)


@dataclass
class Host:
    """A peer, and the samples that its readers took, by their number in the entity id."""

    node: Node
    took: dict[int, list[bytes]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.took = {item.entity[2]: [] for item in self.node.readers}
        room = Limits(sources=len(self.node.readers), sinks=len(self.node.writers))
        self.participant = Participant(self.node, lambda end, payload: self.took[end.entity[2]].append(payload), room)

    @property
    def address(self) -> str:
        return str(self.node.network.address)

    @property
    def topics(self) -> list[list[bytes]]:
        """What the readers of topics took, that of the graph left out."""
        ends = [item for item in self.node.readers if item.topic != "ros_discovery_info"]
        return [self.took[item.entity[2]] for item in ends]


@dataclass
class Net:
    """The node, its peers, and the network between them, which loses a part of the packets each way.

    A node at `pace` does not end what it does before the next event: a millisecond has so many cycles, or some more.
    """

    world: World
    peers: list[Host]
    loss: float = 0
    seed: int = 20261127
    now: int = 0
    frames: list[bytes] = field(default_factory=list)  # of the node
    sent: int = 0
    pace: int = 0

    def __post_init__(self) -> None:
        print(f"seed {self.seed}")
        self._chance = random.Random(self.seed)
        for peer in self.peers:
            peer.participant.start(0)

    def add(self, peer: Host) -> None:
        """A further peer."""
        peer.participant.start(self.now)
        self.peers.append(peer)

    def run(self, until: Callable[[], bool], each: Callable[[], None] = lambda: None) -> None:
        """Let milliseconds pass, before each of which something is done, until the condition holds."""
        end = self.now + _MOST
        while not until():
            assert self.now < end, (self.world.entries, self.world.pulses)
            each()
            self.step()

    def step(self) -> None:
        """A millisecond."""
        self.now += 1
        for peer in self.peers:
            peer.participant.tick(self.now)
        self.do(Event(Kind.RUSHED, count=1, before=self.pace) if self.pace else Event(Kind.TICKS, count=1))

    def do(self, event: Event) -> None:
        """An event at the node, and all that follows from it within the same millisecond."""
        self._take(self.world.do(event))
        while packets := self._outbox():
            for packet in packets:
                if not self._is_lost():
                    self._take(self.world.do(self._soon(Event(Kind.PACKET, packet))))
        # What the last packet causes comes with the next event, which waits for it.
        if not self.pace:
            self._take(self.world.do(Event(Kind.TICKS, count=0)))

    def publish(self, writer: int, payload: bytes) -> None:
        """A frame of the host for a writer of the node."""
        self.do(self._soon(Event(Kind.FRAME, bytes([writer]) + len(payload).to_bytes(4, "little") + payload)))

    def _soon(self, event: Event) -> Event:
        return replace(event, before=_GAP) if self.pace else event

    def _outbox(self) -> list[bytes]:
        packets = [packet for peer in self.peers for _, packet in peer.participant.outbox]
        for peer in self.peers:
            peer.participant.outbox.clear()
        return packets

    def _take(self, results: Results) -> None:
        self.frames += results.frames
        for address, packet in results.sent:
            self.sent += 1
            for peer in self.peers:
                if (address == _GROUP or address.host == peer.address) and not self._is_lost():
                    peer.participant.receive(packet, self.now)

    def _is_lost(self) -> bool:
        return self._chance.random() < self.loss
