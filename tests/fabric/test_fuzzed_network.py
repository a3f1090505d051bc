"""Bad packets of all kinds between good ones: the good traffic is whole and in order, and the node lives."""

from __future__ import annotations

import struct
from ipaddress import IPv4Address
from pathlib import Path

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Endpoint, Node
from fusesoc_firm.node.status.status import read_status
from fusesoc_firm.system.derived.model import Network, NetworkKind
from fusesoc_firm.system.scaffold.core_file import NETWORK_HERTZ
from tests.cores.datagrams import Packet
from tests.cores.requests import echo_request
from tests.fabric.echo_node import node_in
from tests.fabric.fuzzed import Fuzz
from tests.fabric.messages import Address
from tests.fabric.participant import Participant
from tests.fabric.test_network_status import LONG_SPECIFICATION, QUESTIONS, Board, _board, line
from tests.seeds import seeded

SEED = seeded(20261127)
SPECIFICATION = LONG_SPECIFICATION.replace("qos: {profile: sensor_data}", "qos: {depth: 20}", 2)
# Bad lines for each good message, and messages that have not come back at most.
RATE, WAITING = 6, 10
# Milliseconds of the board in which all that is under way has come back, and those after which nothing does.
MOST_MILLISECONDS = 60_000
_TRIAL = -1
_UDP, _PORTS_AT, _DATA_AT = 17, 34, 42

pytestmark = [pytest.mark.check]


def _other(node: Node, number: int) -> Node:
    """A node with a writer for each reader of another one, and a reader for each of its writers."""
    kinds = {rtps.USER_READER: rtps.USER_WRITER, rtps.USER_WRITER: rtps.USER_READER}
    graph, *ends = node.endpoints
    others = [
        Endpoint(item.topic, item.type, item.hash, bytes([0, 0, place, kinds[item.entity[3]]]), item.quality)
        for place, item in enumerate(ends, 2)
    ]
    # Prefixes differ in several bytes, so that damage does not make the one from the other.
    mac, address = bytes([2, 0, 0x11 * number, 0, 0, number]), IPv4Address(f"192.0.2.{number}")
    network = Network(mac, address, IPv4Address("255.255.255.0"), None, f"peer{number}", "/", 0)
    return Node(network, (graph, *others), node.gid_bytes)


def _frame(node: Node, address: Address, packet: bytes) -> bytes:
    return Packet(packet, port=address.port, sender=node.network.mac).frame()


def _captured(node: Node) -> list[bytes]:
    """What a third node would send: a conversation of two references."""
    stranger, board = _other(node, 7), Participant(node, lambda *_: None)
    speaker = Participant(stranger, lambda *_: None)
    found: list[bytes] = []
    for participant in (speaker, board):
        participant.start(0)
    for now in range(600):
        if now % 50 == 40:
            for number, writer in enumerate(stranger.writers[1:]):
                speaker.publish(writer, rtps.XCDR1 + bytes([now % 251] * (32, 300)[number]), now)
        for participant, other in ((speaker, board), (board, speaker)):
            participant.tick(now)
            for address, packet in participant.outbox:
                other.receive(packet, now)
                found += [_frame(stranger, address, packet)] if participant is speaker else []
            participant.outbox.clear()
    speaker.leave()
    found += [_frame(stranger, address, packet) for address, packet in speaker.outbox]
    return list(dict.fromkeys(found))


class Peer:
    """A reference participant at the board's line, which publishes quaternions and collects what comes back."""

    def __init__(self, board: Board, node: Node) -> None:
        self._board, self._node = board, node
        self.came: list[int] = []
        self.sent = 0
        self._is_matched = False
        self._participant = Participant(node, self._take)
        self._participant.start(self._now)

    @property
    def _now(self) -> int:
        return self._board.cycles * 1000 // NETWORK_HERTZ[NetworkKind.ETHERNET.value]

    def _take(self, _: Endpoint, payload: bytes) -> None:
        mark, number, *_others = struct.unpack_from("<4d", payload, 4)
        # The fuzzed messages of others come back to all.
        if mark == SEED:
            self._is_matched = True
            self.came += [int(number)] if number != _TRIAL else []

    def _publish(self, number: int) -> None:
        payload = rtps.XCDR1 + struct.pack("<4d", SEED, number, 0, 0)
        self._participant.publish(self._node.writers[1], payload, self._now)

    def wait_until_matched(self) -> None:
        """Publish trials until one comes back."""
        while not self._is_matched:
            self._publish(_TRIAL)
            self.step([], QUESTIONS)

    def publish(self) -> None:
        """Publish the next message, if there is room for it."""
        if self.sent - len(self.came) < WAITING:
            self._publish(self.sent)
            self.sent += 1

    def step(self, lines: list[bytes], questions: int) -> None:
        """Let the line have these, and what this participant sends, then nothing for some time."""
        self._participant.tick(self._now)
        own = [line(_frame(self._node, *item)) for item in self._participant.outbox]
        self._participant.outbox.clear()
        self._board.play([*lines, *own], questions)
        frames, self._board.frames = self._board.frames, []
        for frame in frames:
            if frame[23] == _UDP and frame[:6] in (self._node.network.mac, b"\1\0\x5e\x7f\0\1"):
                (size,) = struct.unpack_from(">H", frame, _PORTS_AT + 4)
                self._participant.receive(frame[_DATA_AT : _PORTS_AT + size], self._now)

    def run_until_all_is_back(self) -> None:
        """Let time pass without bad packets."""
        end = self._now + MOST_MILLISECONDS
        while len(self.came) < self.sent:
            assert self._now < end, f"{len(self.came)} of {self.sent} messages came back"
            self.step([], 10)


@pytest.mark.parametrize("lines", [750, pytest.param(77_000, marks=pytest.mark.thorough)])
def test_good_messages_return_in_order_between_bad_packets(lines: int, tmp_path: Path) -> None:
    pytest.importorskip("scapy", reason="scapy is not installed")
    with _board(tmp_path, SPECIFICATION) as board:
        node = node_in(tmp_path / "turtle.yaml")
        fuzz, peer = Fuzz(SEED, _captured(node)), Peer(board, _other(node, 1))
        peer.wait_until_matched()
        while fuzz.lines < lines:
            peer.publish()
            peer.step([fuzz.line() for _ in range(RATE)], 2)
        peer.run_until_all_is_back()
        print(f"{fuzz.lines} bad lines, {peer.sent} messages, {board.cycles} cycles")
        assert peer.came == list(range(peer.sent))
        assert peer.sent > fuzz.lines // (4 * RATE)
        # The node lives, and counts.
        request = echo_request(bytes(40))
        board.play([line(request)])
        assert any(reply[:6] == request[6:12] and reply[34:35] == b"\0" for reply in board.frames)
        words = read_status(board).words
        counted = {name: words[name] for name in words if name.startswith("network_")}
        print(counted)
        assert counted["network_broken_frames"] == fuzz.broken
        assert min(counted["network_broken_datagrams"], counted["network_broken_packets"]) > fuzz.lines // 100
        assert max(counted.values()) <= 2 * fuzz.lines
