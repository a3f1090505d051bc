"""Frames through the node of ROS 1: bytes of the SPI, subscribers without room, publishers that die in a message."""

from __future__ import annotations

import random
import socket
import struct
import threading
import time
import xmlrpc.client
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from fusesoc_firm.fabric.ros1 import Endpoint
from fusesoc_firm.fabric.wiznet.chips import MODELS
from tests.seeds import seeded
from tests.wiznet.ros1 import framed
from tests.wiznet.ros1_peers import LONGEST_SECONDS, Running, header, header_of, read, running_node

SEED = seeded(20261126)
POINT_BYTES, QUATERNION_BYTES = 24, 32
# The bar of a Point to one of its subscribers; a turn without news, which is one frame of the SPI.
MOST_BYTES = 68
IDLE_BYTES = {5500: 4, 5200: 5}
BUFFER = 2048
MOST_CONNECTIONS = 5


@pytest.fixture(params=MODELS, ids="w{}".format)
def running(request: pytest.FixtureRequest) -> Iterator[Running]:
    yield from running_node(request.param)


def _subscribe(running: Running, stack: ExitStack) -> socket.socket:
    peer = stack.enter_context(running.connect())
    peer.sendall(header("callerid=/me", "md5sum=*", "topic=/place"))
    assert "error" not in header_of(peer)
    return peer


def _turns(running: Running) -> list[int]:
    """The SPI bytes of each turn since the last call."""
    found, running.board.turns = running.board.turns, []
    return found


def test_the_spi_carries_few_bytes(running: Running) -> None:
    idle = IDLE_BYTES[running.chip]
    running.board.clock.rate = 0  # no peer is asked whether it is still there
    peers: list[socket.socket] = []
    with ExitStack() as stack:
        for count in (1, MOST_CONNECTIONS):
            peers += [_subscribe(running, stack) for _ in range(count - len(peers))]
            # More than a buffer of the chip holds, so that messages cross its end.
            for _ in range(BUFFER // (4 + POINT_BYTES) + 1):
                running.wait_until_idle(idle)
                _turns(running)
                running.board.send(0, bytes(POINT_BYTES))
                for peer in peers:
                    assert read(peer, 4 + POINT_BYTES) == framed(0, bytes(POINT_BYTES))[1:]
                running.wait_until_idle(idle)
                # The next turns handle the interrupts of what has arrived.
                first, *_ = (size for size in _turns(running) if size > idle)
                assert first - idle <= MOST_BYTES * count


def test_a_subscriber_that_reads_nothing_delays_nobody(running: Running) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    with ExitStack() as stack:
        silent = stack.enter_context(socket.socket())
        silent.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        silent.connect((str(running.node.network.address), running.node.port))
        silent.sendall(header("callerid=/me", "md5sum=*", "topic=/place"))
        assert "error" not in header_of(silent)
        peer = _subscribe(running, stack)
        for _ in range(200):
            payload = rng.randbytes(rng.randrange(1, 300))
            running.board.send(0, payload)
            assert read(peer, 4 + len(payload)) == framed(0, payload)[1:]


def test_further_subscribers_are_taken_when_there_is_room(running: Running) -> None:
    with ExitStack() as stack:
        peers = [_subscribe(running, stack) for _ in range(MOST_CONNECTIONS)]
        with running.connect() as peer:
            peer.sendall(header("callerid=/me", "md5sum=*", "topic=/place"))
            assert peer.recv(1) == b""
        assert running.call("getPid", "/me") == [1, "", 1]
        assert running.call("getBusStats", "/me")[1] == "refused peers: 0001, unknown host: n"
        peers[2].close()
        running.board.wait_until(lambda: running.board.listening() == 7 - MOST_CONNECTIONS + 1)
        _subscribe(running, stack)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("size", [0, 1, 63, 64, 65, 127, 128, 129, 1000, 2044])
def test_messages_of_all_sizes_cross_both_ways(running: Running, size: int) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    with ExitStack() as stack:
        peer = _subscribe(running, stack)
        publisher = stack.enter_context(publishing(running, "/turn"))
        for _ in range(5):
            payload = rng.randbytes(size)
            running.board.send(0, payload)
            assert read(peer, 4 + size) == framed(0, payload)[1:]
            publisher.send(payload)
            running.board.wait_until(lambda: len(running.board.manager.taken) > 0)
            assert running.board.manager.taken.pop() == (0, payload)


@pytest.mark.parametrize("size", [2045, 65_532, 66_000])
def test_a_longer_message_of_the_manager_is_dropped(running: Running, size: int) -> None:
    with ExitStack() as stack:
        peer = _subscribe(running, stack)
        running.board.send(0, bytes(size))
        running.board.send(0, bytes(POINT_BYTES))
        assert read(peer, 4 + POINT_BYTES) == framed(0, bytes(POINT_BYTES))[1:]


def test_an_aborted_frame_of_the_manager_is_not_sent(running: Running) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    whole = 5 + POINT_BYTES
    with ExitStack() as stack:
        peers = [_subscribe(running, stack) for _ in range(2)]
        for cut in [*range(1, whole + 1), *rng.choices(range(1, whole + 1), k=20)]:
            payload = rng.randbytes(POINT_BYTES)
            running.board.send_cut(0, rng.randbytes(POINT_BYTES), cut)
            running.board.send(0, payload)
            for peer in peers:
                assert read(peer, 4 + POINT_BYTES) == framed(0, payload)[1:]


class Publisher:
    """A publisher of a topic: its XML-RPC server and its TCPROS server. It accepts one connection at a time."""

    def __init__(self, endpoint: Endpoint) -> None:
        self._endpoint = endpoint
        self.connection: socket.socket | None = None
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(LONGEST_SECONDS)
        self._calls = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
        self._calls.register_function(self._request_topic, "requestTopic")
        self._thread = threading.Thread(target=self._calls.serve_forever, args=(0.01,), daemon=True)
        self._thread.start()

    @property
    def uri(self) -> str:
        """The URI of its XML-RPC server."""
        return f"http://127.0.0.1:{self._calls.server_address[1]}/"

    def _request_topic(self, _: Any, topic: Any, protocols: Any) -> Any:
        assert topic == self._endpoint.topic
        assert protocols == [["TCPROS"]]
        return [1, "ready", ["TCPROS", "127.0.0.1", self._server.getsockname()[1]]]

    def accept(self) -> None:
        """Take the node's connection and its header."""
        self.connection = self._server.accept()[0]
        self.connection.settimeout(LONGEST_SECONDS)
        self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        fields = header_of(self.connection)
        assert (fields["topic"], fields["md5sum"]) == (self._endpoint.topic, self._endpoint.md5)
        self.connection.sendall(header("callerid=/p", f"md5sum={self._endpoint.md5}", f"type={self._endpoint.type}"))

    def send(self, payload: bytes) -> None:
        """Send a message."""
        assert self.connection
        self.connection.sendall(framed(0, payload)[1:])

    def die_after(self, data: bytes) -> None:
        """Send the begin of a message and reset the connection."""
        assert self.connection
        self.connection.sendall(data)
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.connection.close()

    def close(self) -> None:
        """Give all sockets back."""
        self._calls.shutdown()
        self._calls.server_close()
        self._server.close()
        if self.connection:
            self.connection.close()


@contextmanager
def publishing(running: Running, topic: str) -> Iterator[Publisher]:
    """A publisher to which the node is connected."""
    (endpoint,) = (item for item in running.node.subscribers if item.topic == topic)
    publisher = Publisher(endpoint)
    try:
        assert running.call("publisherUpdate", "/master", topic, [publisher.uri]) == [1, "", 0]
        publisher.accept()
        yield publisher
    finally:
        publisher.close()


@pytest.mark.check
def test_a_publisher_that_dies_at_each_byte_costs_the_others_nothing(running: Running) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    (turn, *_) = running.node.subscribers
    broken = Publisher(turn)
    sent: list[tuple[int, bytes]] = []
    with publishing(running, "/turn/2") as other:
        for cut in range(4 + QUATERNION_BYTES):
            assert running.call("publisherUpdate", "/master", turn.topic, [broken.uri]) == [1, "", 0]
            broken.accept()
            whole, payload = rng.randbytes(QUATERNION_BYTES), rng.randbytes(POINT_BYTES)
            broken.send(whole)
            running.wait_until_taken(0, whole)
            broken.die_after(framed(0, whole)[1 : 1 + cut])
            other.send(payload)
            sent += [(0, whole), (1, payload)]
            running.wait_until_taken(1, payload)
            running.board.wait_until(lambda: running.board.listening() == 7 - 1)
        assert running.board.manager.taken == sent
    broken.close()


def test_a_publisher_that_the_master_no_longer_names_is_left(running: Running) -> None:
    with publishing(running, "/turn") as publisher:
        assert publisher.connection
        assert running.call("publisherUpdate", "/master", "/turn", [publisher.uri]) == [1, "", 0]
        publisher.send(bytes(QUATERNION_BYTES))
        running.board.wait_until(lambda: len(running.board.manager.taken) == 1)
        assert running.call("publisherUpdate", "/master", "/turn", []) == [1, "", 0]
        assert publisher.connection.recv(1) == b""


def test_the_node_does_not_connect_to_itself(running: Running) -> None:
    assert running.call("publisherUpdate", "/master", "/turn", [running.node.uri()]) == [1, "", 0]
    time.sleep(0.05)
    running.board.wait_until_listening()


def test_a_message_longer_than_the_buffer_ends_its_connection(running: Running) -> None:
    with publishing(running, "/turn") as publisher:
        assert publisher.connection
        publisher.connection.sendall((BUFFER - 3).to_bytes(4, "little"))
        assert publisher.connection.recv(1) == b""


def test_a_publisher_whose_uri_has_a_name_is_found_in_the_table(running: Running) -> None:
    (turn, *_) = running.node.subscribers
    with closing(Publisher(turn)) as publisher:
        named = publisher.uri.replace("127.0.0.1", "robot-2.lab")
        unknown = publisher.uri.replace("127.0.0.1", "robot-22")
        assert running.call("publisherUpdate", "/master", turn.topic, [named]) == [1, "", 0]
        publisher.accept()
        assert running.call("getBusStats", "/me")[1] == "refused peers: 0000, unknown host: n"
        assert running.call("publisherUpdate", "/master", turn.topic, [unknown, named]) == [1, "", 0]
        assert running.call("getBusStats", "/me")[1] == "refused peers: 0000, unknown host: y"
        publisher.send(bytes(QUATERNION_BYTES))
        running.wait_until_taken(0, bytes(QUATERNION_BYTES))


def test_a_fault_of_a_publisher_is_tried_again_at_the_next_list(running: Running) -> None:
    publisher = Publisher(running.node.subscribers[0])
    with xmlrpc.client.ServerProxy(running.node.uri()) as node:
        node.publisherUpdate("/master", "/turn", ["http://127.0.0.1:1/"])
        running.board.wait_until_listening()
        node.publisherUpdate("/master", "/turn", ["http://127.0.0.1:1/", publisher.uri])
        publisher.accept()
    publisher.close()
