"""Services of hardware with real rospy, roscpp and rclpy: each call of clients at once gets its own answer.

`pytest -m thorough tests/ros/test_services.py` makes 1,000 calls of each kind of client and node.
"""

from __future__ import annotations

import json
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from tests.ros.cpp_nodes import Client, NodeProcess, Peer, roscpp_peer
from tests.ros.live_nodes import REPOSITORY
from tests.ros.places import Place, diagnoses, running, versions, wait_until_reached

HERE = Path(__file__).resolve().parent
CLIENTS = 4
REASONS = {"refused": "the hardware rejected the request", "aborted": "the hardware aborted the response"}


@dataclass
class Camera(Place):
    """The systems of tests/ros/camera, of which one is meant."""

    system: str = "camera"

    def specification(self, time_limit: str = "") -> Path:
        """The specification, with another time limit of the hardware if one is given."""
        folder = self.folder / "camera"
        if not folder.exists():
            shutil.copytree(HERE / "camera", folder)
            # The source of hardware that only a model stands for.
            (folder / "ask.vhd").touch()
        text = (HERE / f"camera/{self.system}.yaml").read_text(encoding="utf-8")
        if self.version == 2:
            text = text.replace("middleware: ROS", "middleware: ROS2").replace("SetCameraInfoRe", "SetCameraInfo_Re")
        spec = folder / ("hasty.yaml" if time_limit else f"{self.system}.yaml")
        spec.write_text(text.replace("timeLimit: 100 s", f"timeLimit: {time_limit or '100 s'}"), encoding="utf-8")
        return spec

    def node(self, language: str, transport: str, time_limit: str = "") -> NodeProcess:
        """A node in Python or C++."""
        return self.node_of(self.specification(time_limit), language, transport)

    @property
    def hardware(self) -> str:
        """The address of the VHDL in GHDL."""
        return self.simulator(self.specification())

    def client(self, kind: str, calls: int, seed: int, texts: Sequence[str] = (), *, always: bool = False) -> Client:
        """A client of rospy or rclpy, or of roscpp; some requests begin with one of the texts, or all."""
        words = ["/set_camera_info", str(calls), str(seed)]
        if kind == "python":
            script = [self.ros.python, str(HERE / "service_peer.py"), str(self.version)]
            return Client(
                self.ros, [*script, *words, *(["--texts", *texts] if texts else []), *(["--always"] if always else [])]
            )
        code = "from sensor_msgs.srv import SetCameraInfo as s; print(s._md5sum)"
        done = subprocess.run([self.ros.python, "-c", code], capture_output=True, text=True, check=True)
        return Client(self.ros, [str(roscpp_peer("service_client")), *words, done.stdout.strip()])

    @property
    def model(self) -> str:
        """The address of the model of the hardware."""
        script = HERE / "service_simulator.py"
        command = f"{sys.executable} {script} {self.system} {self.version} {self.gate.path}"
        return f"pipe:exec env PYTHONPATH={REPOSITORY} {command} --width 32"


@pytest.fixture(scope="module", params=versions("services"))
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Camera]:
    with running(request, tmp_path_factory) as (ros, folder):
        yield Camera(ros, folder)


def call_at_once(
    place: Camera, node: NodeProcess, kinds: Sequence[str], calls: int, texts: Sequence[str] = ()
) -> list[dict[str, Any]]:
    """What came to all clients that was wrong or failed; each call has a text of its own."""
    seeds = [random.randrange(2**32) for _ in kinds]
    print(f"seeds {seeds}")
    clients = [place.client(kind, calls, seed, texts) for kind, seed in zip(kinds, seeds, strict=True)]
    try:
        assert [client.line() for client in clients] == ["ready\n"] * CLIENTS, node.said()
        for client in clients:
            client.begin()
        return [json.loads(client.line()) for client in clients]
    finally:
        for client in clients:
            client.end()


def check_counts(node: NodeProcess, answered: int, failed: int) -> None:
    """Stop the node; it has counted each call."""
    assert node.stop() == 0, node.said()
    counts = (answered + failed, answered, failed, 0)
    python = r"^set_camera_info +{} +{} +{} +{}$".format(*counts)
    cpp = "^set_camera_info: {} called, {} answered, {} failed, {} unasked$".format(*counts)
    assert re.search(f"{python}|{cpp}", node.said(), re.MULTILINE), node.said()


@pytest.mark.parametrize("language", ["python", "cpp"])
@pytest.mark.parametrize(
    "calls", [pytest.param(20, marks=pytest.mark.check), pytest.param(250, marks=pytest.mark.thorough)]
)
def test_four_clients_at_once_get_their_own_answers(place: Camera, calls: int, language: str) -> None:
    """The whole way: clients of ROS, two of them of roscpp in ROS 1, the node, the VHDL in GHDL."""
    kinds = ["python", "python", *["cpp" if place.version == 1 else "python"] * 2]
    with place.node(language, place.hardware) as node:
        assert call_at_once(place, node, kinds, calls) == [{"wrong": [], "failed": []}] * CLIENTS
        check_counts(node, CLIENTS * calls, 0)


@pytest.mark.check
@pytest.mark.parametrize("language", ["python", "cpp"])
def test_what_hardware_refuses_fails_at_its_client_only(place: Camera, language: str) -> None:
    """ROS 1 tells the reason; in ROS 2, `success` is false."""
    with place.node(language, place.model) as node, diagnoses(place.ros, "camera: node") as reports:
        results = call_at_once(place, node, ["python"] * CLIENTS, 15, [*REASONS])
        failed = [item for result in results for item in result["failed"]]
        assert [item for result in results for item in result["wrong"]] == []
        for text, reason in failed:
            told = REASONS[text.partition(" ")[0]]
            assert (told if place.version == 1 else "the hardware did not answer") in reason, (text, reason)
        counts = {"called": CLIENTS * 15, "answered": CLIENTS * 15 - len(failed), "failed": len(failed), "unasked": 0}
        published = {f"set_camera_info {name}": count for name, count in counts.items()}
        assert next(report for report in reports if published.items() <= report.items())
        check_counts(node, counts["answered"], counts["failed"])


@pytest.mark.check
@pytest.mark.parametrize("language", ["python", "cpp"])
def test_a_call_without_an_answer_fails_in_time(place: Camera, language: str) -> None:
    with place.node(language, place.model, "2 s") as node:
        client = place.client("python", 1, 1, ["silent"], always=True)
        try:
            assert client.line() == "ready\n"
            client.begin()
            ((_, reason),) = json.loads(client.line())["failed"]
        finally:
            client.end()
        assert ("no answer within 2" if place.version == 1 else "the hardware did not answer") in reason
        check_counts(node, 0, 1)


@pytest.mark.check
@pytest.mark.parametrize("language", ["python", "cpp"])
def test_a_client_that_dies_harms_nobody(place: Camera, language: str) -> None:
    """One of two clients is killed while the hardware has its call; the other one gets all answers."""
    place.gate.close()
    with place.node(language, place.model) as node:
        dying, other = place.client("python", 1, 1, ["gated"], always=True), place.client("python", 30, 2)
        try:
            assert dying.line() == other.line() == "ready\n"
            dying.begin()
            wait_until_reached(place.gate, node)
            dying.end()
            other.begin()
            place.gate.open()
            assert json.loads(other.line()) == {"wrong": [], "failed": []}
        finally:
            place.gate.open()
            for client in (dying, other):
                client.end()
        check_counts(node, 31, 0)


@pytest.mark.check
@pytest.mark.parametrize("language", ["python", "cpp"])
def test_hardware_calls_a_service(place: Camera, language: str) -> None:
    """Each call gets its answer, in order; a call that fails is not successful."""
    asking = replace(place, system="asking")
    names = [f"{'no' if number % 5 == 3 else 'yes'} {number}" for number in range(15)]
    with asking.node(language, asking.model) as node:
        command = [place.ros.python, str(HERE / "asking_peer.py"), str(place.version), *names]
        done = subprocess.run(command, env=dict(place.ros.environment), capture_output=True, text=True, check=True)
        failure = "the service did not answer" if place.version == 1 else "it is refused"
        assert json.loads(done.stdout) == [failure if name.startswith("no") else name[::-1] for name in names]
        check_counts(node, *((12, 3) if place.version == 1 else (15, 0)))


@pytest.mark.check
@pytest.mark.parametrize("language", ["python", "cpp"])
def test_a_call_without_a_server_fails_at_once(place: Camera, language: str) -> None:
    asking = replace(place, system="asking")
    topics = {"/name_out": "std_msgs/String"}, {"/name_in": "std_msgs/String"}
    if place.version == 2:
        topics = {"/name_out": "std_msgs/msg/String"}, {"/name_in": "std_msgs/msg/String"}
    head = b"" if place.version == 1 else b"\0\1\0\0"
    end = b"" if place.version == 1 else b"\0"
    with asking.node(language, asking.model) as node, Peer(place.ros, *topics) as peer:
        peer.wait_until_connected()
        peer.publish("/name_in", head + len(b"a" + end).to_bytes(4, "little") + b"a" + end)
        _, payload = peer.take()
        assert b"the service did not answer" in payload
        check_counts(node, 0, 1)
