"""Services of the node of ROS 1: callers at once, callers that leave, and hardware that does not answer."""

from __future__ import annotations

import json
import random
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from fusesoc_firm.fabric.ros1 import Server
from fusesoc_firm.fabric.wiznet.chip import Status
from fusesoc_firm.fabric.wiznet.chips import MODELS
from fusesoc_firm.frame.codec import decode, encode
from tests.ros.camera.model import respond
from tests.ros.cpp_nodes import Client, Ros, missing_ros1, ros1, roscpp_peer
from tests.ros.service_simulator import frames
from tests.seeds import seeded
from tests.wiznet.ros1 import Board, Manager, Stalls, clocked, framed, hardware, interpreted, node
from tests.wiznet.ros1_peers import (
    ASK,
    SOON,
    Running,
    header,
    header_of,
    pause,
    read,
    running_node,
    service_sum,
)

SEED = seeded(20261127)
HARDWARE = 5500
BUFFER = 2048
FAILURE = b"the hardware did not answer"
ROS = Path(__file__).parent.parent / "ros"
CAMERA = "/set_camera_info"


@pytest.fixture(params=[*MODELS, pytest.param(None, marks=pytest.mark.check)], ids=str)
def running(request: pytest.FixtureRequest) -> Iterator[Running]:
    """Interpreted on each chip; None is the hardware, on one of them."""
    if request.param:
        yield from running_node(request.param)
    else:
        yield from running_node(HARDWARE, hardware(HARDWARE))


def _caller(running: Running, stack: ExitStack, service: Server) -> socket.socket:
    peer = stack.enter_context(running.connect())
    peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    peer.sendall(header("callerid=/me", f"md5sum={service.md5}", f"service={service.name}", "persistent=1"))
    assert header_of(peer) == {
        "callerid": "/fabric",
        "md5sum": service.md5,
        "request_type": f"{service.type}Request",
        "response_type": f"{service.type}Response",
        "type": service.type,
    }
    return peer


def _counted(payload: bytes) -> bytes:
    return struct.pack("<I", len(payload)) + payload


def _check_answer(peer: socket.socket, payload: bytes) -> None:
    assert read(peer, 5 + len(payload)) == b"\1" + _counted(payload)


def _check_failure(peer: socket.socket) -> None:
    assert read(peer, 5 + len(FAILURE)) == b"\0" + _counted(FAILURE)


def _wait_for_frames(running: Running, stack: ExitStack) -> None:
    """Wait until the node has taken all frames so far: a subscriber gets one after them."""
    peer = stack.enter_context(running.connect())
    peer.sendall(header("callerid=/me", "md5sum=*", "topic=/place"))
    assert "error" not in header_of(peer)
    running.board.send(0, bytes(24))
    assert read(peer, 28) == framed(0, bytes(24))[1:]


@pytest.mark.parametrize("size", [0, 1, 58, 59, 63, 64, 65, 127, 1000, 2043])
def test_requests_and_responses_of_all_sizes(running: Running, size: int) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    with ExitStack() as stack:
        peer = _caller(running, stack, ASK)
        for _ in range(4):
            request, response = rng.randbytes(size + 1), rng.randbytes(size)
            peer.sendall(_counted(request))
            running.wait_until_taken(ASK.request, request)
            running.board.send(ASK.response, response)
            _check_answer(peer, response)


def test_callers_at_once_get_their_own_responses(running: Running) -> None:
    print(f"seed {SEED}")

    def answers(number: int, payload: bytes) -> Iterator[tuple[int, bytes]]:
        yield number, payload[::-1]

    running.board.manager.accelerator = answers
    faults: list[object] = []

    def call(peer: socket.socket, seed: int) -> None:
        rng = random.Random(seed)
        try:
            for _ in range(20):
                data = _counted(request := rng.randbytes(rng.randrange(1, 200)))
                cut = rng.randrange(len(data) + 1)
                peer.sendall(data[:cut])
                pause()
                peer.sendall(data[cut:])
                _check_answer(peer, request[::-1])
        except Exception as error:  # noqa: BLE001 - for the test's thread
            faults.append(error)

    with ExitStack() as stack:
        peers = [_caller(running, stack, service) for service in (ASK, ASK, ASK, SOON)]
        threads = [threading.Thread(target=call, args=(peer, SEED + number)) for number, peer in enumerate(peers)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert not faults


def test_a_request_waits_for_the_response_to_the_one_before(running: Running) -> None:
    with ExitStack() as stack:
        first, second = (_caller(running, stack, ASK) for _ in range(2))
        first.sendall(_counted(b"first"))
        running.wait_until_taken(ASK.request, b"first")
        second.sendall(_counted(b"second"))
        _wait_for_frames(running, stack)
        assert running.board.manager.taken == [(ASK.request, b"first")]
        running.board.send(ASK.response, b"1")
        _check_answer(first, b"1")
        running.wait_until_taken(ASK.request, b"second")
        running.board.send(ASK.response, b"2")
        _check_answer(second, b"2")


def test_a_caller_that_leaves_gets_no_other_ones_place(running: Running) -> None:
    """The hardware still owes a response, which belongs to nobody."""
    with ExitStack() as stack:
        first, second = (_caller(running, stack, ASK) for _ in range(2))
        first.sendall(_counted(b"first"))
        running.wait_until_taken(ASK.request, b"first")
        first.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        first.close()
        second.sendall(_counted(b"second"))
        _wait_for_frames(running, stack)
        assert running.board.manager.taken == [(ASK.request, b"first")]
        running.board.send(ASK.response, b"1")
        running.wait_until_taken(ASK.request, b"second")
        running.board.send(ASK.response, b"2")
        _check_answer(second, b"2")
    running.board.wait_until_listening()


def test_a_call_without_a_response_fails_in_time(running: Running) -> None:
    """A late response is not that of the next call, which waits for it as long as the time limit."""
    clock = running.board.clock
    with ExitStack() as stack:
        first, second = (_caller(running, stack, SOON) for _ in range(2))
        clock.rate = 0
        first.sendall(_counted(b"first"))
        running.wait_until_taken(SOON.request, b"first")
        begin = clock.milliseconds
        clock.rate = 1
        _check_failure(first)
        clock.rate = 0
        assert clock.milliseconds - begin >= 1000 * SOON.time_limit
        second.sendall(_counted(b"second"))
        _wait_for_frames(running, stack)
        assert running.board.manager.taken == [(SOON.request, b"first")]
        running.board.send(SOON.response, b"late")
        running.wait_until_taken(SOON.request, b"second")
        running.board.send(SOON.response, b"right")
        _check_answer(second, b"right")


def test_the_next_call_goes_on_when_no_late_response_comes(running: Running) -> None:
    with ExitStack() as stack:
        first, second = (_caller(running, stack, SOON) for _ in range(2))
        first.sendall(_counted(b"first"))
        _check_failure(first)
        second.sendall(_counted(b"second"))
        running.wait_until_taken(SOON.request, b"second")
        running.board.clock.rate = 0
        running.board.send(SOON.response, b"right")
        # On a busy machine, its time may be over, too.
        assert read(second, 1) in {b"\0", b"\1"}


def test_a_response_that_is_aborted_or_too_long_fails(running: Running) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    with ExitStack() as stack:
        peer = _caller(running, stack, ASK)

        def ask() -> None:
            peer.sendall(_counted(request := rng.randbytes(8)))
            running.wait_until_taken(ASK.request, request)

        for cut in (1, 4, 5, 6, 29):
            ask()
            running.board.send_cut(ASK.response, rng.randbytes(24), cut)
            _check_failure(peer)
        for size in (BUFFER - 4, 65_531, 66_000):
            ask()
            running.board.send(ASK.response, bytes(size))
            _check_failure(peer)
        ask()
        running.board.send(ASK.response, b"right")
        _check_answer(peer, b"right")


def test_a_response_without_a_request_is_dropped(running: Running) -> None:
    with ExitStack() as stack:
        peer = _caller(running, stack, ASK)
        running.board.send(ASK.response, b"unasked")
        _wait_for_frames(running, stack)
        peer.sendall(_counted(b"asked"))
        running.wait_until_taken(ASK.request, b"asked")
        running.board.send(ASK.response, b"right")
        _check_answer(peer, b"right")


@pytest.mark.parametrize(
    "fields", [("md5sum=" + 32 * "b", "service=/ask"), ("md5sum=*", "service=/as"), ("md5sum=*", "topic=/ask")]
)
def test_other_services_are_refused(running: Running, fields: tuple[str, ...]) -> None:
    with running.connect() as peer:
        peer.sendall(header("callerid=/me", *fields))
        assert [*header_of(peer)] == ["error"]
        assert peer.recv(1) == b""


def test_a_probe_learns_the_type(running: Running) -> None:
    """So `rosservice type` asks."""
    with running.connect() as peer:
        peer.sendall(header("probe=1", "md5sum=*", "callerid=/rosservice", "service=/ask"))
        assert header_of(peer)["type"] == ASK.type
    running.board.wait_until_listening()


def _camera(_number: int, payload: bytes) -> Iterator[tuple[int, bytes]]:
    request, response, _ = frames(1)
    ((_, answer),) = respond("", decode(request, payload))
    yield 0, encode(response, answer)


def _commands(ros: Ros, calls: int) -> list[list[str]]:
    """The commands of two clients of roscpp, two of rospy."""
    rospy = [ros.python, str(ROS / "service_peer.py"), "1", CAMERA, str(calls)]
    roscpp = [str(roscpp_peer("service_client")), CAMERA, str(calls)]
    seeds = [str(SEED + number) for number in range(4)]
    return [
        *([*roscpp, seed, service_sum()] for seed in seeds[:2]),
        *([*rospy, seed] for seed in seeds[2:]),
    ]


@pytest.mark.check
@pytest.mark.skipif(bool(missing_ros1()), reason=missing_ros1())
@pytest.mark.parametrize("kind", ["interpreted", "hardware"])
def test_clients_of_rospy_and_roscpp_at_once(tmp_path: Path, kind: str) -> None:
    print(f"seed {SEED}")
    with ros1(tmp_path) as ros:
        master = urlsplit(ros.environment["ROS_MASTER_URI"])
        service = Server(CAMERA, "sensor_msgs/SetCameraInfo", service_sum(), 0, 0, 100)
        made = node((str(master.hostname), int(master.port or 0)), (), (), (service,))
        manager = Manager(_camera)
        if kind == "interpreted":
            board = interpreted(made, 5200, manager)
        else:
            board = clocked(made, HARDWARE, manager, hardware(HARDWARE), Stalls(SEED, is_strict=True), [])
        with closing(board):
            clients: list[Client] = []
            try:
                # The node leaves two sockets free for calls of the master and others, and each client probes first. So
                # that none is refused on a slow machine, the next one starts when the probe has gone. Of those that are
                # ready, only roscpp's are connected.
                for number, command in enumerate(_commands(ros, 20)):
                    clients.append(Client(ros, command))
                    assert clients[-1].line() == "ready\n"
                    board.wait_until(partial(_is_connected, board, min(number + 1, 2)))
                for client in clients:
                    client.begin()
                assert [json.loads(client.line()) for client in clients] == [{"wrong": [], "failed": []}] * len(clients)
            finally:
                for client in clients:
                    client.end()


def _is_connected(board: Board, connections: int) -> bool:
    """So many peers are connected, and what else there was has ended."""
    established = sum(item.status == Status.ESTABLISHED for item in board.chip.sockets[1:])
    return established == connections and board.listening() == 7 - connections
