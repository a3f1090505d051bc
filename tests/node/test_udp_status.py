"""The status of a node in fabric by UDP: datagrams get lost, come twice, or come from elsewhere."""

from __future__ import annotations

import random
import socket
import struct
import threading
from collections.abc import Iterator

import pytest

from fusesoc_firm.node.status.status import read_status, read_word, status_text, write_word
from fusesoc_firm.node.status.status_socket import open_status
from fusesoc_firm.node.transport import udp
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.system.hardware.status import Features, Part, network_words, status_map
from fusesoc_firm.system.status_frames import answered, read_request
from tests.seeds import seeded

SEED = seeded(20261127)
WRITE = 1 << 31
MAP = {register.address: register for register in status_map("board", 1, 1, features=Features(Part.NETWORK)).registers}
COUNTED = {"network_broken_frames": 7, "subscriber[0].frames": 3}


class Board(threading.Thread):
    """A node that drops some requests, answers some twice, and sends other datagrams in between."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.words = dict(COUNTED)
        self.dropped = 0

    def run(self) -> None:
        chance = random.Random(SEED)
        while True:
            payload, peer = self.socket.recvfrom(100)
            if payload == b"end":
                return
            address, word = struct.unpack("<2I", payload)
            if chance.random() < 0.02:
                self.dropped += 1
                continue
            for other in (b"", b"abc", struct.pack("<2I", address ^ 4, 9)):
                self.socket.sendto(other, peer)
            register = MAP[address & ~WRITE]
            found = self.words.get(register.name, sum(field.reset << field.low for field in register.fields))
            if address & WRITE:
                self.words[register.name] = word
            for _ in range(chance.choice([1, 1, 2])):
                self.socket.sendto(struct.pack("<2I", address, found), peer)

    def end(self) -> None:
        self.socket.sendto(b"end", self.socket.getsockname())
        self.join()
        self.socket.close()


@pytest.fixture
def board(monkeypatch: pytest.MonkeyPatch) -> Iterator[Board]:
    started = Board()
    monkeypatch.setattr(udp, "PORT", started.socket.getsockname()[1])
    monkeypatch.setattr(udp, "_REPEAT_SECONDS", 0.02)
    started.start()
    yield started
    started.end()


def test_every_register_is_read(board: Board) -> None:
    print(f"seed {SEED}")
    with open_status("udp:127.0.0.1") as transport:
        for _ in range(20):
            status = read_status(transport)
            assert {name: status.words[name] for name in COUNTED} == COUNTED
            assert {name: status.words[name] for name in network_words()} == {
                name: COUNTED.get(name, 0) for name in network_words()
            }
    assert board.dropped
    assert "network: 7 times a frame on the line is broken or too long" in status_text(status)


def test_a_word_is_written(board: Board) -> None:
    with open_status("udp:127.0.0.1") as transport:
        write_word(transport, 0x08, 0)
        assert read_word(transport, 0x08) == 0


@pytest.fixture
def silent(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """A port that does not answer by itself; accesses to it last for a short time."""
    monkeypatch.setattr(udp, "_REPEAT_SECONDS", 0.02)
    monkeypatch.setattr("fusesoc_firm.node.status.status._ANSWER_SECONDS", 0.2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind(("127.0.0.1", 0))
        monkeypatch.setattr(udp, "PORT", port.getsockname()[1])
        yield port


def test_a_silent_node_is_asked_again_and_told(silent: socket.socket) -> None:
    with open_status("udp:127.0.0.1") as transport:
        with pytest.raises(TransportError, match="the hardware did not answer"):
            read_word(transport, 0)
        assert [silent.recv(100) for _ in range(2)] == [bytes(8)] * 2


def test_a_closed_port_cannot_be_reached(silent: socket.socket) -> None:
    silent.close()
    message = r"the node at '127\.0\.0\.1' cannot be reached: Connection refused"
    with open_status("udp:127.0.0.1") as transport, pytest.raises(TransportError, match=message):
        read_word(transport, 0)


def test_a_late_answer_is_not_that_to_the_next_request(silent: socket.socket) -> None:
    with open_status("udp:127.0.0.1") as transport:
        transport.send(read_request(0))
        _, peer = silent.recvfrom(100)
        for word in (1, 2):
            silent.sendto(struct.pack("<2I", 0, word), peer)
        burst = transport.receive()
        assert burst
        assert answered(burst.data) == (0, 1)
        with pytest.raises(TransportError, match="the hardware did not answer"):
            read_word(transport, 0)


def test_other_frames_are_dropped(silent: socket.socket) -> None:
    silent.settimeout(0.1)
    with open_status("udp:127.0.0.1") as transport:
        assert transport.receive(0.01) is None
        transport.send(b"not a request")
        assert transport.receive(0.01) is None
        with pytest.raises(TimeoutError):
            silent.recv(100)


def test_a_name_that_is_unknown_is_told() -> None:
    with pytest.raises(TransportError, match=r"the node at '256\.1\.1\.1' cannot be reached"):
        open_status("udp:256.1.1.1")
