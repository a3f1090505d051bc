"""`firm live` of a system that is a node by Ethernet: the board at a TAP device, and its peers at the same switch."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from tests.fabric.hosts import Host, found, switched
from tests.fabric.test_peers import HERE, Peer, Sample, _why_not
from tests.ros.cpp_nodes import ros2
from tests.shared import made_once

# The longest payload of a text, 65,280 bytes, and what it has besides the text: an encoding, a length and a zero.
LONGEST, BESIDES = 65280, 9
_LONG_BOARD = """\
project:
  name: board
  clock: 125 MHz
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:09", address: 192.0.2.9, phy: rgmii, reassembly: 65507, reassemblies: 2}
accelerators:
  - name: digest
    type: VHDL
    sources: digest.vhd
    interface:
      input: [{middleware: ROS2, message: std_msgs/String}]
      output: [{middleware: ROS2, message: std_msgs/UInt32}]
blocks:
  - {name: text, middleware: ROS2, mode: subscriber, message: std_msgs/String, topic: /text_in, maxLength: LONGEST,
     outgoing: [{name: said}]}
  - {name: said, middleware: ROS2, mode: publisher, message: std_msgs/String, topic: /text_out, maxLength: LONGEST,
     qos: {depth: 3}}
  - {name: summed, middleware: ROS2, mode: subscriber, message: std_msgs/String, topic: /summed_in, maxLength: LONGEST,
     outgoing: [{name: digest}]}
  - {name: digest, type: digest, outgoing: [{name: sum}]}
  - {name: sum, middleware: ROS2, mode: publisher, message: std_msgs/UInt32, topic: /sum_out, qos: {depth: 6}}
""".replace("LONGEST", str(LONGEST))
# Without a sample for so long, no further one is expected of a round.
_PATIENCE = 10.0
_BOARD = "/board is at 192.0.2.9, at tap0, in domain 0; Ctrl-C ends it\n"


def skip_without_peers(*programs: str) -> None:
    """Skip a test where there is no Verilator, TAP device, rclpy or Cyclone DDS, or one of these programs."""
    if reason := _why_not():
        pytest.skip(reason)
    for program in ("verilator", *programs):
        if not found(program):
            pytest.skip(f"{program} is not installed")
    if not Path("/dev/net/tun").exists():
        pytest.skip("there is no /dev/net/tun")


def long_board() -> Path:
    """The specification of a board that sends texts back, or answers with a number: its simulator is built once."""

    def make(folder: Path) -> None:
        shutil.copy(HERE / "digest.vhd", folder)
        (folder / "board.yaml").write_text(_LONG_BOARD, encoding="utf-8")

    return made_once("long_board", make) / "board.yaml"


class Lab:
    """A switch with the board's TAP device, and hosts for peers. The simulator is built beside the specification."""

    def __init__(self, specification: Path, folder: Path, stack: ExitStack, depend: Sequence[str] = ()) -> None:
        self._specification, self._stack, self._ros, self._depend = specification, stack, ros2(folder), depend
        self.switch, *self.hosts = stack.enter_context(switched(2))
        self.switch.run("ip", "tuntap", "add", "dev", "tap0", "mode", "tap")
        self.switch.run("ip", "link", "set", "tap0", "master", "switch", "up")

    def board(self, line: str = _BOARD) -> subprocess.Popen[str]:
        """The board, when it runs and has printed its first line."""
        words = [sys.executable, "-m", "fusesoc_firm.cli", "live", str(self._specification), "--tool", "verilator"]
        words += ["--network", "tap0", "--build-root", str(self._specification.parent / "build")]
        for core in self._depend:
            words += ["--depend", core]
        board = subprocess.Popen(self.switch.command(*words), stdout=subprocess.PIPE, text=True)
        self._stack.callback(_end, board)
        assert board.stdout
        assert board.stdout.readline() == line
        return board

    @contextmanager
    def lossy(self, percent: int, seed: int) -> Iterator[list[int]]:
        """A line between board and switch that loses so many frames each way; their numbers are there at its end."""
        self.switch.run("ip", "link", "set", "tap0", "nomaster")
        words = [sys.executable, str(HERE / "lossy_line.py"), "line", "tap0", str(percent), str(seed)]
        with subprocess.Popen(
            self.switch.command(*words), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as line:
            assert line.stdin and line.stdout
            assert line.stdout.readline() == "ready\n"
            self.switch.run("ip", "link", "set", "line", "master", "switch", "up")
            lost: list[int] = []
            yield lost
            printed, _ = line.communicate(timeout=_PATIENCE)
            assert line.returncode == 0
            lost += map(int, printed.split())

    def members(self) -> list[tuple[str, str]]:
        """Port and group of each membership that the switch knows."""
        command = self.switch.command("bridge", "-json", "mdb", "show", "dev", "switch")
        shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        return [(item["port"], item["grp"]) for part in json.loads(shown) for item in part.get("mdb", [])]

    def answers(self, address: str) -> bool:
        """Whether an address answers a ping of the first host."""
        command = self.hosts[0].command("busybox", "ping", "-c", "3", "-W", "2", address)
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    def status(self, address: str = "192.0.2.9") -> str:
        """The status of the board."""
        command = self.hosts[0].command(sys.executable, "-m", "fusesoc_firm.cli", "status", f"udp:{address}")
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    def rclpy(self, reads: Mapping[str, str], writes: Mapping[str, str]) -> Peer:
        """A peer of rclpy, at the first host."""
        others = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DOMAIN_ID")
        environment = {name: value for name, value in self._ros.environment.items() if name not in others}
        return self._peer(self.hosts[0], [self._ros.python, str(HERE / "ros_peer.py")], environment, reads, writes)

    def cyclone(self, reads: Mapping[str, str], writes: Mapping[str, str]) -> Peer:
        """A peer of Cyclone DDS, at the second host."""
        words = [sys.executable, str(HERE / "cyclone_peer.py")]
        return self._peer(self.hosts[1], words, dict(os.environ), reads, writes)

    def _peer(
        self,
        host: Host,
        words: list[str],
        environment: dict[str, str],
        reads: Mapping[str, str],
        writes: Mapping[str, str],
    ) -> Peer:
        peer = Peer(host, [*words, "reliable", json.dumps(reads), json.dumps(writes)], environment)
        self._stack.callback(peer.kill)
        return peer


def _end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()


Round = tuple[list[tuple[Peer, Sample]], list[Sample]]
"""What peers send, and what each of them gets then."""


def exchange(peers: Sequence[Peer], round_: Round) -> None:
    """Let all peers send, and check what each of them gets."""
    sent, wanted = round_
    for peer, sample in sent:
        peer.send([sample])
    for peer in peers:
        assert sorted(peer.take(len(wanted))) == sorted(wanted)


def settled(peers: Sequence[Peer], round_: Round) -> bool:
    """Whether what peers send comes to all; otherwise, the board has not matched all of their readers yet.

    A peer only knows that it has matched the board.
    """
    sent, wanted = round_
    for peer, sample in sent:
        peer.send([sample])
    answers = [_gets(peer, wanted) for peer in peers]
    return all(answers)


def _gets(peer: Peer, wanted: list[Sample]) -> bool:
    """Whether a peer gets some samples, perhaps after others."""
    left = list(wanted)
    while left and (sample := peer.next_sample(_PATIENCE)):
        if sample in left:
            left.remove(sample)
    return not left
