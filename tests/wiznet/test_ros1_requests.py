"""The node of ROS 1 and its peers' dialects of XML-RPC and TCPROS: interpreted on both chips, and as hardware."""

from __future__ import annotations

import random
import socket
import struct
import xmlrpc.client
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest

from fusesoc_firm.fabric.wiznet.chips import MODELS
from tests.seeds import seeded
from tests.wiznet.ros1 import framed, hardware
from tests.wiznet.ros1_peers import Running, header, header_of, pause, read, running_node

SEED = seeded(20261126)
HARDWARE = 5500
QUATERNION = "a779879fadf0160734f906b8c19c7004"
POINT = "4a842b65f413084dc2b10fb484ea7f17"


@pytest.fixture(params=[*MODELS, pytest.param(None, marks=pytest.mark.thorough)], ids=str)
def running(request: pytest.FixtureRequest) -> Iterator[Running]:
    """Interpreted on each chip; None is the hardware, on one of them."""
    if request.param:
        yield from running_node(request.param)
    else:
        yield from running_node(HARDWARE, hardware(HARDWARE))


def _rospy(method: str, *parameters: Any) -> bytes:
    body = xmlrpc.client.dumps(parameters, method).encode()
    head = f"POST /RPC2 HTTP/1.1\r\nHost: x:1\r\nAccept-Encoding: gzip\r\nContent-Length: {len(body)}\r\n\r\n"
    return head.encode() + body


def _roscpp(method: str, *parameters: Any) -> bytes:
    def value(item: Any) -> str:
        if isinstance(item, list):
            return f"<value><array><data>{''.join(map(value, item))}</data></array></value>"
        return f"<value><i4>{item}</i4></value>" if isinstance(item, int) else f"<value>{item}</value>"

    inside = "".join(f"<param>{value(item)}</param>" for item in parameters)
    name = f"<methodCall><methodName>{method}</methodName>"
    text = f'<?xml version="1.0"?>\r\n{name}\r\n<params>{inside}</params></methodCall>\r\n'
    return f"POST / HTTP/1.1\r\nUser-Agent: XMLRPC++ 0.7\r\nContent-length: {len(text)}\r\n\r\n{text}".encode()


PROTOCOLS = [["TCPROS"]]
CALLS: list[tuple[str, tuple[Any, ...]]] = [
    ("getPid", ("/me",)),
    ("getBusInfo", ("/me",)),
    ("getBusStats", ("/me",)),
    ("getMasterUri", ("/me",)),
    ("getSubscriptions", ("/me",)),
    ("getPublications", ("/me",)),
    ("paramUpdate", ("/master", "/a", 3)),
    ("requestTopic", ("/me", "/place", PROTOCOLS)),
    ("requestTopic", ("/me", "/turn", PROTOCOLS)),
    ("requestTopic", ("/me", "/turn/2", PROTOCOLS)),  # a topic that it only reads
    ("requestTopic", ("/me", "/nowhere", PROTOCOLS)),
    ("requestTopic", ("", "/place", PROTOCOLS)),
    ("publisherUpdate", ("/master", "/turn", [])),
    ("publisherUpdate", ("/master", "/nowhere", ["http://127.0.0.1:1/"])),
    ("publisherUpdate", ("/master", "/turn", ["http://a.name.of.a.host:1/", ""])),
    ("getNothing", ("/me",)),
]


def _expected(running: Running, method: str, parameters: tuple[Any, ...]) -> Any:
    own = running.node
    address = str(own.network.address)
    match method:
        case "getMasterUri":
            return f"http://127.0.0.1:{own.master[1]}/"
        case "getSubscriptions" | "getPublications":
            items = own.subscribers if method == "getSubscriptions" else own.publishers
            return [[item.topic, item.type] for item in items]
        case "requestTopic" if parameters[1] in {"/place", "/turn"}:
            return ["TCPROS", address, own.port]
        case "getPid":
            return 1
        case "getBusInfo":
            return []
        case "getBusStats":
            return [[], [], []]
    return 0


def _answer(running: Running, request: bytes, rng: random.Random) -> bytes:
    """Send a request in parts, cut at random; return what comes until the node ends the connection."""
    with running.connect() as peer:
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while request:
            size = rng.choice((1, 3, 20, 200, 2000))
            peer.sendall(request[:size])
            request = request[size:]
            if rng.random() < 0.1:
                pause()
        received = b""
        while data := peer.recv(4096):
            received += data
        return received


def _check_call(running: Running, dialect: Any, call: tuple[str, tuple[Any, ...]], rng: random.Random) -> None:
    method, parameters = call
    head, _, body = _answer(running, dialect(method, *parameters), rng).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.0 200 OK\r\n")
    assert f"Content-Length: {len(body)}" in head.decode()
    if method == "getNothing":
        with pytest.raises(xmlrpc.client.Fault, match="no such method"):
            xmlrpc.client.loads(body)
        return
    answer: Any = xmlrpc.client.loads(body)[0][0]
    code, _, value = answer
    refused = method == "requestTopic" and parameters[1] not in {"/place", "/turn"}
    assert (code, value) == (0 if refused else 1, _expected(running, method, parameters)), (call, body)


def test_calls_of_both_dialects_are_answered_however_they_are_cut(running: Running) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    for call in CALLS:
        _check_call(running, rng.choice((_rospy, _roscpp)), call, rng)


@pytest.mark.thorough
def test_a_thousand_calls_are_answered(running: Running) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    for _ in range(1000):
        _check_call(running, rng.choice((_rospy, _roscpp)), rng.choice(CALLS), rng)


@pytest.mark.parametrize(
    ("fields", "accepted"),
    [
        ((f"md5sum={POINT}", "topic=/place", "type=geometry_msgs/Point"), True),
        (("tcp_nodelay=1", "type=*", "topic=/place", "message_definition=" + 300 * "x", "md5sum=*"), True),
        ((f"md5sum={POINT}", "topic=/place"), True),
        ((f"md5sum={QUATERNION}", "topic=/place"), False),
        ((f"md5sum={POINT}", "topic=/place", "type=geometry_msgs/Quaternion"), False),
        ((f"md5sum={POINT}", "topic=/turn/2"), False),
        ((f"md5sum={POINT}", "topic=/plac"), False),
        (("topic=/place",), False),
        ((), False),
        ((f"md5sum={POINT}", "topic=/push", "type=geometry_msgs/Point"), False),
    ],
)
def test_a_header_is_accepted_or_refused(running: Running, fields: tuple[str, ...], accepted: bool) -> None:
    with running.connect() as peer:
        peer.sendall(header("callerid=/me", *fields))
        found = header_of(peer)
        if not accepted:
            assert [*found] == ["error"]
            assert peer.recv(1) == b""
            return
        assert found["md5sum"] == POINT
        assert found["message_definition"] == running.node.publishers[0].definition
        payload = bytes(range(24))
        running.board.send(0, payload)
        assert read(peer, 28) == framed(0, payload)[1:]


def test_types_with_the_same_sum_are_told_apart(running: Running) -> None:
    for topic, name in (("/place", "geometry_msgs/Point"), ("/push", "geometry_msgs/Vector3")):
        with running.connect() as peer:
            peer.sendall(header("callerid=/me", f"md5sum={POINT}", f"topic={topic}", f"type={name}"))
            assert header_of(peer)["type"] == name


def test_sockets_listen_again_after_garbage(running: Running) -> None:
    _garbage(running, 10)


@pytest.mark.thorough
def test_sockets_listen_again_after_a_thousand_connections_of_garbage(running: Running) -> None:
    _garbage(running, 1000)


def _accepted(running: Running) -> socket.socket:
    """A connection. The chip refuses it while no socket listens, as it must."""
    while True:
        running.board.wait_until(lambda: running.board.listening() > 0)
        with suppress(ConnectionError):
            return running.connect()


def _garbage(running: Running, count: int) -> None:
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    valid = [_rospy("getPid", "/me"), header("callerid=/me", "md5sum=*", "topic=/place")]
    for _ in range(count):
        with _accepted(running) as peer:
            data = bytearray(rng.choice([*valid, rng.randbytes(40), b"POST" + rng.randbytes(60)]))
            for _ in range(rng.randrange(4)):
                data[rng.randrange(len(data))] = rng.randrange(256)
            peer.sendall(data[: rng.randrange(len(data) + 1)])
            if rng.random() < 0.5:  # a reset instead of an end
                peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    running.board.wait_until_listening()
    _check_call(running, _roscpp, CALLS[0], rng)
