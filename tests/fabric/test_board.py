"""A node in hardware, simulated at a TAP device, with real peers: rclpy with Fast DDS, and Cyclone DDS."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.fabric.node import Node
from fusesoc_firm.fabric.packets import memory_of
from fusesoc_firm.text.render import render
from tests.bench.model import compiled
from tests.fabric.echo_node import node_in
from tests.fabric.hosts import Host, switched
from tests.fabric.test_peers import HERE, Peer, Process, _why_not
from tests.hdl.ghdl import Library, core_files
from tests.hdl.verilog import loops, netlist
from tests.ros.cpp_nodes import ros2

CORES = HERE.parent / "cores"
PARTS = ("axis/package", "axis/axis", "net/mac", "net/responder", "net/udp", "net/rtps", "net/builder")
HARDWARE = core_files(*PARTS)
SPECIFICATION = """\
project:
  name: board
  width: 64
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:02", address: 192.0.2.9}
blocks:
  - {name: start, middleware: ROS2, mode: subscriber, message: std_msgs/UInt32, outgoing: [{name: count}]}
  - {name: count, middleware: ROS2, mode: publisher, message: std_msgs/UInt32, topic: /count_out,
     qos: {reliability: best_effort}}
"""


def publishing_node(folder: Path) -> Node:
    """The node of the specification without its reader, which this hardware has not."""
    path = folder / "node.yaml"
    path.write_text(SPECIFICATION, encoding="utf-8")
    node = node_in(path)
    return replace(node, endpoints=node.writers)


def memory(folder: Path) -> Path:
    """The programs of the node's packets."""
    path = folder / "net_node_packets.vhd"
    rendering = memory_of(publishing_node(folder), "net_node_packets")
    path.write_text(render(rendering.template, rendering.context), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The hardware, translated by Verilator."""
    if not shutil.which("verilator"):
        pytest.skip("verilator is not installed")
    folder = tmp_path_factory.mktemp("node")
    verilog = netlist("net_node", folder, [memory(folder), CORES / "net_node.vhd"], HARDWARE)
    bench = (CORES / "net_node.cpp").read_text(encoding="ascii")
    return compiled(verilog.read_text(encoding="utf-8"), "net_node", bench, folder, [CORES])


class Lab:
    """A switch with the board's TAP device, and two hosts."""

    def __init__(self, program: Path, folder: Path, stack: ExitStack) -> None:
        self._program, self._stack, self._ros = program, stack, ros2(folder)
        self._switch, *self._hosts = stack.enter_context(switched(2))
        self._switch.run("ip", "tuntap", "add", "dev", "tap0", "mode", "tap")
        self._switch.run("ip", "link", "set", "tap0", "master", "switch", "up")

    def board(self) -> Process:
        """The simulated board."""
        started = Process(self._switch, [str(self._program)])
        self._stack.callback(started.kill)
        assert started.line() == {"ready": True}
        return started

    def peers(self) -> dict[str, Peer]:
        """A peer of each kind that listens to the board's topic."""
        others = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DOMAIN_ID")
        environment = {name: value for name, value in self._ros.environment.items() if name not in others}
        return {
            "rclpy": self._peer(self._hosts[0], self._ros.python, "ros_peer.py", environment),
            "cyclone": self._peer(self._hosts[1], sys.executable, "cyclone_peer.py", dict(os.environ)),
        }

    def _peer(self, host: Host, python: str, name: str, environment: dict[str, str]) -> Peer:
        options = ["best_effort", json.dumps({"count": "UInt32"}), "listen"]
        peer = Peer(host, [python, str(HERE / name), *options], environment)
        self._stack.callback(peer.kill)
        return peer


@pytest.fixture
def lab(program: Path, tmp_path: Path) -> Iterator[Lab]:
    if reason := _why_not():
        pytest.skip(reason)
    with ExitStack() as stack:
        yield Lab(program, tmp_path, stack)


def numbers(peer: Peer, count: int) -> list[int]:
    return [int(values[0]) for _, values in peer.take(count)]


def wait_for_peers(board: Process, count: int) -> None:
    while board.line() != {"peers": count}:
        pass


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
    assert [end[:3] for end in graph["ends"]] == [["board", "/", "std_msgs/msg/UInt32"]]
    assert graph["ends"][0][3].startswith("RIHS01_")
    wait_for_peers(board, 2)
    peers["cyclone"].tell('"farewell"\n')
    wait_for_peers(board, 1)
    # The node runs on, and the other peer is not disturbed.
    came = numbers(peers["rclpy"], 20)
    assert came == list(range(came[0], came[0] + 20))
    board.kill()
    lab.board()
    while numbers(peers["rclpy"], 1)[0] >= came[0]:
        pass
    came = numbers(peers["rclpy"], 5)
    assert came == list(range(came[0], came[0] + 5))


def test_the_control_has_no_latch_and_refuses_bad_generics(tmp_path: Path) -> None:
    library = Library("firm", tmp_path)
    library.analyse(core_files("axis/package", "axis/axis", "net/mac", "net/rtps"))
    assert library.latches("firm_rtps_control") == []
    for value in (0, 9):
        result = library.run("firm_rtps_control", {"PEERS": value})
        assert result.exit_code != 0
        assert f"firm_rtps_control: PEERS is {value}; legal: 1 to 8" in result.output


def test_the_control_has_no_combinational_loop(tmp_path: Path) -> None:
    assert loops("firm_rtps_control", tmp_path, HARDWARE[-2:-1], HARDWARE[:-2]) == []
