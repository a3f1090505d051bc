"""The hardware opposite LiteEth, whose MAC, ARP, IPv4 and UDP are between it and the reference node."""

from __future__ import annotations

import random
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.control import Sizes
from fusesoc_firm.fabric.node import Endpoint
from tests.fabric.echo_node import node_in
from tests.fabric.memories import generics, memories
from tests.fabric.messages import Address
from tests.fabric.participant import Participant
from tests.fabric.test_board import CORES, HARDWARE, sample
from tests.fabric.test_board import SPECIFICATION as BOARD_SPECIFICATION
from tests.hdl.verilator import compiled
from tests.hdl.verilog import netlist
from tests.seeds import seeded

HERE = Path(__file__).parent
SEED = seeded(20261127)
BOARD = "192.0.2.9"
# Bytes of an id and a length; of the longest payload that the hardware sends.
HEAD, LONGEST = 5, 256
SPECIFICATION = """\
project:
  name: peer
  width: 64
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:03", address: 192.0.2.3}
blocks:
  - {name: counted, middleware: ROS2, mode: subscriber, message: std_msgs/UInt32, topic: /count_out,
     qos: {reliability: best_effort}, outgoing: [{name: count}]}
  - {name: said, middleware: ROS2, mode: subscriber, message: std_msgs/String, topic: /words_out,
     qos: {reliability: best_effort}, outgoing: [{name: words}]}
  - {name: count, middleware: ROS2, mode: publisher, message: std_msgs/UInt32, topic: /count_in,
     qos: {reliability: best_effort}}
  - {name: words, middleware: ROS2, mode: publisher, message: std_msgs/String, topic: /words_in,
     qos: {reliability: best_effort}}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both ends, translated by Verilator."""
    if not shutil.which("verilator"):
        pytest.skip("verilator is not installed")
    folder = tmp_path_factory.mktemp("liteeth")
    host = subprocess.check_output([sys.executable, str(HERE / "liteeth_host.py")], text=True, cwd=folder)
    (folder / "board.yaml").write_text(BOARD_SPECIFICATION, encoding="utf-8")
    node = node_in(folder / "board.yaml")
    files = [*memories(node, "net_node", folder, Sizes.of(node)), CORES / "net_node.vhd"]
    verilog = netlist("net_node", folder, files, HARDWARE, (), **generics(node, Sizes.of(node)))
    parts = verilog.read_text(encoding="utf-8"), host, (HERE / "liteeth_bench.v").read_text(encoding="ascii")
    bench = (HERE / "liteeth_bench.cpp").read_text(encoding="ascii")
    return compiled("\n".join(parts), "liteeth_bench", bench, folder)


class Network:
    """The reference node at LiteEth, and the time of both ends."""

    def __init__(self, process: subprocess.Popen[str], folder: Path) -> None:
        (folder / "peer.yaml").write_text(SPECIFICATION, encoding="utf-8")
        self._process = process
        self.node = node_in(folder / "peer.yaml")
        self.participant = Participant(self.node, self._take)
        self.now = 0
        self.frames: list[bytes] = []
        # As frames with the number of the reader.
        self.samples: list[bytes] = []
        self.participant.start(0)

    def _take(self, endpoint: Endpoint, payload: bytes) -> None:
        number = [item.topic for item in self.node.readers].index(endpoint.topic)
        self.samples.append(struct.pack("<BI", number, len(payload)) + payload)

    def run(self, milliseconds: int) -> None:
        """Let both ends run; what they send arrives within the same millisecond or in the next one."""
        for _ in range(milliseconds):
            self.now += 1
            self.participant.tick(self.now)
            self._send()
            for kind, data in self._passed():
                if kind == "frame":
                    self.frames.append(data)
                else:
                    self.participant.receive(data, self.now)

    def _send(self) -> None:
        assert self._process.stdin
        # LiteEth has no groups: the hardware is addressed like a first peer whose address is known.
        group, board = Address(rtps.MULTICAST, rtps.multicast_port(0)), Address(BOARD, rtps.metatraffic_port(0))
        for address, packet in self.participant.outbox:
            port = (board if address == group else address).port
            assert address.host == BOARD or address == group
            self._process.stdin.write(f"send {port} {packet.hex()}\n")
        self.participant.outbox.clear()
        self._process.stdin.write("run 1\n")
        self._process.stdin.flush()

    def _passed(self) -> Iterator[tuple[str, bytes]]:
        assert self._process.stdout
        while (line := self._process.stdout.readline()) != "done\n":
            assert line, "the simulation has ended"
            kind, data = line.split()
            yield kind, bytes.fromhex(data)

    def run_until_matched(self) -> None:
        """Until the hardware's writers are known, and it knows this node's; at most two seconds."""
        for _ in range(200):
            self.run(10)
            if len(self.participant.sources) == 2 and len(self.participant.sinks) == 2:
                # The hardware has matched the writers of this node by then, too.
                self.run(200)
                return
        raise AssertionError(f"not matched after two seconds: {self.participant.counts}")


@pytest.fixture
def network(program: Path, tmp_path: Path) -> Iterator[Network]:
    with subprocess.Popen([str(program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield Network(process, tmp_path)
        process.kill()


@pytest.mark.check
def test_samples_of_all_sizes_pass_through_liteeth_in_both_directions(network: Network) -> None:
    print(f"seed {SEED}")
    network.run_until_matched()
    chance = random.Random(SEED)
    writers = {item.topic: item for item in network.node.writers}
    sent: list[int | str] = []
    for number in range(300):
        if chance.random() < 0.3:
            sent.append(chance.getrandbits(32))
            topic, payload = "rt/count_in", struct.pack("<I", sent[-1])
        else:
            text = "x" * chance.choice((number, chance.randrange(1300)))
            sent.append(text)
            topic, payload = "rt/words_in", struct.pack("<I", len(text) + 1) + text.encode() + b"\0"
        network.participant.publish(writers[topic], rtps.XCDR1 + payload, network.now)
        network.run(chance.randrange(4, 8))
    network.run(100)
    assert [*map(sample, network.frames)] == sent
    # The frames return to the node, which sends those that have room in its history to the peer.
    short = [frame for frame in network.frames if len(frame) <= HEAD + LONGEST]
    assert len(short) > len(sent) / 2
    assert [*map(sample, network.samples)] == [*map(sample, short)]
