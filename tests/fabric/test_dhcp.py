"""A simulated board that gets its address by DHCP, from servers that are not ours."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.fabric.dhcp_servers import dnsmasq
from tests.fabric.live import Lab, exchange, settled, skip_without_peers

ASKS = "/board asks for an address by DHCP, at tap0, in domain 0; Ctrl-C ends it\n"
SPECIFICATION = """\
project:
  name: board
  width: 8
  clock: 125 MHz
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:09", address: dhcp}
  status: frames
blocks:
  - {name: points, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, topic: /point_in,
     outgoing: [{name: kept_points}]}
  - {name: kept_points, middleware: ROS2, mode: publisher, message: geometry_msgs/Point, topic: /point_out,
     qos: {durability: transient_local, depth: 60}}
"""
FIRST = "192.0.2.50"
TOPICS = {"point": "Point"}

pytestmark = [pytest.mark.check, pytest.mark.xdist_group("fabric")]


@pytest.fixture(scope="module")
def specification(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("dhcp") / "board.yaml"
    path.write_text(SPECIFICATION, encoding="utf-8")
    return path


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def lab(specification: Path, tmp_path: Path, stack: ExitStack) -> Lab:
    skip_without_peers("dnsmasq")
    return Lab(specification, tmp_path, stack)


def bound(board: subprocess.Popen[str]) -> str:
    """The next address that the board gets."""
    assert board.stdout
    words = board.stdout.readline().split()
    assert words[:3] == ["/board", "is", "at"], words
    return words[3].rstrip(",")


def test_a_board_with_a_lease_exchanges_messages(lab: Lab, tmp_path: Path, stack: ExitStack) -> None:
    dnsmasq(lab.hosts[0], tmp_path, stack, FIRST)
    board = lab.board(ASKS)
    assert bound(board) == FIRST
    peers = [lab.rclpy(TOPICS, TOPICS), lab.cyclone(TOPICS, TOPICS)]
    for peer in peers:
        peer.wait_until_matched()
    points = [("point", [float(number), 0.5, -2.0]) for number in range(10)]
    sent = [(peers[number % 2], point) for number, point in enumerate(points)]
    while not settled(peers, (sent[:2], points[:2])):
        pass
    exchange(peers, (sent, points))
    board.send_signal(signal.SIGINT)
    assert board.wait() == 0
