"""`firm live` of a node with eight topics each way, and eight peers: rclpy and Cyclone DDS."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import count, islice
from pathlib import Path

import pytest

from tests.fabric.live import Lab, Round, exchange, settled, skip_without_peers
from tests.fabric.test_peers import Peer

TOPICS = [f"t{number}" for number in range(8)]
TYPES = dict.fromkeys(TOPICS, "Point")
PEERS = 8
# Rounds of which one comes to all.
SETTLING = 20
SPECIFICATION = """\
project:
  name: board
  width: 64
  clock: 125 MHz
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:02", address: 192.0.2.9}
blocks:
"""
TOPIC = """\
  - {{name: {0}_sub, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, topic: /{0}_in,
     outgoing: [{{name: {0}_pub}}]}}
  - {{name: {0}_pub, middleware: ROS2, mode: publisher, message: geometry_msgs/Point, topic: /{0}_out,
     qos: {{depth: 20}}}}
"""

pytestmark = [pytest.mark.thorough, pytest.mark.xdist_group("fabric")]


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    skip_without_peers()
    path = tmp_path / "board.yaml"
    path.write_text(SPECIFICATION + "".join(map(TOPIC.format, TOPICS)), encoding="utf-8")
    with ExitStack() as stack:
        yield Lab(path, tmp_path, stack)


def _round(peers: list[Peer], number: int) -> Round:
    """A point of each peer for each topic, which tells of whom and which it is; all of them come to all."""
    sent = [(peer, (topic, [float(number), float(place), 0.5])) for place, peer in enumerate(peers) for topic in TOPICS]
    return sent, [sample for _, sample in sent]


def _settle(board: subprocess.Popen[str], peers: list[Peer], numbers: Iterator[int]) -> None:
    """Send rounds until one comes to all."""
    for number in islice(numbers, SETTLING):
        if settled(peers, _round(peers, number)):
            return
        assert board.poll() is None
    pytest.fail(f"none of {SETTLING} rounds came to all")


def test_eight_peers_exchange_all_topics_and_a_ninth_waits_for_room(lab: Lab) -> None:
    board, numbers = lab.board(), count()
    peers = [lab.rclpy(TYPES, TYPES)]
    # One after the other: a busy machine needs long for each.
    print(peers[0].wait_until_matched())
    for _ in range(1, PEERS):
        peers.append(lab.cyclone(TYPES, TYPES))
        print(peers[-1].wait_until_matched())
    _settle(board, peers, numbers)
    exchange(peers, _round(peers, next(numbers)))
    ninth = lab.cyclone(TYPES, TYPES)
    ninth.wait_until_started()
    for _ in range(3):
        exchange(peers, _round(peers, next(numbers)))
    assert ninth.is_quiet
    # When one leaves, there is room.
    peers.pop().tell('"farewell"\n')
    print(ninth.wait_until_matched())
    peers.append(ninth)
    _settle(board, peers, numbers)
    exchange(peers, _round(peers, next(numbers)))
