"""Peers of a node of ROS 1 without ROS: what they send and read, and a running node without a master."""

from __future__ import annotations

import socket
import struct
import subprocess
import time
import xmlrpc.client
from collections.abc import Iterator
from dataclasses import dataclass
from ipaddress import IPv4Address
from pathlib import Path
from typing import Any

from fusesoc_firm.fabric.ros1 import Node, Server
from fusesoc_firm.system.derived.model import Host
from tests.ros.cpp_nodes import DEBIAN_PYTHON
from tests.seeds import seeded
from tests.wiznet.peers import free_port
from tests.wiznet.ros1 import Board, Manager, Stalls, clocked, endpoint, interpreted, node

_SEED = seeded(20261126)  # of the stalls
# Services of the running node: one that has time, and one of which the hardware must answer soon.
ASK = Server("/ask", "std_srvs/Ask", 32 * "a", 2, 2, 100)
SOON = Server("/ask/soon", "std_srvs/Ask", 32 * "a", 3, 3, 1)
_HOSTS = (Host("robot-2.lab", IPv4Address("127.0.0.1")), Host("robot-2", IPv4Address("127.0.0.2")))
LONGEST_SECONDS = 60  # a busy machine is slow


@dataclass
class Running:
    """A board with a node, and the number of its chip."""

    node: Node
    board: Board
    chip: int

    def connect(self) -> socket.socket:
        """Connect to the node."""
        return socket.create_connection((str(self.node.network.address), self.node.port), LONGEST_SECONDS)

    def call(self, method: str, *parameters: Any) -> Any:
        """Call a method of its XML-RPC server."""
        with xmlrpc.client.ServerProxy(self.node.uri()) as proxy:
            return getattr(proxy, method)(*parameters)

    def wait_until_taken(self, number: int, payload: bytes) -> None:
        """Wait until the Manager has taken a frame."""
        self.board.wait_until(lambda: (number, payload) in self.board.manager.taken)

    def wait_until_idle(self, most_bytes: int) -> None:
        """Wait until ten turns have no news."""
        turns = self.board.turns
        begin = len(turns)
        self.board.wait_until(lambda: len(turns) > begin + 10 and max(turns[-10:]) <= most_bytes)


def running_node(chip: int, program: Path | None = None) -> Iterator[Running]:
    """Run a node without a master: interpreted, or by a program of the hardware.

    It has topics each way, of which two have the ids 0 and 1, and two services.
    """
    made = node(
        ("127.0.0.1", free_port()),
        (endpoint("/turn", "geometry_msgs", "Quaternion"), endpoint("/turn/2", "geometry_msgs", "Point")),
        (
            endpoint("/place", "geometry_msgs", "Point"),
            endpoint("/turn", "geometry_msgs", "Quaternion"),
            endpoint("/push", "geometry_msgs", "Vector3"),  # with the MD5 sum of a Point
        ),
        (ASK, SOON),
        _HOSTS,
    )
    manager = Manager(lambda _number, _payload: iter(()))
    board = clocked(made, chip, manager, program, Stalls(_SEED), []) if program else interpreted(made, chip, manager)
    board.wait_until_listening()
    yield Running(made, board, chip)
    board.close()


def header(*fields: str) -> bytes:
    """A header of TCPROS."""
    body = b"".join(struct.pack("<I", len(field)) + field.encode() for field in fields)
    return struct.pack("<I", len(body)) + body


def read(peer: socket.socket, length: int) -> bytes:
    """Read bytes, fewer only at the end of the connection."""
    data = b""
    while len(data) < length and (more := peer.recv(length - len(data))):
        data += more
    return data


def header_of(peer: socket.socket) -> dict[str, str]:
    """Read a header of TCPROS."""
    body = read(peer, int.from_bytes(read(peer, 4), "little"))
    found = {}
    while body:
        size = int.from_bytes(body[:4], "little")
        name, _, value = body[4 : 4 + size].decode().partition("=")
        found[name], body = value, body[4 + size :]
    return found


def pause() -> None:
    """Let the other side see what was sent as a part of its own."""
    time.sleep(0.002)


def service_sum() -> str:
    """The MD5 sum by which ROS itself knows the service of cameras."""
    code = "from sensor_msgs.srv import SetCameraInfo as s; print(s._md5sum)"
    done = subprocess.run([DEBIAN_PYTHON, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()
