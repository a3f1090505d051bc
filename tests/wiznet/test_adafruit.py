"""The model of the W5500 under Adafruit's driver, which knows the chip from its datasheet as we do."""

from __future__ import annotations

import random
import select
import socket
import struct
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from fusesoc_firm.fabric.wiznet.w5500 import W5500
from tests.seeds import seeded
from tests.wiznet.adafruit import driver
from tests.wiznet.peers import echo, free_port

SEED = seeded(20261126)
LOOPBACK = (bytes([127, 0, 0, 1]), bytes([255, 0, 0, 0]), bytes(4), bytes(4))
ESTABLISHED, CLOSE_WAIT, CLOSED = 0x17, 0x1C, 0x00
DISCON, TIMEOUT = 0x02, 0x08
SIZE = 2048  # bytes of each buffer


@pytest.fixture
def chip() -> Iterator[W5500]:
    chip = W5500()
    yield chip
    misuses = chip.misuses
    chip.close()
    assert not misuses


@pytest.fixture
def wiznet(chip: W5500) -> Any:
    made = driver(chip)
    made.ifconfig = LOOPBACK
    return made


def _wait(wiznet: Any, number: int, status: int) -> None:
    while wiznet.socket_status(number) != status:
        time.sleep(0.001)


def _read(wiznet: Any, number: int, length: int) -> bytes:
    data = b""
    while len(data) < length:
        data += wiznet.socket_read(number, length - len(data))[1]
    return data


def test_the_driver_finds_and_sets_up_the_chip(wiznet: Any) -> None:
    assert (wiznet.chip, wiznet.max_sockets, wiznet.link_status) == ("w5500", 8, True)
    assert wiznet.ifconfig == LOOPBACK
    assert wiznet.mac_address == bytes.fromhex("deadbeeffeed")
    assert (wiznet.rtr, wiznet.rcr) == (2000, 8)
    assert [wiznet.socket_status(number) for number in range(8)] == [CLOSED] * 8


def test_both_directions_of_a_connection_keep_every_byte(wiznet: Any) -> None:
    """An echo: 60 kB cross the ends of both buffers, and the pointers' end at 65,536."""
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    with socket.create_server(("127.0.0.1", 0)) as server, ThreadPoolExecutor() as pool:
        echoing = pool.submit(echo, server)
        wiznet.socket_connect(1, LOOPBACK[0], server.getsockname()[1])
        for _ in range(80):
            data = rng.randbytes(rng.randrange(1, 2048))
            assert wiznet.socket_write(1, bytearray(data)) == len(data)
            assert _read(wiznet, 1, len(data)) == data
        wiznet.socket_disconnect(1)
        _wait(wiznet, 1, CLOSED)
        echoing.result()


def test_each_listening_socket_takes_one_connection(wiznet: Any) -> None:
    """Where none listens, a connection is refused. Each peer sees its own bytes."""
    port = free_port()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))
    for number in (1, 2):
        wiznet.socket_listen(number, port)
    with socket.create_connection(("127.0.0.1", port)) as one, socket.create_connection(("127.0.0.1", port)) as two:
        for number in (1, 2):
            _wait(wiznet, number, ESTABLISHED)
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port))
        peers = {peer.getsockname()[1]: peer for peer in (one, two)}
        for number in (1, 2):
            peer = peers[wiznet.remote_port(number)]
            peer.sendall(b"to the chip")
            assert _read(wiznet, number, 11) == b"to the chip"
            wiznet.socket_write(number, bytearray(b"from the chip"))
            assert peer.recv(100) == b"from the chip"
        one.close()
        two.close()
        for number in (1, 2):
            _wait(wiznet, number, CLOSE_WAIT)
            wiznet.socket_disconnect(number)
            _wait(wiznet, number, CLOSED)


def test_a_refused_and_a_reset_connection_close_the_socket(wiznet: Any) -> None:
    with pytest.raises(ConnectionError):
        wiznet.socket_connect(1, LOOPBACK[0], free_port())
    assert wiznet.read_snir(1) & DISCON
    with socket.create_server(("127.0.0.1", 0)) as server:
        wiznet.socket_connect(2, LOOPBACK[0], server.getsockname()[1])
        peer, _ = server.accept()
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        peer.close()
        _wait(wiznet, 2, CLOSED)
        assert wiznet.read_snir(2) & DISCON


def test_a_peer_that_does_not_answer_times_out(wiznet: Any) -> None:
    """The queue of a listener that accepts nothing is full; the chip gives up after the time of RTR and RCR."""
    wiznet.rtr, wiznet.rcr = 256, 2  # 26, 51 and 102 ms; the driver cannot write less than 256
    with (
        socket.create_server(("127.0.0.1", 0), backlog=0) as server,
        socket.create_connection(server.getsockname()),
        pytest.raises(ConnectionError),
    ):
        wiznet.socket_connect(1, LOOPBACK[0], server.getsockname()[1])
    assert wiznet.read_snir(1) & TIMEOUT


def test_free_bytes_follow_what_the_peer_has_acknowledged(wiznet: Any) -> None:
    """A peer that does not read stops its kernel from acknowledging; the buffer stays full until it reads."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        wiznet.socket_connect(1, LOOPBACK[0], server.getsockname()[1])
        peer, _ = server.accept()
        with peer:
            with pytest.raises(RuntimeError):
                _write_for_ever(wiznet, 1)
            assert wiznet._read_sntx_fsr(1) < SIZE
            peer.setblocking(False)
            while wiznet._read_sntx_fsr(1) != SIZE:
                if select.select([peer], [], [], 0.01)[0]:
                    peer.recv(65536)


def _write_for_ever(wiznet: Any, number: int) -> None:
    """Ends with the driver's error when nothing is acknowledged for a while."""
    while True:
        wiznet.socket_write(number, bytearray(SIZE // 2), timeout=0.2)
