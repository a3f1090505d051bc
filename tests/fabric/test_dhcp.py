"""A simulated board that gets its address by DHCP, from servers that are not ours."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.fabric.dhcp_servers import dnsmasq, end, start, udhcpd
from tests.fabric.hosts import captured
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
FIRST, SECOND = "192.0.2.50", "192.0.2.60"
TOPICS = {"point": "Point"}
# Seconds for whatever a board does, on a machine that does much else.
PATIENCE = 600

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


def _line(board: subprocess.Popen[str]) -> str:
    """The next line of the board, which ends if it does not print one."""
    assert board.stdout
    limit = threading.Timer(PATIENCE, board.kill)
    limit.start()
    try:
        return board.stdout.readline()
    finally:
        limit.cancel()


def bound(board: subprocess.Popen[str]) -> str:
    """The next address that the board gets."""
    words = _line(board).split()
    assert words[:3] == ["/board", "is", "at"], words
    return words[3].rstrip(",")


def lose(board: subprocess.Popen[str]) -> None:
    """Wait until the board has lost its address."""
    assert _line(board) == "/board has lost its address, at tap0, in domain 0\n"


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


def _captured(path: Path, *fields: str) -> list[list[str]]:
    """Fields of the messages of DHCP that a switch passed on."""
    shown = [word for name in fields for word in ("-e", name)]
    command = ["tshark", "-r", str(path), "-Y", "dhcp", "-T", "fields", *shown]
    # The last packet of a capture that goes on may be cut.
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return [line.split("\t") for line in done.stdout.splitlines()]


@pytest.mark.thorough
def test_a_server_that_comes_later_and_forgets(lab: Lab, tmp_path: Path, stack: ExitStack) -> None:
    """A server that has no lease for the board refuses to renew it: the node begins anew, with another address."""
    board = lab.board(ASKS)
    # So many seconds are between the second message and the third one.
    time.sleep(8)
    short = "--dhcp-option=option:T1,15"
    first = dnsmasq(lab.hosts[0], tmp_path, stack, FIRST, short)
    assert bound(board) == FIRST
    peer = lab.rclpy(TOPICS, TOPICS)
    peer.wait_until_matched()
    point = "point", [1.0, 2.0, 3.0]
    while not settled([peer], ([(peer, point)], [point])):
        pass
    end(first)
    dnsmasq(lab.hosts[0], tmp_path, stack, SECOND, short, log="second")
    lose(board)
    assert bound(board) == SECOND
    while not settled([peer], ([(peer, point)], [point])):
        pass
    assert "DHCPNAK" in (tmp_path / "second.log").read_text(encoding="utf-8")
    lines = [line for line in lab.status(SECOND).splitlines() if "address of the board" in line]
    # Nobody else has it.
    assert lines == []


@pytest.mark.thorough
def test_a_short_lease_is_renewed_and_ends_without_its_server(lab: Lab, tmp_path: Path, stack: ExitStack) -> None:
    skip_without_peers("busybox", "dumpcap", "tshark")
    path, names = tmp_path / "renewed.pcapng", ("ip.src", "ip.dst", "dhcp.option.dhcp", "dhcp.ip.client")
    with captured(lab.switch, path):
        server = udhcpd(lab.hosts[0], tmp_path, stack, FIRST, 24)
        board = lab.board(ASKS)
        assert bound(board) == FIRST
        assert lab.answers(FIRST)
        limit = time.monotonic() + PATIENCE
        while ["192.0.2.1", FIRST, "5", FIRST] not in _captured(path, *names):
            assert time.monotonic() < limit, "the lease is not renewed"
            time.sleep(1)
        assert lab.answers(FIRST)
        end(server)
        lose(board)
        assert not lab.answers(FIRST)
    rows = _captured(path, *names)
    assert [FIRST, "192.0.2.1", "3", FIRST] in rows
    assert ["192.0.2.1", FIRST, "5", FIRST] in rows
    assert [FIRST, "255.255.255.255", "3", FIRST] in rows
    assert rows[-1] == ["0.0.0.0", "255.255.255.255", "1", "0.0.0.0"]
    udhcpd(lab.hosts[0], tmp_path, stack, SECOND, 24)
    assert bound(board) == SECOND
    assert lab.answers(SECOND)


@pytest.mark.thorough
def test_an_address_that_a_host_has_is_declined(lab: Lab, tmp_path: Path, stack: ExitStack) -> None:
    lab.hosts[1].run("ip", "address", "add", f"{SECOND}/24", "dev", "eth0")
    options = f"--dhcp-host=02:00:00:00:00:09,{SECOND}", "--dhcp-range=192.0.2.70,192.0.2.70,2m"
    dnsmasq(lab.hosts[0], tmp_path, stack, FIRST, *options)
    assert bound(lab.board(ASKS)) in (FIRST, "192.0.2.70")
    assert f"DHCPDECLINE(eth0) {SECOND}" in (tmp_path / "dnsmasq.log").read_text(encoding="utf-8")


@pytest.mark.thorough
def test_of_two_servers_and_much_garbage_one_gives_an_address(lab: Lab, tmp_path: Path, stack: ExitStack) -> None:
    skip_without_peers("busybox")
    dnsmasq(lab.hosts[0], tmp_path, stack, FIRST)
    udhcpd(lab.hosts[1], tmp_path, stack, SECOND, 120)
    start(lab.hosts[1], [sys.executable, str(Path(__file__).parent / "dhcp_garbage.py"), "eth0"], stack)
    address = bound(lab.board(ASKS))
    assert address in (FIRST, SECOND)
    assert lab.answers(address)
