"""`firm live` of a system in the sockets of a chip: a simulated board at a switch, beside a host with ROS 1."""

from __future__ import annotations

import json
import math
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from tests.fabric.hosts import Host, missing, switched
from tests.ros.cpp_nodes import DEBIAN_PYTHON, missing_ros1, roscpp_peer
from tests.ros.live_nodes import PACED_PEER
from tests.wiznet.ros1_peers import service_sum

ROS = Path(__file__).parent.parent / "ros"
CAMERA, SERVICE_PEER = ROS / "camera", ROS / "service_peer.py"
MASTER, BOARD = "192.0.2.1", "192.0.2.2"
SPECIFICATION = """\
project:
  name: turn
  clock: 12 MHz
  width: {width}
  interconnect: {chip}
  network: {{mac: "02:00:00:00:00:01", address: {board}, master: {master}, namespace: /lab}}
accelerators:
  - name: first_three
    type: VHDL
    sources: first_three.vhd
    interface:
      input: [{{middleware: ROS, message: geometry_msgs/Quaternion, exclude: [w]}}]
      output: [{{middleware: ROS, message: geometry_msgs/Point}}]
blocks:
  - {{name: turn, middleware: ROS, mode: subscriber, message: geometry_msgs/Quaternion, outgoing: [{{name: three}}]}}
  - {{name: three, type: first_three, outgoing: [{{name: place}}]}}
  - {{name: place, middleware: ROS, mode: publisher, message: geometry_msgs/Point}}
  - {{name: roll, middleware: ROS, mode: subscriber, message: geometry_msgs/Quaternion, topic: /roll,
     outgoing: [{{name: other}}]}}
  - {{name: other, type: first_three, outgoing: [{{name: site}}]}}
  - {{name: site, middleware: ROS, mode: publisher, message: geometry_msgs/Point, topic: /site}}
"""
# Instead of the project of tests/ros/camera.
PROJECT = f"""\
project:
  name: camera
  width: 32
  clock: 12 MHz
  interconnect: {{chip}}
  network: {{{{mac: "02:00:00:00:00:01", address: {BOARD}, master: {MASTER}, namespace: /lab}}}}
"""
WAYS = [("/lab/turn", "/lab/place"), ("/roll", "/site")]

# The simulated board is never idle, so a test that waits for it in vain ends by this limit alone.
MOST_SECONDS = 300

pytestmark = pytest.mark.check


def _why_not() -> str:
    return missing_ros1() or missing() or ("" if shutil.which("verilator") else "verilator is not installed")


@dataclass(frozen=True)
class Peers:
    """The host with ROS 1, and its variables."""

    host: Host
    folder: Path
    board: subprocess.Popen[str] | None = None

    def start(self, *words: str, output: int = subprocess.PIPE) -> subprocess.Popen[str]:
        """Start a program there; `output` takes what it prints and its errors."""
        variables = {
            "ROS_MASTER_URI": f"http://{MASTER}:11311",
            "ROS_IP": MASTER,
            "ROS_HOME": str(self.folder),
            "ROS_LOG_DIR": str(self.folder / "log"),
        }
        given = [f"{name}={value}" for name, value in variables.items()]
        return subprocess.Popen(self.host.command("env", *given, *words), stdout=output, stderr=output, text=True)

    def tried(self, *words: str) -> tuple[int, str, str]:
        """Run a program there; return its exit status, what it prints, and its errors."""
        latest = time.monotonic() + MOST_SECONDS
        with _until_the_end(self.start(*words)) as process:
            while True:
                try:
                    printed, faults = process.communicate(timeout=0.1)
                except subprocess.TimeoutExpired:
                    self._check(latest)
                else:
                    return process.returncode, printed, faults

    def run(self, *words: str) -> str:
        """Run a program there, which has to succeed; return what it prints."""
        status, printed, faults = self.tried(*words)
        assert status == 0, faults[-2000:]
        return printed

    def wait_until(self, is_true: Callable[[], bool]) -> None:
        """Ask again until something is true."""
        latest = time.monotonic() + MOST_SECONDS
        while not is_true():
            self._check(latest)
            time.sleep(0.1)

    def _check(self, latest: float) -> None:
        """Fail when the board has ended, or the time is over."""
        assert self.board is None or self.board.poll() is None, "the board has ended"
        assert time.monotonic() < latest, f"waited for more than {MOST_SECONDS} s"


def _specification(folder: Path, chip: str, width: int) -> Path:
    path = folder / "turn.yaml"
    path.write_text(SPECIFICATION.format(chip=chip, width=width, board=BOARD, master=MASTER), encoding="utf-8")
    subprocess.run([*_firm(), "system", "skeleton", path.name], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return path


def _firm() -> list[str]:
    return [sys.executable, "-m", "fusesoc_firm.cli"]


@contextmanager
def _until_the_end(process: subprocess.Popen[str]) -> Iterator[subprocess.Popen[str]]:
    """A process that ends with the test."""
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@contextmanager
def _live(specification: Path, name: str, tool: str) -> Iterator[tuple[Peers, subprocess.Popen[str]]]:
    """A host with a master, and the simulated board of a system."""
    folder = specification.parent
    with switched(2) as (_, host, board_host):
        assert (host.address, board_host.address) == (MASTER, BOARD)
        peers = Peers(host, folder)
        live = [*_firm(), "live", str(specification), "--tool", tool, "--build-root", str(folder / "build")]
        with (
            _until_the_end(peers.start("rosmaster", "--core", "-p", "11311", output=subprocess.DEVNULL)),
            _until_the_end(subprocess.Popen(board_host.command(*live), stdout=subprocess.PIPE, text=True)) as board,
        ):
            assert board.stdout
            assert board.stdout.readline() == f"{name} is at {BOARD}; its master is {MASTER}:11311; Ctrl-C ends it\n"
            yield replace(peers, board=board), board


@pytest.mark.skipif(bool(_why_not()), reason=_why_not())
@pytest.mark.parametrize(
    ("chip", "width", "tool"),
    [
        ("w5500", 64, "verilator"),
        pytest.param("w5200", 8, "verilator", marks=pytest.mark.thorough),
        pytest.param("w5500", 8, "ghdl", marks=pytest.mark.thorough),
    ],
)
def test_a_simulated_board_serves_rospy(tmp_path: Path, chip: str, width: int, tool: str) -> None:
    with _live(_specification(tmp_path, chip, width), "/lab/turn", tool) as (peers, board):
        words = [DEBIAN_PYTHON, PACED_PEER, "1", "10", "2", json.dumps(WAYS)]
        for result in json.loads(peers.run(*words)):
            assert result["sent"] == 20
            assert result["z"] == [math.sin((number / 1000 - 3) / 2) for number in range(20)]
        if tool != "ghdl":
            # It gives up when an answer takes more than 5 s, which GHDL always takes, and others on a busy machine.
            peers.wait_until(lambda: "Pid: 1" in peers.tried("rosnode", "info", "/lab/turn")[1])
        peers.run("rosnode", "kill", "/lab/turn")
        peers.wait_until(lambda: "/lab/turn" not in peers.run("rosnode", "list").split())
        board.send_signal(signal.SIGINT)
        assert board.wait(MOST_SECONDS) == 0


@pytest.mark.skipif(bool(_why_not()), reason=_why_not())
@pytest.mark.parametrize("chip", [pytest.param("w5500", marks=pytest.mark.thorough), "w5200"])
def test_a_simulated_board_serves_calls_of_rospy_and_roscpp(tmp_path: Path, chip: str) -> None:
    """The service of tests/ros/camera, whose requests have any size."""
    shutil.copytree(CAMERA, tmp_path / "camera")
    specification = tmp_path / "camera" / "camera.yaml"
    text = specification.read_text(encoding="utf-8")
    for old, new in (("project: {name: camera, width: 32}", PROJECT.format(chip=chip)), ("4096", "2000")):
        assert text.count(old) == 1
        text = text.replace(old, new)
    specification.write_text(text, encoding="utf-8")
    client = roscpp_peer("service_client")
    name, calls = "/lab/set_camera_info", "10"
    # Each begins with the end of a line at its input.
    rospy = f"echo | {DEBIAN_PYTHON} {SERVICE_PEER} 1 {name} {calls} 1"
    roscpp = f"echo | {client} {name} {calls} 2 {service_sum()}"
    with _live(specification, "/lab/camera", "verilator") as (peers, _):
        for command in (rospy, roscpp):
            ready, result = peers.run("sh", "-c", command).splitlines()
            assert (ready, json.loads(result)) == ("ready", {"wrong": [], "failed": []})


def test_an_address_of_another_machine_is_explained(tmp_path: Path) -> None:
    specification = _specification(tmp_path, "w5500", 8)
    # This machine may have the addresses above.
    text = specification.read_text(encoding="utf-8").replace("192.0.2.", "203.0.113.")
    specification.write_text(text, encoding="utf-8")
    done = subprocess.run([*_firm(), "live", str(specification)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "this machine does not have the board's address 203.0.113.2" in done.stderr
