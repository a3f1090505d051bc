"""A node and the reference participant as its peer, over a network that loses packets: nothing is lost or doubled."""

from __future__ import annotations

import struct

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.control import Sizes
from fusesoc_firm.fabric.node import LEASE_SECONDS
from tests.cores.announcements import Event, Kind
from tests.cores.rtps_peers import DEPTH, Host, Net, a_node_with, peer_of
from tests.cores.rtps_world import World

TOPICS = 2
NODE = a_node_with(TOPICS)
# Samples that wait for the host at most.
WAITING = 10


def _net(world: World, loss: float) -> Net:
    net = Net(world, [Host(peer_of(NODE, 1))], loss)
    net.run(lambda: world.entries == [1, TOPICS, TOPICS + 1])
    return net


@pytest.mark.parametrize(
    ("count", "loss"),
    [
        pytest.param(1000, 0.01, marks=pytest.mark.check),
        pytest.param(1000, 0.2, marks=pytest.mark.check),
        pytest.param(100_000, 0.01, marks=pytest.mark.thorough),
    ],
)
def test_every_sample_arrives_once_and_in_order(count: int, loss: float) -> None:
    """The writers of both ends are given samples as fast as their histories hold those that have not arrived."""
    of_each = count // TOPICS
    wanted = [
        [rtps.XCDR1 + struct.pack("<HH", topic, number % 65536) for number in range(of_each)] for topic in range(TOPICS)
    ]
    with World(0, NODE, Sizes.of(NODE)) as world:
        net = _net(world, loss)
        peer = net.peers[0]
        writers = peer.node.writers[1:]
        published, given = [0] * TOPICS, [0] * TOPICS
        came: list[list[bytes]] = [[] for _ in range(TOPICS)]
        while any(len(items) < of_each for items in (*peer.topics, *came)):
            for topic in range(TOPICS):
                while published[topic] < min(of_each, len(peer.topics[topic]) + DEPTH):
                    net.publish(topic, wanted[topic][published[topic]])
                    published[topic] += 1
                while given[topic] < min(of_each, len(came[topic]) + WAITING):
                    peer.participant.publish(writers[topic], wanted[topic][given[topic]], net.now)
                    given[topic] += 1
            net.step()
            for frame in net.frames:
                came[frame[0]].append(frame)
            net.frames.clear()
        print(f"{net.now} ms, {net.sent} packets of the node")
    assert peer.topics == wanted
    assert came == [[struct.pack("<BI", topic, 8) + item for item in items] for topic, items in enumerate(wanted)]


@pytest.mark.check
def test_a_peer_that_is_silent_is_forgotten_when_its_lease_ends() -> None:
    """It is then found again, with the same GUID, and gets the samples that follow."""
    matched = [1, TOPICS, TOPICS + 1]
    with World(0, NODE, Sizes.of(NODE)) as world:
        net = _net(world, 0)
        world.do(Event(Kind.TICKS, count=1000 * LEASE_SECONDS))
        assert world.entries == matched
        world.do(Event(Kind.TICKS, count=1000))
        assert world.entries == [0, 0, 0]
        # The peer still knows the node, and announces itself again.
        net.run(lambda: world.entries == matched)
        (took, _) = net.peers[0].topics
        for number in range(3):
            payload = rtps.XCDR1 + struct.pack("<I", number)
            net.publish(0, payload)
            net.run(lambda payload=payload: took[-1:] == [payload])  # type: ignore[misc]
