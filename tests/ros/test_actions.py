"""Actions of hardware with real actionlib and rclpy.action: goals with feedback, cancellations, clients that die.

`pytest -m thorough tests/ros/test_actions.py` sends 1,000 goals with each kind of node.
"""

from __future__ import annotations

import json
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from tests.ros.action_simulator import HELD, Goal, in_ros2
from tests.ros.cpp_nodes import Client, NodeProcess, Ros, roscpp_peer
from tests.ros.live_nodes import REPOSITORY
from tests.ros.places import Place, diagnoses, running, versions, wait_until_reached

HERE = Path(__file__).resolve().parent
CLIENTS = 4
SUCCEEDED = "SUCCEEDED"
CANCELED = {1: "PREEMPTED", 2: "CANCELED"}
MODULES = {1: "actionlib.msg", 2: "test_msgs.action"}


@dataclass
class Arm(Place):
    """The system of tests/ros/arm."""

    def specification(self, time_limit: str = "") -> Path:
        """The specification, with another time limit of the hardware if one is given."""
        folder = self.folder / "arm"
        if not folder.exists():
            shutil.copytree(HERE / "arm", folder)
        text = (HERE / "arm/arm.yaml").read_text(encoding="utf-8")
        text = in_ros2(text) if self.version == 2 else text
        spec = folder / ("hasty.yaml" if time_limit else "arm.yaml")
        spec.write_text(text.replace("timeLimit: 100 s", f"timeLimit: {time_limit or '100 s'}"), encoding="utf-8")
        return spec

    def node(self, language: str, transport: str, time_limit: str = "") -> NodeProcess:
        """A node in Python or C++."""
        return self.node_of(self.specification(time_limit), language, transport)

    @property
    def model(self) -> str:
        """The address of the model of the hardware."""
        command = f"{sys.executable} {HERE / 'action_simulator.py'} {self.version} {self.gate.path}"
        return f"pipe:exec env PYTHONPATH={REPOSITORY} {command} --width 32"

    @property
    def hardware(self) -> str:
        """The address of the VHDL in GHDL."""
        return self.simulator(self.specification())

    def cpp_client(self, goals: int, seed: int) -> Client:
        """A client of actionlib for roscpp."""
        return Client(self.ros, [str(roscpp_peer("action_client", "actionlib")), "/count", str(goals), str(seed)])

    def client(self, *words: str) -> Client:
        script = [self.ros.python, str(HERE / "action_peer.py"), str(self.version), "/count"]
        return Client(self.ros, [*script, *words])


def skip_without_actions(ros: Ros) -> None:
    module = MODULES[ros.version]
    done = subprocess.run(
        [ros.python, "-c", f"import {module}"], env=dict(ros.environment), capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip(f"{ros.python} lacks {module}")
    if ros.version == 1 and subprocess.run(["pkg-config", "--exists", "actionlib"], check=False).returncode:
        pytest.skip("actionlib is not installed (libactionlib-dev)")


@pytest.fixture(scope="module", params=versions("actions"))
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Arm]:
    with running(request, tmp_path_factory) as (ros, folder):
        skip_without_actions(ros)
        yield Arm(ros, folder)


def run_at_once(node: NodeProcess, clients: Sequence[Client]) -> list[list[Any]]:
    """What all clients found, one list for each."""
    try:
        assert [client.line() for client in clients] == ["ready\n"] * len(clients), node.said()
        for client in clients:
            client.begin()
        return [json.loads(client.line()) for client in clients]
    finally:
        for client in clients:
            client.end()


def faults(version: int, found: Sequence[Sequence[Any]]) -> list[Any]:
    """The goals that did not get what belongs to them. ROS may deliver feedback after the result, which is ignored."""
    wrong = []
    for goal, state, feedback, result in found:
        is_held = goal & HELD == HELD
        expected = [goal + step for step in range(1, (1 if is_held else goal % 4) + 1)]
        has_come = expected[: len(feedback)] == feedback and (not is_held or feedback)
        if not has_come or result != goal or state != (CANCELED[version] if is_held else SUCCEEDED):
            wrong.append([goal, state, feedback, result])
    return wrong


def check_counts(node: NodeProcess, **counts: int) -> None:
    """Stop the node; it has counted each goal."""
    assert node.stop() == 0, node.said()
    names = ("goals", "succeeded", "canceled", "aborted", "rejected")
    values = [sum(counts.values()), *(counts.get(name, 0) for name in names[1:])]
    python = r"^count +{} +{} +{} +{} +{}$".format(*values)
    cpp = "^count: {} goals, {} succeeded, {} canceled, {} aborted, {} rejected".format(*values)
    assert re.search(f"{python}|{cpp}", node.said(), re.MULTILINE), node.said()


def goals_of_each(language: str, where: str, goals: int) -> Any:
    """A run of four clients: 1,000 goals if it is asked for, and otherwise each language and each kind of hardware."""
    is_short = goals == FEW and (language, where) in (("python", "hardware"), ("cpp", "model"))
    return pytest.param(language, where, goals, marks=pytest.mark.check if is_short else pytest.mark.thorough)


FEW, MANY = 10, 250
RUNS = product(("python", "cpp"), ("model", "hardware"), (FEW, MANY))


@pytest.mark.parametrize(("language", "where", "goals"), [goals_of_each(*run) for run in RUNS])
def test_four_clients_at_once_get_their_own_results(place: Arm, language: str, where: str, goals: int) -> None:
    """Each goal has its own number, feedback and result; some are canceled while the hardware holds them.

    In ROS 1, two of the clients are of roscpp.
    """
    with place.node(language, getattr(place, where)) as node:
        seeds = [random.randrange(2**32) for _ in range(CLIENTS)]
        print(f"seeds {seeds}")
        clients = [place.client("--random", str(goals), str(seed)) for seed in seeds[: 2 if place.version == 1 else 4]]
        clients += [place.cpp_client(goals, seed) for seed in seeds[len(clients) :]]
        found = [item for goals_of_client in run_at_once(node, clients) for item in goals_of_client]
        assert faults(place.version, found) == []
        assert len({item[0] for item in found}) == CLIENTS * goals
        canceled = sum(item[1] == CANCELED[place.version] for item in found)
        check_counts(node, succeeded=len(found) - canceled, canceled=canceled)


@pytest.mark.check
@pytest.mark.parametrize("language", ["python", "cpp"])
def test_goals_that_fail_are_rejected_or_aborted(place: Arm, language: str) -> None:
    """Hardware rejects the frame of a goal, rejects the goal, or gives up after feedback."""
    with place.node(language, place.model) as node, diagnoses(place.ros, "arm: node") as reports:
        goals = [Goal.REFUSED, Goal.REJECTED, Goal.ABORTED, 3, HELD]
        (found,) = run_at_once(node, [place.client("--goals", *map(str, goals))])
        nothing = 0 if place.version == 1 else None
        assert [(goal, state, result) for goal, state, _, result in found] == [
            (Goal.REFUSED, "REJECTED", nothing),
            (Goal.REJECTED, "REJECTED", nothing),
            (Goal.ABORTED, "ABORTED", 7),
            (3, SUCCEEDED, 3),
            (HELD, CANCELED[place.version], HELD),
        ]
        counts = {"rejected": 2, "aborted": 1, "succeeded": 1, "canceled": 1}
        published = {f"count {name}": count for name, count in {**counts, "goals": 5, "unasked": 0}.items()}
        assert next(report for report in reports if published.items() <= report.items())
        check_counts(node, **counts)


@pytest.mark.check
@pytest.mark.parametrize("language", ["python", "cpp"])
def test_a_goal_without_an_answer_is_rejected_in_time(place: Arm, language: str) -> None:
    """The time limit comes before that of acceptance."""
    with place.node(language, place.model, "2 s") as node:
        (found,) = run_at_once(node, [place.client("--goals", str(Goal.SILENT))])
        assert found == [[Goal.SILENT, "REJECTED", [], 0 if place.version == 1 else None]]
        assert "rejected: no answer within 2" in node.said()
        check_counts(node, rejected=1)


@pytest.mark.check
@pytest.mark.parametrize("language", ["python", "cpp"])
def test_a_client_that_dies_harms_nobody(place: Arm, language: str) -> None:
    """A client is killed while the hardware has its goal; the goals of the other one wait, and are reached."""
    place.gate.close()
    with place.node(language, place.model) as node:
        dying, other = place.client("--goals", str(Goal.GATED)), place.client("--goals", "5", str(HELD + 1))
        try:
            assert dying.line() == other.line() == "ready\n"
            dying.begin()
            wait_until_reached(place.gate, node)
            dying.end()
            other.begin()
            place.gate.open()
            assert faults(place.version, json.loads(other.line())) == []
        finally:
            place.gate.open()
            dying.end()
            other.end()
        check_counts(node, succeeded=2, canceled=1)
