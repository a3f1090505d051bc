"""`firm live` of a system that is a node by Ethernet: a simulated board at a TAP device, with rclpy and Cyclone DDS."""

from __future__ import annotations

import importlib.util
import json
import os
import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.fabric.hosts import Host, switched
from tests.fabric.test_peers import HERE, Peer, _why_not
from tests.ros.cpp_nodes import ros2

SYSTEM = HERE.parents[1] / "specs" / "quat2euler"
SEED = 20261127
CLOCKS = {"rmii": "50 MHz", "rgmii": "125 MHz"}
# Quaternions that each peer sends before both wait for all results.
LOT, LOTS = 10, 5

pytestmark = [pytest.mark.check, pytest.mark.xdist_group("fabric")]


@pytest.fixture(scope="module", params=["rmii", "rgmii"])
def specification(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo with the names and the address of the other tests here; its simulator is built beside it, once."""
    folder = tmp_path_factory.mktemp("board")
    shutil.copytree(SYSTEM / "rtl", folder / "rtl")
    text = (SYSTEM / "quat2euler_ethernet.yaml").read_text(encoding="utf-8")
    for old, new in {
        "192.168.1.20": "192.0.2.9",
        "clock: 50 MHz": f"clock: {CLOCKS[request.param]}",
        "name: quat2euler, phy: rmii": f"name: board, phy: {request.param}",
        "topic: quaternion": "topic: /quaternion_in",
        "topic: euler": "topic: /euler_out",
    }.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = folder / "board.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def _model() -> Any:
    """The function that computes what the hardware answers."""
    spec = importlib.util.spec_from_file_location("quat2euler_model", SYSTEM / "model.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _live(*options: str) -> list[str]:
    return [sys.executable, "-m", "fusesoc_firm.cli", "live", *options]


class Lab:
    """A switch with the board's TAP device, and a host for each peer."""

    def __init__(self, specification: Path, folder: Path, stack: ExitStack) -> None:
        self._specification, self._stack, self._ros = specification, stack, ros2(folder)
        self.switch, *self._hosts = stack.enter_context(switched(2))
        self.switch.run("ip", "tuntap", "add", "dev", "tap0", "mode", "tap")
        self.switch.run("ip", "link", "set", "tap0", "master", "switch", "up")

    def board(self) -> subprocess.Popen[str]:
        """The board, when it runs."""
        words = _live(str(self._specification), "--tool", "verilator", "--network", "tap0")
        for core in ("firm_cordic", "firm_float64"):
            words += ["--depend", f"robot:acc:{core}:0.2.0"]
        words += ["--build-root", str(self._specification.parent / "build")]
        board = subprocess.Popen(self.switch.command(*words), stdout=subprocess.PIPE, text=True)
        self._stack.callback(_end, board)
        assert board.stdout
        assert board.stdout.readline() == "/board is at 192.0.2.9, at tap0, in domain 0; Ctrl-C ends it\n"
        return board

    def members(self) -> list[tuple[str, str]]:
        """Port and group of each membership that the switch knows."""
        command = self.switch.command("bridge", "-json", "mdb", "show", "dev", "switch")
        shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        return [(item["port"], item["grp"]) for part in json.loads(shown) for item in part.get("mdb", [])]

    def peers(self) -> dict[str, Peer]:
        """A peer of each kind."""
        others = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DOMAIN_ID")
        environment = {name: value for name, value in self._ros.environment.items() if name not in others}
        return {
            "rclpy": self._peer(self._hosts[0], self._ros.python, "ros_peer.py", environment),
            "cyclone": self._peer(self._hosts[1], sys.executable, "cyclone_peer.py", dict(os.environ)),
        }

    def _peer(self, host: Host, python: str, name: str, environment: dict[str, str]) -> Peer:
        types = {"euler": "Point"}, {"quaternion": "Quaternion"}
        peer = Peer(host, [python, str(HERE / name), "reliable", *map(json.dumps, types)], environment)
        self._stack.callback(peer.kill)
        return peer


def _end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()


@pytest.fixture
def lab(specification: Path, tmp_path: Path) -> Iterator[Lab]:
    if reason := _why_not():
        pytest.skip(reason)
    if not shutil.which("verilator"):
        pytest.skip("verilator is not installed")
    if not Path("/dev/net/tun").exists():
        pytest.skip("there is no /dev/net/tun")
    with ExitStack() as stack:
        yield Lab(specification, tmp_path, stack)


def _exchange(peers: dict[str, Peer], chance: random.Random) -> None:
    """Quaternions of both peers, by turns; each peer gets the angles of all."""
    model = _model()
    sent = [[chance.uniform(-1, 1) for _ in range(4)] for _ in range(2 * LOT)]
    for number, values in enumerate(sent):
        [*peers.values()][number % 2].send([("quaternion", values)])
    wanted = sorted(list(model.quaternion_to_euler(*values)) for values in sent)
    for peer in peers.values():
        assert sorted(values for _, values in peer.take(2 * LOT)) == wanted


def test_quaternions_of_both_peers_come_back_as_euler_angles(lab: Lab) -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    board, peers = lab.board(), lab.peers()
    print({name: peer.wait_until_matched() for name, peer in peers.items()})
    for _ in range(LOTS):
        _exchange(peers, chance)
    peers["rclpy"].tell('"graph"\n')
    graph = next(line for line in iter(peers["rclpy"].line, None) if isinstance(line, dict))
    assert ["board", "/"] in graph["nodes"]
    assert ["/quaternion_in", ["geometry_msgs/msg/Quaternion"]] in graph["topics"]
    assert ["/euler_out", ["geometry_msgs/msg/Point"]] in graph["topics"]
    board.send_signal(signal.SIGINT)
    assert board.wait() == 0


def test_a_switch_with_snooping_knows_the_board_as_a_member(lab: Lab) -> None:
    """The kernel's bridge asks for members, and forwards announcements to them only."""
    print(f"seed {SEED}")
    querier = "mcast_snooping 1 mcast_querier 1 mcast_startup_query_interval 100 mcast_query_interval 500"
    lab.switch.run("ip", "link", "set", "switch", "type", "bridge", *querier.split())
    board = lab.board()
    while ("tap0", "239.255.0.1") not in lab.members():
        assert board.poll() is None
    peers = lab.peers()
    print({name: peer.wait_until_matched() for name, peer in peers.items()})
    _exchange(peers, random.Random(SEED))
