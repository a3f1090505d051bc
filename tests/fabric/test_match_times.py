"""How soon a board and its peers have matched, whichever began first: a simulated board, rclpy and Cyclone DDS."""

from __future__ import annotations

import os
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.fabric.live import Lab, skip_without_peers
from tests.fabric.test_peers import Peer

RUNS = 20
TYPES = {"point": "Point"}
SPECIFICATION = """\
project:
  name: board
  width: 64
  clock: 125 MHz
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:02", address: 192.0.2.9}
blocks:
  - {name: point, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, topic: /point_in,
     outgoing: [{name: kept_point}]}
  - {name: kept_point, middleware: ROS2, mode: publisher, message: geometry_msgs/Point, topic: /point_out}
"""

pytestmark = [pytest.mark.thorough, pytest.mark.xdist_group("fabric")]


@pytest.fixture(scope="module")
def specification(tmp_path_factory: pytest.TempPathFactory) -> Path:
    skip_without_peers()
    path = tmp_path_factory.mktemp("board") / "board.yaml"
    path.write_text(SPECIFICATION, encoding="utf-8")
    return path


def _matched(peer: Peer, since: float | None, times: list[float]) -> threading.Thread:
    """Note when a peer says that it has matched all: the time since then, or else since it had started."""

    def wait() -> None:
        own = peer.wait_until_matched()
        times.append(time.monotonic() - since if since is not None else own)

    thread = threading.Thread(target=wait)
    thread.start()
    return thread


@pytest.mark.parametrize("is_board_first", [True, False], ids=["board_first", "peers_first"])
def test_both_ends_match(specification: Path, tmp_path: Path, is_board_first: bool) -> None:
    """The names, the topics and the hashes are those of the graph; the times are printed, with the load."""
    found: list[float] = []
    for number in range(RUNS):
        folder = tmp_path / str(number)
        folder.mkdir()
        with ExitStack() as stack:
            lab = Lab(specification, folder, stack)
            if is_board_first:
                lab.board()
            peers = [lab.rclpy(TYPES, TYPES), lab.cyclone(TYPES, TYPES)]
            for peer in peers:
                peer.wait_until_started()
            if not is_board_first:
                lab.board()
            since = None if is_board_first else time.monotonic()
            times: list[float] = []
            for thread in [_matched(peer, since, times) for peer in peers]:
                thread.join()
            assert len(times) == len(peers)
            peers[0].tell('"graph"\n')
            graph = peers[0].line()
            assert ["board", "/"] in graph["nodes"]
            assert ["/point_out", ["geometry_msgs/msg/Point"]] in graph["topics"]
            assert len(graph["ends"]) == 2
            assert all(end[:2] == ["board", "/"] and end[3].startswith("RIHS01_") for end in graph["ends"])
            found.append(max(times))
            print(f"{number}: {max(times):.2f} s, load {os.getloadavg()[0]:.1f}", flush=True)
    print(f"{sum(each <= 1 for each in found)} of {RUNS} within a second; the slowest one {max(found):.2f} s")
