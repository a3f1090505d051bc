"""`firm live` of a system that is a node by Ethernet: a simulated board at a TAP device, with rclpy and Cyclone DDS."""

from __future__ import annotations

import importlib.util
import random
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.fabric.live import Lab, Round, exchange, settled, skip_without_peers
from tests.fabric.test_peers import HERE, Peer, is_in, of
from tests.seeds import seeded

SYSTEM = HERE.parents[1] / "specs" / "quat2euler"
SEED = seeded(20261127)
CORES = ("robot:acc:firm_cordic:0.2.0", "robot:acc:firm_float64:0.2.0")
CLOCKS = {"rmii": "50 MHz", "rgmii": "125 MHz"}
# Quaternions and points that each peer sends before both wait for all results.
LOT, LOTS = 10, 5
# Quaternions of each peer, and the seconds from one to the next.
COUNT, PERIOD = 1000, 0.01
# Points come back as they are.
POINTS = """\
  - {name: points, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, topic: /point_in,
     outgoing: [{name: kept_points}]}
  - {name: kept_points, middleware: ROS2, mode: publisher, message: geometry_msgs/Point, topic: /point_out,
     qos: {durability: transient_local, depth: 60}}
"""
READS, WRITES = {"euler": "Point", "point": "Point"}, {"quaternion": "Quaternion", "point": "Point"}

pytestmark = [pytest.mark.check, pytest.mark.xdist_group("fabric")]


# The boards of test_network_status.py have RGMII.
@pytest.fixture(scope="module", params=["rmii", pytest.param("rgmii", marks=pytest.mark.thorough)])
def specification(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo with other names, an address and `POINTS`; its simulator is built beside it, once."""
    folder = tmp_path_factory.mktemp("board")
    shutil.copytree(SYSTEM / "rtl", folder / "rtl")
    text = (SYSTEM / "quat2euler_ethernet.yaml").read_text(encoding="utf-8")
    for old, new in {
        "192.168.1.20": "192.0.2.9",
        "clock: 50 MHz": f"clock: {CLOCKS[request.param]}",
        "name: quat2euler, phy: rmii": f"name: board, phy: {request.param}",
        "topic: quaternion": "topic: /quaternion_in",
        "topic: euler\n    qos: {profile: default}": "topic: /euler_out\n    qos: {depth: 100}",
    }.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = folder / "board.yaml"
    path.write_text(text + POINTS, encoding="utf-8")
    return path


def _model() -> Any:
    """The function that computes what the hardware answers."""
    spec = importlib.util.spec_from_file_location("quat2euler_model", SYSTEM / "model.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def lab(specification: Path, tmp_path: Path) -> Iterator[Lab]:
    skip_without_peers()
    with ExitStack() as stack:
        yield Lab(specification, tmp_path, stack, CORES)


def _round(peers: dict[str, Peer], chance: random.Random, lot: int = LOT) -> Round:
    """Quaternions and points of both peers, by turns."""
    model, both = _model(), [*peers.values()]
    quaternions = [[chance.uniform(-1, 1) for _ in range(4)] for _ in range(2 * lot)]
    points = [[chance.uniform(-1, 1) for _ in range(3)] for _ in range(2 * lot)]
    sent = [(both[number % 2], ("quaternion", values)) for number, values in enumerate(quaternions)]
    sent += [(both[number % 2], ("point", values)) for number, values in enumerate(points)]
    angles = [("euler", list(model.quaternion_to_euler(*values))) for values in quaternions]
    return sent, [*angles, *(("point", values) for values in points)]


def _peers(lab: Lab, chance: random.Random) -> dict[str, Peer]:
    """A peer of each kind, when all topics are matched at both ends."""
    peers = {"rclpy": lab.rclpy(READS, WRITES), "cyclone": lab.cyclone(READS, WRITES)}
    print({name: peer.wait_until_matched() for name, peer in peers.items()})
    while not settled([*peers.values()], _round(peers, chance, 1)):
        pass
    return peers


def test_messages_of_both_peers_come_back_to_both(lab: Lab) -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    board, peers = lab.board(), _peers(lab, chance)
    for _ in range(LOTS):
        exchange([*peers.values()], _round(peers, chance))
    peers["rclpy"].tell('"graph"\n')
    graph = next(line for line in iter(peers["rclpy"].line, None) if isinstance(line, dict))
    assert ["board", "/"] in graph["nodes"]
    assert ["/quaternion_in", ["geometry_msgs/msg/Quaternion"]] in graph["topics"]
    assert ["/euler_out", ["geometry_msgs/msg/Point"]] in graph["topics"]
    board.send_signal(signal.SIGINT)
    assert board.wait() == 0


@pytest.mark.thorough
def test_a_thousand_quaternions_of_each_peer_at_100_hertz(lab: Lab) -> None:
    print(f"seed {SEED}")
    chance, model = random.Random(SEED), _model()
    lab.board()
    peers = _peers(lab, chance)
    sent = {name: [[chance.uniform(-1, 1) for _ in range(4)] for _ in range(COUNT)] for name in peers}
    begun = time.monotonic()
    for number in range(COUNT):
        time.sleep(max(0.0, begun + number * PERIOD - time.monotonic()))
        for name, peer in peers.items():
            peer.send([("quaternion", sent[name][number])])
    wanted = {name: [list(model.quaternion_to_euler(*values)) for values in own] for name, own in sent.items()}
    for peer in peers.values():
        found = of("euler", peer.take(COUNT * len(peers)))
        assert sorted(found) == sorted(angles for own in wanted.values() for angles in own)
        assert all(is_in(own, found) for own in wanted.values())
        assert peer.next_sample(1.0) is None
    print(f"{COUNT} of each peer in {time.monotonic() - begun:.1f} s")


def test_a_switch_with_snooping_knows_the_board_as_a_member(lab: Lab) -> None:
    """The kernel's bridge asks for members, and forwards announcements to them only."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    querier = "mcast_snooping 1 mcast_querier 1 mcast_startup_query_interval 100 mcast_query_interval 500"
    lab.switch.run("ip", "link", "set", "switch", "type", "bridge", *querier.split())
    board = lab.board()
    while ("tap0", "239.255.0.1") not in lab.members():
        assert board.poll() is None
    peers = _peers(lab, chance)
    exchange([*peers.values()], _round(peers, chance))
