"""A node in hardware, simulated at a TAP device, with real peers: rclpy with Fast DDS, and Cyclone DDS."""

from __future__ import annotations

import json
import os
import shutil
import struct
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.control import Sizes
from tests.fabric.echo_node import node_in
from tests.fabric.hosts import Host, switched
from tests.fabric.memories import generics, memories
from tests.fabric.test_peers import HERE, Peer, Process, _why_not
from tests.hdl.ghdl import REPOSITORY, core_files
from tests.hdl.verilator import compiled
from tests.hdl.verilog import netlist
from tests.ros.cpp_nodes import ros2

CORES = HERE.parent / "cores"
PARTS = ("axis/package", "axis/axis", "net/mac", "net/package", "net/responder", "net/udp", "net/rtps", "net/builder")
HARDWARE = [*core_files(*PARTS), REPOSITORY / "cores/net/rtl/firm_net_merge.vhd"]
SAMPLES = 200
# Samples that a peer sends at once. The TAP device drops frames after 500, and nobody sends them again at best effort.
LOT = 50
TYPES = {"count": "UInt32", "words": "String", "sure": "String"}
SPECIFICATION = """\
project:
  name: board
  width: 64
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:02", address: 192.0.2.9}
blocks:
  - {name: start, middleware: ROS2, mode: subscriber, message: std_msgs/UInt32, topic: /count_in,
     qos: {reliability: best_effort}, outgoing: [{name: count}]}
  - {name: words, middleware: ROS2, mode: subscriber, message: std_msgs/String, topic: /words_in,
     qos: {reliability: best_effort}, outgoing: [{name: said}]}
  - {name: sure, middleware: ROS2, mode: subscriber, message: std_msgs/String, topic: /sure_in,
     outgoing: [{name: surely}]}
  - {name: count, middleware: ROS2, mode: publisher, message: std_msgs/UInt32, topic: /count_out,
     qos: {reliability: best_effort}}
  - {name: said, middleware: ROS2, mode: publisher, message: std_msgs/String, topic: /words_out,
     qos: {reliability: best_effort}}
  - {name: surely, middleware: ROS2, mode: publisher, message: std_msgs/String, topic: /sure_out}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The hardware, translated by Verilator."""
    if not shutil.which("verilator"):
        pytest.skip("verilator is not installed")
    folder = tmp_path_factory.mktemp("node")
    path = folder / "node.yaml"
    path.write_text(SPECIFICATION, encoding="utf-8")
    node = node_in(path)
    files = memories(node, "net_node", folder, Sizes.of(node))
    verilog = netlist(
        "net_node", folder, [*files, CORES / "net_node.vhd"], HARDWARE, (), **generics(node, Sizes.of(node))
    )
    bench = (CORES / "net_node.cpp").read_text(encoding="ascii")
    return compiled(verilog.read_text(encoding="utf-8"), "net_node", bench, folder, [CORES])


class Lab:
    """A switch with the board's TAP device, and two hosts."""

    def __init__(self, program: Path, folder: Path, stack: ExitStack) -> None:
        self._program, self._stack, self._ros = program, stack, ros2(folder)
        self._switch, *self._hosts = stack.enter_context(switched(2))
        self._switch.run("ip", "tuntap", "add", "dev", "tap0", "mode", "tap")
        self._switch.run("ip", "link", "set", "tap0", "master", "switch", "up")

    def board(self, *options: str) -> Process:
        """The simulated board."""
        started = Process(self._switch, [str(self._program), *options])
        self._stack.callback(started.kill)
        assert started.line() == {"ready": True}
        return started

    def peers(self, *written: str, read: str = "count", reliability: str = "best_effort") -> dict[str, Peer]:
        """A peer of each kind that reads a topic of the board, and writes some."""
        options = [reliability, *(json.dumps({name: TYPES[name] for name in names}) for names in ([read], written))]
        others = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DOMAIN_ID")
        environment = {name: value for name, value in self._ros.environment.items() if name not in others}
        return {
            "rclpy": self._peer(self._hosts[0], self._ros.python, "ros_peer.py", environment, options),
            "cyclone": self._peer(self._hosts[1], sys.executable, "cyclone_peer.py", dict(os.environ), options),
        }

    def _peer(self, host: Host, python: str, name: str, environment: dict[str, str], options: list[str]) -> Peer:
        peer = Peer(host, [python, str(HERE / name), *options], environment)
        self._stack.callback(peer.kill)
        return peer


@pytest.fixture
def lab(program: Path, tmp_path: Path) -> Iterator[Lab]:
    if reason := _why_not():
        pytest.skip(reason)
    if not Path("/dev/net/tun").exists():
        pytest.skip("there is no /dev/net/tun")
    with ExitStack() as stack:
        yield Lab(program, tmp_path, stack)


def numbers(peer: Peer, count: int) -> list[int]:
    return [int(values[0]) for _, values in peer.take(count)]


def wait_for(board: Process, peers: int, sources: int, sinks: int) -> None:
    """Wait until the board knows so many peers and their writers and readers, that of the graph of rclpy included."""
    while board.line() != {"peers": peers, "sources": sources, "sinks": sinks}:
        pass


def frames(board: Process, count: int) -> list[bytes]:
    """The next frames to the host."""
    found: list[bytes] = []
    while len(found) < count:
        line = board.line()
        found += [bytes.fromhex(line["frame"])] if "frame" in line else []
    return found


def sample(frame: bytes) -> str | int:
    """The number of a frame of the first reader, or the text of one of the second. Some peers pad their payloads."""
    number, size = struct.unpack_from("<BI", frame)
    payload = frame[5:]
    assert size == len(payload) and payload[:2] == rtps.XCDR1[:2]
    (value,) = struct.unpack_from("<I", payload, 4)
    if number == 0:
        assert size == 8
        return int(value)
    assert number == 1 and 0 <= size - 8 - value < 4 and payload[7 + value] == 0
    return payload[8 : 7 + value].decode()


@pytest.mark.check
@pytest.mark.xdist_group("fabric")
def test_both_peers_see_the_hardware_and_get_its_samples_in_order(lab: Lab) -> None:
    board, peers = lab.board(), lab.peers()
    print({name: peer.wait_until_matched() for name, peer in peers.items()})
    for peer in peers.values():
        came = numbers(peer, 20)
        assert came == list(range(came[0], came[0] + 20))
    peers["rclpy"].tell('"graph"\n')
    graph = next(line for line in iter(peers["rclpy"].line, None) if isinstance(line, dict))
    assert ["board", "/"] in graph["nodes"]
    assert ["/count_out", ["std_msgs/msg/UInt32"]] in graph["topics"]
    # The writer of /count_out and the reader of /count_in.
    assert [end[:3] for end in graph["ends"]] == [["board", "/", "std_msgs/msg/UInt32"]] * 2
    assert all(end[3].startswith("RIHS01_") for end in graph["ends"])
    wait_for(board, 2, 0, 3)
    peers["cyclone"].tell('"farewell"\n')
    wait_for(board, 1, 0, 2)
    # The node runs on, and the other peer is not disturbed.
    came = numbers(peers["rclpy"], 20)
    assert came == list(range(came[0], came[0] + 20))
    board.kill()
    lab.board()
    while numbers(peers["rclpy"], 1)[0] >= came[0]:
        pass
    came = numbers(peers["rclpy"], 5)
    assert came == list(range(came[0], came[0] + 5))


@pytest.mark.check
@pytest.mark.xdist_group("fabric")
def test_samples_of_both_peers_become_frames_once_and_in_order(lab: Lab) -> None:
    board, peers = lab.board(), lab.peers("count", "words")
    print({name: peer.wait_until_matched() for name, peer in peers.items()})
    wait_for(board, 2, 4, 3)
    sent: list[list[str | int]] = []
    for place in range(len(peers)):
        # A value tells of whom it is; texts have many lengths.
        sent.append([1000 * place + number if number % 2 else f"{place} {'.' * number}" for number in range(SAMPLES)])
    found: list[str | int] = []
    for begin in range(0, SAMPLES, LOT):
        for peer, values in zip(peers.values(), sent, strict=True):
            for value in values[begin : begin + LOT]:
                peer.tell(["words" if isinstance(value, str) else "count", [value]])
        found += map(sample, frames(board, 2 * LOT))
    assert sorted(map(str, found)) == sorted(str(value) for values in sent for value in values)
    for values in sent:
        for kind in (str, int):
            # The order holds for each writer.
            wanted = [value for value in values if isinstance(value, kind)]
            assert [value for value in found if value in wanted] == wanted
    peers["cyclone"].tell('"farewell"\n')
    wait_for(board, 1, 2, 2)
    # The other one is not disturbed.
    peers["rclpy"].tell(["words", ["more"]])
    while "frame" not in (line := board.line()):
        pass
    assert sample(bytes.fromhex(line["frame"])) == "more"
    print(line["cycles"], "cycles from the last byte at the GMII to the first beat")
    assert line["cycles"] <= 16


@pytest.mark.check
@pytest.mark.xdist_group("fabric")
@pytest.mark.parametrize("loss", [0, 20])
def test_reliable_samples_return_to_both_peers_whatever_is_lost(lab: Lab, loss: int) -> None:
    """The board returns each text of each peer to both."""
    board, peers = lab.board("echo", str(loss)), lab.peers("sure", read="sure", reliability="reliable")
    print({name: peer.wait_until_matched() for name, peer in peers.items()})
    wait_for(board, 2, 2, 3)
    sent = {name: [f"{name} {number} {'.' * number}" for number in range(SAMPLES)] for name in peers}
    for begin in range(0, SAMPLES, LOT):
        for name, peer in peers.items():
            for text in sent[name][begin : begin + LOT]:
                peer.tell(["sure", [text]])
        for peer in peers.values():
            came = [values[0] for _, values in peer.take(2 * LOT)]
            for texts in sent.values():
                assert [text for text in came if text in texts] == texts[begin : begin + LOT]
