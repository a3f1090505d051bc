"""Bags with the goals of an action in hardware are replayed, in both versions of ROS, and what it sends is compared."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.runs.replay.command import replay
from fusesoc_firm.runs.replay.options import Settings, Source, Target
from fusesoc_firm.runs.simulation.software_run import system_stimuli
from fusesoc_firm.text.diagnostics import InputError
from tests.ros.action_simulator import HELD, HERE, Goal
from tests.runs.replay.goals import CANCELED, RECALLED, REJECTED, SUCCEEDED, Goals, arm, arm_and_planner
from tests.runs.replay.replays import load

pytestmark = pytest.mark.parametrize("version", [1, 2])


@pytest.fixture(autouse=True)
def path(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model's simulator needs this repository."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))


def replayed(
    folder: Path, goals: Goals, capsys: pytest.CaptureFixture[str], names: Mapping[str, str] | None = None
) -> tuple[list[tuple[str, int]], dict[str, Any]]:
    """Replay goals through a model of the hardware; what it sends, and the summary."""
    gate = str(folder / "gate")
    command = [sys.executable, str(HERE / "action_simulator.py"), str(goals.version), gate, "--width", "32"]
    target = folder / ("out.bag" if goals.version == 1 else "out.mcap")
    loaded, settings = load(arm(folder, goals.version)), Settings(names or {}, 1000, is_json=True)
    replay(loaded, Source(goals.write(folder)), Target(target), settings, lambda: Simulator(command))
    return goals.told(target), json.loads(capsys.readouterr().out)


def counts(said: Mapping[str, Any], kind: str) -> list[int]:
    """How many messages are as recorded, different, missing, not recorded, and without a goal."""
    (row,) = said[kind]
    return [row[name] for name in ("as_recorded", "different", "missing", "not_recorded", "without_goal")]


def test_what_a_goal_leads_to_is_compared(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Of the second goal, one message of feedback and the result were different ones; the rest is the node's own."""
    goals = Goals(version)
    goals.goal(1, 6)
    goals.feedback(1, 7)
    goals.feedback(1, 8)
    goals.states()
    goals.result(1, SUCCEEDED[version], 6)
    goals.goal(2, 9)
    goals.feedback(2, 11)
    goals.result(2, SUCCEEDED[version], 10)
    goals.goal(3, 4)
    goals.result(3, CANCELED[version], 4)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [
        ("feedback", 7), ("feedback", 8), ("result", 6), ("feedback", 10), ("result", 9), ("result", 4)
    ]  # fmt: skip
    assert counts(said, "feedback") == [2, 1, 0, 0, 0]
    assert counts(said, "results") == [1, 2, 0, 0, 0]
    assert [row["count"] for row in said["in"] if row["blocks"] == ["count_goal"]] == [3]
    # The states are the node's own.
    assert [row["count"] for row in said["dropped"]] == [1]


def test_a_goal_waits_for_the_result_before(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Of three goals together, the first ends by its cancellation, and the second is canceled while it waits."""
    goals = Goals(version)
    goals.goal(1, HELD)
    goals.goal(2, 5)
    goals.goal(3, 8)
    goals.cancel(2)
    goals.result(2, RECALLED[version], None)
    goals.cancel(1)
    goals.result(1, CANCELED[version], HELD)
    goals.result(3, SUCCEEDED[version], 8)
    # A late cancellation does not reach the hardware.
    goals.cancel(3)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [("feedback", HELD + 1), ("result", HELD), ("result", 8)]
    assert counts(said, "feedback") == [0, 0, 0, 1, 0]
    assert counts(said, "results") == [3, 0, 0, 0, 0]


def test_goals_that_are_incomplete_are_counted(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """One goal began before the bag, one has no result there, and for one the hardware has none."""
    goals = Goals(version)
    goals.feedback(1, 5)
    goals.result(1, SUCCEEDED[version], 5)
    goals.goal(2, 5)
    goals.goal(3, Goal.SILENT)
    goals.feedback(3, 1)
    goals.result(3, SUCCEEDED[version], 1)
    goals.goal(4, 8)
    goals.result(4, SUCCEEDED[version], 8)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [("feedback", 6), ("result", 5), ("result", 8)]
    assert counts(said, "feedback") == [0, 0, 1, 1, 1]
    assert counts(said, "results") == [1, 0, 1, 1, 1]


def test_a_goal_without_an_end_is_an_error_for_those_that_wait(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    goals = Goals(version)
    goals.goal(1, Goal.SILENT)
    goals.goal(2, 8)
    with pytest.raises(InputError, match="1 error; 0 of 2 messages had errors"):
        replayed(tmp_path, goals, capsys)
    (error,) = json.loads(capsys.readouterr().out)["first_errors"]
    assert error == "the hardware has no result of a goal of 'count', so 1 more were not replayed"


def test_a_goal_whose_frame_is_refused_does_not_hold_the_next_one(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    goals = Goals(version)
    goals.goal(1, Goal.REFUSED)
    goals.goal(2, 8)
    with pytest.raises(InputError, match="1 error; 1 of 2 messages had errors"):
        replayed(tmp_path, goals, capsys)
    said = json.loads(capsys.readouterr().out)
    assert "the hardware reports frame_error at 'count_goal'" in said["first_errors"][0]
    assert counts(said, "results") == [0, 0, 0, 1, 0]


def test_a_rejected_goal_is_compared(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    """ROS 2 has no result of a rejected goal; the response to the goal tells it."""
    goals = Goals(version)
    goals.goal(1, Goal.REJECTED, is_accepted=False)
    if version == 1:
        goals.result(1, REJECTED[version], 0)
    _, said = replayed(tmp_path, goals, capsys)
    assert counts(said, "results") == [1, 0, 0, 0, 0]


def test_damaged_feedback_is_an_error(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    goals = Goals(version)
    goals.goal(1, 8)
    goals.feedback(1, 9)
    goals.damage()
    goals.result(1, SUCCEEDED[version], 8)
    with pytest.raises(InputError, match="1 error; 0 of 1 messages had errors"):
        replayed(tmp_path, goals, capsys)
    said = json.loads(capsys.readouterr().out)
    topic = "/count/feedback" if version == 1 else "/count/_action/feedback"
    assert said["first_errors"][0].startswith(f"{topic}, message 0, at 10000000")
    assert counts(said, "results") == [1, 0, 0, 0, 0]


@pytest.mark.parametrize("is_mapped", [False, True])
def test_the_goals_of_another_name_belong_to_the_only_action_of_the_type(
    tmp_path: Path, version: int, is_mapped: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    goals = Goals(version, "/left")
    goals.goal(1, 5)
    goals.feedback(1, 6)
    goals.result(1, SUCCEEDED[version], 5)
    topic = "/left/goal" if version == 1 else "/left/_action/send_goal/_service_event"
    _, said = replayed(tmp_path, goals, capsys, {"count_goal": topic} if is_mapped else {})
    assert counts(said, "feedback") == counts(said, "results") == [1, 0, 0, 0, 0]


def test_goals_and_cancellations_are_stimuli_of_a_simulation(tmp_path: Path, version: int) -> None:
    goals = Goals(version)
    goals.goal(1, HELD)
    goals.feedback(1, HELD + 1)
    goals.cancel(1)
    goals.result(1, CANCELED[version], HELD)
    found = system_stimuli(goals.write(tmp_path), load(arm(tmp_path, version)))
    assert [item.subscriber.block for item in found] == ["count_goal", "count_cancel"]
    field = "goal" if version == 1 else "order"
    assert found[0].message["goal"] == {field: HELD}


def test_an_action_that_the_hardware_asks_for_takes_no_goals_of_a_simulation(tmp_path: Path, version: int) -> None:
    """So the only goals of the type are those of the action that the hardware serves, whatever their name."""
    goals = Goals(version, "/left")
    goals.goal(1, HELD)
    goals.cancel(1)
    found = system_stimuli(goals.write(tmp_path), load(arm_and_planner(tmp_path, version, "asked")))
    assert [item.subscriber.block for item in found] == ["count_goal", "count_cancel"]


def test_two_actions_of_one_name_are_refused(tmp_path: Path, version: int) -> None:
    goals = Goals(version)
    goals.goal(1, 5)
    goals.feedback(1, 6)
    source, loaded = Source(goals.write(tmp_path)), load(arm_and_planner(tmp_path, version, "count"))
    topic = "/count/feedback" if version == 1 else "/count/_action/send_goal/_service_event"
    message = f"topic {topic} in {source.path} belongs to two actions, 'asked' and 'count'"
    with pytest.raises(InputError, match=re.escape(message)):
        replay(loaded, source, Target(tmp_path / "out.bag"), Settings({}, 1000), lambda: pytest.fail("it is started"))
