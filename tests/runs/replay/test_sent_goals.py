"""Bags with an action of another node are replayed: the hardware sends goals and gets what the bag has for them."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message.bag_reader import Recorded, Stream
from fusesoc_firm.node.engine.watch import Control
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.runs.bags.goals import Told as Recording
from fusesoc_firm.runs.replay.command import replay
from fusesoc_firm.runs.replay.hardware_run import Cause, Sent
from fusesoc_firm.runs.replay.options import Settings, Source, Target
from fusesoc_firm.runs.replay.sent_goals import SentGoals
from fusesoc_firm.system.derived.model import Topic
from fusesoc_firm.text.diagnostics import InputError
from tests.ros.action_simulator import HELD, HERE
from tests.runs.replay.goals import CANCELED, RECALLED, REJECTED, SUCCEEDED, Goals, planner, what_is_told
from tests.runs.replay.replays import Item, load

pytestmark = pytest.mark.parametrize("version", [1, 2])

# The kind of what the hardware tells of feedback, and the state of a lost goal for each version of ROS.
FEEDBACK, LOST = 0xFF, {1: 9, 2: 0}
Told = tuple[int, int, int]
STREAM = Stream("", "", "", "")


@pytest.fixture(autouse=True)
def path(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model's simulator needs this repository."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))


def replayed(
    folder: Path,
    goals: Goals,
    capsys: pytest.CaptureFixture[str],
    kind: str = "patient",
    names: Mapping[str, str] | None = None,
    part: Mapping[str, Any] | None = None,
    control: Control | None = None,
) -> tuple[list[Told], dict[str, Any]]:
    """Replay a bag through a model of the hardware; what the hardware tells, and the summary."""
    command = [sys.executable, str(HERE / "planner_simulator.py"), kind, str(goals.version), "--width", "32"]
    target = folder / ("out.bag" if goals.version == 1 else "out.mcap")
    loaded, settings = load(planner(folder, goals.version)), Settings(names or {}, 1000, is_json=True, control=control)
    source = Source(goals.write(folder), **(part or {}))
    replay(loaded, source, Target(target), settings, lambda: Simulator(command))
    return what_is_told(target), json.loads(capsys.readouterr().out)


def counts(said: Mapping[str, Any], kind: str) -> list[int]:
    """How many goals are as recorded, different, missing and not recorded; cancellations are never different."""
    (row,) = said[kind]
    return [row[name] for name in ("as_recorded", "different", "missing", "not_recorded") if name in row]


def test_the_hardware_gets_what_the_bag_has_for_its_goals(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """A goal with feedback, one that is canceled, and one that is rejected; the hardware tells all of it."""
    goals = Goals(version)
    goals.order(6)
    goals.goal(1, 6)
    goals.states()
    goals.feedback(1, 70)
    goals.feedback(1, 80)
    goals.result(1, SUCCEEDED[version], 60)
    # Too late.
    goals.cancel(1)
    goals.order(HELD)
    goals.goal(2, HELD)
    goals.feedback(2, 90)
    goals.cancel(2)
    goals.feedback(2, 91)
    goals.result(2, CANCELED[version], 92)
    goals.order(3)
    goals.goal(3, 3, is_accepted=False)
    if version == 1:
        goals.result(3, REJECTED[1], 0)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [
        (6, FEEDBACK, 70), (6, FEEDBACK, 80), (6, SUCCEEDED[version], 60),
        (HELD, FEEDBACK, 90), (HELD, FEEDBACK, 91), (HELD, CANCELED[version], 92),
        (3, REJECTED[version], 0),
    ]  # fmt: skip
    assert counts(said, "goals") == [3, 0, 0, 0]
    assert counts(said, "cancellations") == [1, 0, 0]
    assert said["goals"][0]["topic"] == "/count"
    assert said["warnings"] == said["feedback"] == []
    # The states are those of the server, and all else of the action is not among the topics.
    assert [row["count"] for row in said["dropped"]] == [1]
    assert [(row["topic"], row["count"]) for row in said["in"]] == [("/order", 3)]


def test_other_goals_than_those_of_the_bag_are_counted(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """The hardware sends another goal, cancels one that was not, does not cancel one that was, and sends one more."""
    goals = Goals(version)
    for number, (order, recorded) in enumerate([(6, 7), (HELD, HELD), (5, 5)]):
        goals.order(order)
        goals.goal(number, recorded)
        goals.feedback(number, 1)
        if number == 2:
            goals.cancel(number)
        goals.result(number, SUCCEEDED[version], recorded)
    goals.order(4)
    told, said = replayed(tmp_path, goals, capsys)
    assert [item for item in told if item[1] != FEEDBACK] == [
        (6, SUCCEEDED[version], 7), (HELD, SUCCEEDED[version], HELD), (5, SUCCEEDED[version], 5)
    ]  # fmt: skip
    assert counts(said, "goals") == [2, 1, 0, 1]
    assert counts(said, "cancellations") == [0, 1, 1]


def test_goals_that_the_hardware_does_not_send_are_missing(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    goals = Goals(version)
    goals.order(6)
    for number in range(3):
        goals.goal(number, 6)
        goals.cancel(number)
        goals.result(number, CANCELED[version], 6)
        # ROS may deliver feedback after the result.
        goals.feedback(number, 7)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [(6, CANCELED[version], 6)]
    assert counts(said, "goals") == [1, 0, 2, 0]
    assert counts(said, "cancellations") == [0, 3, 0]


def test_a_goal_without_a_result_is_lost_when_the_next_one_comes(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its cancellation is that of the node, which had lost it. The last goal of the bag has no end."""
    goals = Goals(version)
    for number, order in enumerate([6, 7, 8]):
        goals.order(order)
        goals.goal(number, order)
        if number == 0:
            goals.feedback(number, 1)
            goals.cancel(number)
        if number == 1:
            goals.result(number, SUCCEEDED[version], 2)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [(6, FEEDBACK, 1), (6, LOST[version], 0), (7, SUCCEEDED[version], 2)]
    assert counts(said, "goals") == [3, 0, 0, 0]
    assert counts(said, "cancellations") == [0, 0, 0]


def test_goals_that_wait_at_the_end_are_not_recorded(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first goal never ends. The order 0 cancels one that waits, which belongs to none."""
    goals = Goals(version)
    goals.order(5)
    goals.goal(1, 5)
    goals.order(6)
    goals.order(0)
    goals.order(7)
    goals.order(8)
    told, said = replayed(tmp_path, goals, capsys, "eager")
    assert told == []
    assert counts(said, "goals") == [1, 0, 0, 2]


def test_an_invalid_result_is_an_error_and_loses_its_goal(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    goals = Goals(version)
    for number, order in enumerate([6, 7]):
        goals.order(order)
        goals.goal(number, order)
        if number == 0 and version == 1:
            goals.result(number, SUCCEEDED[version], 1)
            goals.damage()
        elif number == 0:
            goals.feedback(number, 1)
            goals.damage()
    goals.result(1, SUCCEEDED[version], 2)
    with pytest.raises(InputError, match="1 error; 0 of 2 messages had errors"):
        replayed(tmp_path, goals, capsys)
    said = json.loads(capsys.readouterr().out)
    topic = "/count/result" if version == 1 else "/count/_action/feedback"
    assert said["first_errors"][0].startswith(f"{topic}, message 0, at 10000000")
    found = what_is_told(tmp_path / ("out.bag" if version == 1 else "out.mcap"))
    assert found == [(6, LOST[version], 0), (7, SUCCEEDED[version], 2)]


def test_the_server_has_one_goal_at_a_time(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    """The client of the bag did not wait. The third goal is canceled while it waits, so the bag does not have it."""
    goals = Goals(version)
    goals.order(5)
    goals.order(6)
    goals.goal(1, 5)
    goals.goal(2, 6)
    goals.order(7)
    goals.feedback(2, 1)
    goals.feedback(1, 1)
    goals.order(0)
    goals.cancel(1)
    goals.result(2, SUCCEEDED[version], 60)
    goals.result(1, CANCELED[version], 50)
    goals.order(8)
    goals.goal(3, 8)
    goals.result(3, SUCCEEDED[version], 80)
    told, said = replayed(tmp_path, goals, capsys, "eager")
    # The order 0 also canceled the second goal, which waited.
    assert [item[1:] for item in told] == [
        (CANCELED[version], 50), (RECALLED[version], 0), (RECALLED[version], 0), (SUCCEEDED[version], 60)
    ]  # fmt: skip
    assert counts(said, "goals") == [1, 1, 1, 0]
    assert counts(said, "cancellations") == [1, 0, 0]


def test_a_goal_may_be_read_after_its_result(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Topics have no order among them, and a client may send its goal again."""
    goals = Goals(version)
    goals.feedback(1, 1)
    goals.cancel(1)
    goals.result(1, CANCELED[version], 2)
    goals.goal(1, 6)
    goals.goal(1, 6)
    goals.order(6)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [(6, FEEDBACK, 1), (6, CANCELED[version], 2)]
    assert counts(said, "goals") == [1, 0, 0, 0]
    assert counts(said, "cancellations") == [0, 1, 0]


@pytest.mark.parametrize("part", ["start", "duration", "limit"])
def test_goals_in_a_part_of_a_bag(tmp_path: Path, version: int, part: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The first goal of the hardware belongs to the first one of the part; each part begins or ends with an order."""
    goals, middle = Goals(version), 0.0
    for number, order in enumerate([6, 7]):
        # A message is recorded in each ms.
        middle = len(goals.items) / 1000 - 0.0005
        goals.order(order)
        goals.goal(number, order)
        goals.result(number, SUCCEEDED[version], number + 1)
    found, said = replayed(tmp_path, goals, capsys, part={part: 1 if part == "limit" else middle})
    told, counted = {
        "start": ([(7, SUCCEEDED[version], 2)], [1, 0, 0, 0]),
        "duration": ([(6, SUCCEEDED[version], 1)], [1, 0, 0, 0]),
        # The bag is read up to the message.
        "limit": ([], [0, 0, 0, 1]),
    }[part]
    assert (found, counts(said, "goals")) == (told, counted)


class Valve(Control):
    """Lets some messages pass, and ends."""

    def __init__(self, passed: int) -> None:
        super().__init__()
        self._left = passed

    def passes(self) -> bool:
        self._left -= 1
        return self._left >= 0


@pytest.mark.parametrize("passed", range(5))
def test_messages_of_actions_are_paused_and_ended_like_others(
    tmp_path: Path, version: int, passed: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also without an ordinary message after them: the order, the goal, its feedback and its result pass one by one."""
    goals = Goals(version)
    goals.order(6)
    goals.goal(1, 6)
    goals.feedback(1, 70)
    goals.result(1, SUCCEEDED[version], 60)
    told, said = replayed(tmp_path, goals, capsys, control=Valve(passed))
    assert told == [(6, FEEDBACK, 70), (6, SUCCEEDED[version], 60)][: max(0, passed - 2)]
    assert counts(said, "goals") == [int(passed >= 2), 0, 0, int(passed == 1)]


def recorded_at(name: str, version: int) -> list[Item]:
    """What is recorded of a goal of an action of the same type."""
    goals = Goals(version, name)
    goals.goal(9, 9)
    goals.feedback(9, 99)
    goals.result(9, SUCCEEDED[version], 9)
    return goals.items


def test_the_goals_of_other_actions_do_not_matter(
    tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]
) -> None:
    goals = Goals(version)
    goals.order(6)
    goals.goal(1, 6)
    goals.result(1, SUCCEEDED[version], 6)
    goals.items += recorded_at("/other", version)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [(6, SUCCEEDED[version], 6)]
    assert counts(said, "goals") == [1, 0, 0, 0]
    assert {row["topic"].split("/")[1] for row in said["dropped"]} == {"other"}


@pytest.mark.parametrize("is_mapped", [False, True])
def test_the_goals_of_another_name_belong_to_the_only_action_of_the_type(
    tmp_path: Path, version: int, is_mapped: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    goals = Goals(version, "/left")
    goals.order(6)
    goals.goal(1, 6)
    goals.feedback(1, 7)
    goals.result(1, SUCCEEDED[version], 6)
    if is_mapped:
        # The type has other goals as well.
        goals.items += recorded_at("/right", version)
    topic = "/left/feedback" if version == 1 else "/left/_action/feedback"
    told, said = replayed(tmp_path, goals, capsys, names={"count_feedback": topic} if is_mapped else {})
    assert told == [(6, FEEDBACK, 7), (6, SUCCEEDED[version], 6)]
    assert counts(said, "goals") == [1, 0, 0, 0]


def test_a_bag_without_goals_is_reported(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Feedback, and in ROS 1 the result, come at their times."""
    goals = Goals(version)
    goals.order(6)
    goals.feedback(1, 7)
    if version == 1:
        goals.result(1, SUCCEEDED[version], 6)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [(6, FEEDBACK, 7), (6, SUCCEEDED[1], 6)][: 2 if version == 1 else 1]
    assert said["goals"] == []
    (warning,) = said["warnings"]
    assert "has no goals of 'count', so those of the hardware are not compared, and" in warning["message"]
    topic = "/count/goal" if version == 1 else "the contents of /count/_action/send_goal/_service_event"
    assert warning["hint"] == f"record {topic}"


def test_a_bag_without_results_is_reported(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    goals = Goals(version)
    for number, order in enumerate([6, 7]):
        goals.order(order)
        goals.goal(number, order)
    told, said = replayed(tmp_path, goals, capsys)
    assert told == [(6, LOST[version], 0)]
    (warning,) = said["warnings"]
    assert warning["message"].endswith("has no results of 'count', so the goals of the hardware are lost or do not end")
    topic = "/count/result" if version == 1 else "the contents of /count/_action/get_result/_service_event"
    assert warning["hint"] == f"record {topic}"


def test_the_hardware_gets_the_ids_that_it_has_given(tmp_path: Path, version: int) -> None:
    """Ids and headers are not compared. The result of a lost goal is that of a node at the time of the bag."""
    loaded = load(planner(tmp_path, version))
    (action,) = loaded.system.actions
    topics = {item.block: item for item in (*loaded.system.subscribers, *loaded.system.publishers)}
    # Hardware that sends all fields of a goal.
    name = topics["count_goal"].frame.message
    goal = Topic("count_goal", frame_of(name, loaded.libraries[action.ros].closure(name)))
    given: list[tuple[str, bytes]] = []

    def give(block: str, payload: bytes, _: int) -> bool:
        given.append((block, payload))
        return True

    goals = Goals(version)
    line = SentGoals(action, {**topics, "count_goal": goal}, give, [b"client-1"])

    def tell(block: str, payload: bytes) -> None:
        line.tell(Recording(action, block, Recorded(STREAM, 0, 0, payload), payload, payload))

    for own in (7, 8):
        line.take(Sent(goal, goals.payload(own, 5), Cause(0), None))
    for number in (1, 2, 3):
        tell("count_goal", goals.payload(number, 5))
    goals.feedback(1, 6)
    tell("count_feedback", goals.items[-1][3])
    if version == 1:
        goals.result(1, SUCCEEDED[1], 6)
        tell("count_result", goals.items[-1][3])
    while line.advance(3 * 10**9 + 4):
        pass
    assert [block for block, _ in given] == ["count_feedback", "count_result", "count_result"]
    assert goals.id_in("Feedback", given[0][1]) == 7
    if version == 1:
        assert [goals.id_in("Result", payload) for _, payload in given[1:]] == [7, 8]
        message: Any = goals.store.deserialize_ros1(given[2][1], "actionlib/msg/TestActionResult")
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 4)
    rows = {title: [*counts.values()] for title, counts in line.counts()}
    assert rows["goals"] == [2, 0, 1, 0]
