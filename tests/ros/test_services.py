"""Services in hardware, called by real clients of rospy and rclpy at once: each call gets its own answer."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.ros.cpp_nodes import NodeProcess, Ros, missing_ros, running_ros
from tests.ros.live_nodes import REPOSITORY, LiveNode

HERE = Path(__file__).resolve().parent
CLIENTS = 4
REASONS = {
    "refused": "the hardware rejected the request",
    "aborted": "the hardware aborted the response",
    "silent": "no answer within 3 s",
}
# Each silence takes the time limit.
TEXTS = [*["refused", "aborted"] * 4, "silent"]


@dataclass
class Place:
    """A version of ROS that runs, and a folder with the system."""

    ros: Ros
    folder: Path

    @property
    def version(self) -> int:
        return self.ros.version

    def specification(self, time_limit: str = "30 s") -> Path:
        spec = self.folder / "camera/camera.yaml"
        if not spec.exists():
            shutil.copytree(HERE / "camera", spec.parent)
        text = (HERE / "camera/camera.yaml").read_text(encoding="utf-8").replace("10 s", time_limit)
        if self.version == 2:
            text = text.replace("middleware: ROS", "middleware: ROS2").replace("SetCameraInfoRe", "SetCameraInfo_Re")
        spec.write_text(text, encoding="utf-8")
        return spec

    def live(self, *arguments: str | Path, time_limit: str = "30 s") -> LiveNode:
        build = ["--build-root", str(self.folder / "simulators")]
        spec = str(self.specification(time_limit))
        return LiveNode(self.ros, self.folder / "node.log", ["live", spec, *map(str, arguments), *build])

    @property
    def model(self) -> str:
        """The address of the model of the hardware."""
        script = HERE / "service_simulator.py"
        return f"pipe:env PYTHONPATH={REPOSITORY} {sys.executable} {script} {self.version} --width 32"


@pytest.fixture(
    scope="module",
    params=[pytest.param(version, marks=pytest.mark.xdist_group(f"services_{version}")) for version in (1, 2)],
    ids=["ros1", "ros2"],
)
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    folder = tmp_path_factory.mktemp(f"services{request.param}")
    if reason := missing_ros(request.param):
        pytest.skip(reason)
    with running_ros(request.param, folder) as ros:
        yield Place(ros, folder)


class Client:
    """A client of rospy or rclpy (service_peer.py) in a process of its own."""

    def __init__(self, ros: Ros, calls: int, seed: int, texts: Sequence[str] = ()) -> None:
        words = ["/set_camera_info", str(calls), str(seed), *(["--texts", *texts] if texts else [])]
        command = [ros.python, str(HERE / "service_peer.py"), str(ros.version), *words]
        self.process = subprocess.Popen(
            command, env=dict(ros.environment), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def line(self) -> str:
        assert self.process.stdout
        return self.process.stdout.readline()

    def begin(self) -> None:
        assert self.process.stdin
        self.process.stdin.write("\n")
        self.process.stdin.flush()


def call_at_once(place: Place, node: NodeProcess, calls: int, texts: Sequence[str] = ()) -> list[dict[str, Any]]:
    """What came to all clients that was wrong or failed; each call has a text of its own."""
    seeds = [random.randrange(2**32) for _ in range(CLIENTS)]
    print(f"seeds {seeds}")
    clients = [Client(place.ros, calls, seed, texts) for seed in seeds]
    try:
        assert [client.line() for client in clients] == ["ready\n"] * CLIENTS, node.said()
        for client in clients:
            client.begin()
        return [json.loads(client.line()) for client in clients]
    finally:
        for client in clients:
            client.process.kill()
            client.process.wait()


def check_counts(node: NodeProcess, answered: int, failed: int) -> None:
    """Stop the node; it has counted each call."""
    assert node.stop() == 0, node.said()
    row = next(line for line in node.said().splitlines() if line.startswith("set_camera_info  "))
    assert row.split()[1:] == [str(answered + failed), str(answered), str(failed), "0"], node.said()


@pytest.mark.parametrize(
    "calls", [pytest.param(20, marks=pytest.mark.check), pytest.param(250, marks=pytest.mark.thorough)]
)
def test_four_clients_at_once_get_their_own_answers(place: Place, calls: int) -> None:
    """The whole way: clients of ROS, the node, the VHDL in GHDL."""
    with place.live() as node:
        node.wait_until_ready()
        assert call_at_once(place, node, calls) == [{"wrong": [], "failed": []}] * CLIENTS
        check_counts(node, CLIENTS * calls, 0)


@pytest.mark.check
def test_what_hardware_refuses_fails_at_its_client_only(place: Place) -> None:
    """ROS 1 tells the reason; in ROS 2, `success` is false."""
    with place.live("--transport", place.model, time_limit="3 s") as node:
        node.wait_until_ready()
        results = call_at_once(place, node, 15, TEXTS)
        failed = [item for result in results for item in result["failed"]]
        assert [item for result in results for item in result["wrong"]] == []
        for text, reason in failed:
            expected = REASONS[text.partition(" ")[0]] if place.version == 1 else "the hardware did not answer"
            assert expected in reason, (text, reason)
        check_counts(node, CLIENTS * 15 - len(failed), len(failed))


@pytest.mark.check
def test_a_client_that_dies_harms_nobody(place: Place) -> None:
    """One of two clients is killed during calls that the hardware does not answer; the other one gets all answers."""
    with place.live("--transport", place.model, time_limit="3 s") as node:
        node.wait_until_ready()
        dying, other = Client(place.ros, 1_000_000, 1, ["silent"]), Client(place.ros, 30, 2)
        try:
            assert dying.line() == other.line() == "ready\n"
            dying.begin()
            node.wait_until_said("no answer within 3 s")
            other.begin()
            dying.process.kill()
            assert json.loads(other.line()) == {"wrong": [], "failed": []}
        finally:
            for client in (dying, other):
                client.process.kill()
                client.process.wait()
        assert node.stop() == 0
