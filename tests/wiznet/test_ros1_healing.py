"""What the node of ROS 1 does about masters that are away, peers that vanish, and a chip that sends only a part."""

from __future__ import annotations

import random
import socket
from collections.abc import Iterator
from contextlib import closing
from itertools import accumulate, pairwise

import pytest

from fusesoc_firm.fabric.ros1 import Node
from fusesoc_firm.fabric.wiznet.chip import TX_FREE, ChipSocket, Status
from fusesoc_firm.fabric.wiznet.chips import MODELS
from fusesoc_firm.fabric.wiznet.w5200 import W5200
from fusesoc_firm.fabric.wiznet.w5500 import W5500
from tests.seeds import seeded
from tests.wiznet.ros1 import Board, Manager, endpoint, framed, interpreted, node
from tests.wiznet.ros1_peers import LONGEST_SECONDS, header, header_of, read

SEED = seeded(20261127)
PLACE = endpoint("/place", "geometry_msgs", "Point")
MS = 64  # of the sequencer's unit of time
# Of times that the board counts while it does something else.
SLACK_MS = 3 * MS


@pytest.fixture
def master() -> Iterator[socket.socket]:
    """A master that takes calls and ends them."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(LONGEST_SECONDS)
        yield server


def _node(master: socket.socket) -> Node:
    return node(("127.0.0.1", master.getsockname()[1]), (), (PLACE,))


def _quiet() -> Manager:
    return Manager(lambda _number, _payload: iter(()))


def _called_at(master: socket.socket, board: Board) -> int:
    """The board's time of its next call, which fails."""
    peer, _ = master.accept()
    peer.close()
    return board.clock.milliseconds


@pytest.mark.check
def test_a_master_that_is_away_is_tried_after_half_a_second_to_eight(master: socket.socket) -> None:
    with closing(interpreted(_node(master), 5500, _quiet())) as board:
        board.clock.rate = 4
        times = [_called_at(master, board) for _ in range(8)]
    print(times)
    # A call that is seen late shortens the pause after it, so its time counts from the board's start.
    for time, least in zip(times[1:], accumulate((500, 1000, 2000, 4000, 8000, 8000, 8000)), strict=True):
        assert time >= least - SLACK_MS, times
    # A call may take seconds to fail.
    assert min(after - before for before, after in pairwise(times[-3:])) < 2 * 8000 - SLACK_MS, times


class Linking(W5500):
    """A chip whose cable has a link after so many questions."""

    def __init__(self, questions: int) -> None:
        super().__init__()
        self.has_link = False
        self.questions = questions

    def _read(self, block: int, address: int) -> int:
        if (block, address) == (0, 0x2E):
            self.has_link = self.questions == 0
            self.questions -= 1
        return super()._read(block, address)


def test_source_ports_depend_on_when_the_cable_has_a_link(master: socket.socket) -> None:
    ports = set()
    for questions in (0, 1, 300):
        with closing(interpreted(_node(master), 5500, _quiet(), Linking(questions))):
            peer, (_, port) = master.accept()
            peer.close()
            ports.add(port)
    assert len(ports) == 3


def test_a_board_without_a_cable_starts_nevertheless(master: socket.socket) -> None:
    with closing(interpreted(_node(master), 5500, _quiet(), Linking(-1))) as board:
        board.clock.rate = 10
        board.wait_until_listening()


@pytest.mark.parametrize("number", MODELS)
def test_a_silent_peer_is_asked_whether_it_is_there(master: socket.socket, number: int) -> None:
    made = _node(master)
    with closing(interpreted(made, number, _quiet())) as board:
        board.wait_until_listening()
        with socket.create_connection((str(made.network.address), made.port), LONGEST_SECONDS) as peer:
            peer.sendall(header("callerid=/me", "md5sum=*", "topic=/place"))
            assert "error" not in header_of(peer)

            def is_asked() -> bool:
                found = (item for item in board.chip.sockets[1:] if item.status == Status.ESTABLISHED)
                return any(
                    item.connection and item.connection.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
                    for item in found
                )

            assert not is_asked()
            board.clock.rate = 4
            board.wait_until(is_asked)
            # It is still there.
            board.send(0, bytes(24))
            assert read(peer, 28) == framed(0, bytes(24))[1:]


class Lagging(W5200):
    """A chip that sometimes sends only a part, as its driver of WIZnet (ioLibrary, `send`) expects it.

    TX_FREE counts from TX_WRITE.
    """

    def __init__(self, rng: random.Random) -> None:
        super().__init__()
        self.rng = rng
        self.parts = 0

    def _send(self, item: ChipSocket) -> None:
        end, size = item.tx_write, (item.tx_write - item.tx_commanded) % 0x10000
        if size > 1 and self.rng.random() < 0.5:
            item.tx_write = (end - self.rng.randrange(1, size)) % 0x10000
            self.parts += 1
        super()._send(item)
        item.tx_write = end

    def read_socket(self, number: int, address: int) -> int:
        """TX_FREE counts what has not been sent as well."""
        item = self.sockets[number]
        if address & ~1 == TX_FREE:
            free = item.tx_bytes - (item.tx_write - item.tx_acknowledged) % 0x10000
            return free & 0xFF if address & 1 else free >> 8
        return super().read_socket(number, address)


def test_a_w5200_that_sends_only_a_part_is_told_again(master: socket.socket) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    made, chip = _node(master), Lagging(random.Random(SEED))
    with closing(interpreted(made, 5200, _quiet(), chip)) as board:
        board.wait_until_listening()
        address = str(made.network.address), made.port
        for _ in range(10):
            with socket.create_connection(address, LONGEST_SECONDS) as peer:
                peer.sendall(header("callerid=/me", "md5sum=*", "topic=/place"))
                assert header_of(peer)["message_definition"] == PLACE.definition
                payload = rng.randbytes(24)
                board.send(0, payload)
                assert read(peer, 28) == framed(0, payload)[1:]
    assert chip.parts > 5
