"""Bags with the goals of actions go through hardware in GHDL that serves or sends them, in both versions of ROS."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from tests.ros.action_simulator import HELD
from tests.runs.replay.goals import CANCELED, RECALLED, SUCCEEDED, Goals, arm, planner, what_is_told
from tests.seeds import seeded

SEED = seeded(20261127)


def recorded(goals: Goals, count: int) -> tuple[list[tuple[str, int]], int, int]:
    """Record goals in groups, each sent before the first of its group ends, as the hardware of a robot would.

    Some are canceled, in the hardware or while they wait. Return what the hardware sends, and how many messages of
    feedback and results there are.
    """
    choice = random.Random(SEED)
    told: list[tuple[str, int]] = []
    feedback = number = canceled = 0
    while number < count:
        group = [
            (number + place, choice.choice([HELD, HELD, HELD, 4, 5, 6, 7])) for place in range(choice.randint(1, 4))
        ]
        number += len(group)
        for goal, value in group:
            goals.goal(goal + 1, value)
        # A goal in the hardware that is held would keep the others waiting.
        lost = {goal for goal, _ in group[1:] if choice.random() < 0.5} if group[0][1] == HELD else set()
        canceled += len(lost)
        for goal in lost:
            goals.cancel(goal + 1)
            goals.result(goal + 1, RECALLED[goals.version], None)
        for goal, value in group:
            if goal in lost:
                continue
            values = [value + 1] if value == HELD else [value + step for step in range(1, value % 4 + 1)]
            for item in values:
                goals.feedback(goal + 1, item)
            if value == HELD:
                goals.cancel(goal + 1)
            goals.result(goal + 1, CANCELED[goals.version] if value == HELD else SUCCEEDED[goals.version], value)
            told += [("feedback", item) for item in values] + [("result", value)]
            feedback += len(values)
    assert canceled, "the seed leads to goals that are canceled while they wait"
    return told, feedback, number


@pytest.mark.one_in(2)
@pytest.mark.parametrize("version", [1, 2])
def test_hardware_pursues_the_goals_of_a_bag(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    """All feedback and results are as recorded, with random stalls, and twice the same."""
    print(f"seed {SEED}")
    goals = Goals(version)
    told, feedback, results = recorded(goals, 24)
    source, spec = goals.write(tmp_path), arm(tmp_path, version)
    found = []
    for number in range(2):
        target = tmp_path / (f"{number}.bag" if version == 1 else f"{number}.mcap")
        arguments = ["replay", str(spec), "--in", str(source), "--out", str(target), "--json"]
        stalls = ["--stall-percent", "30", "--seed", "7", "--build-root", str(tmp_path / "build")]
        capsys.readouterr()
        assert main([*arguments, *stalls]) == 0
        said = json.loads(capsys.readouterr().out)
        found.append(goals.told(target))
        for kind, count in (("feedback", feedback), ("results", results)):
            (row,) = said[kind]
            others = row["different"], row["missing"], row["not_recorded"], row["without_goal"]
            assert (row["as_recorded"], *others) == (count, 0, 0, 0, 0)
    assert found[0] == found[1]
    # Messages of two topics with the same stamp have no order in a bag.
    for kind in ("feedback", "result"):
        assert [item for item in found[0] if item[0] == kind] == [item for item in told if item[0] == kind]


# The kind of what the hardware tells of feedback.
FEEDBACK = 0xFF


def recorded_orders(goals: Goals, count: int) -> tuple[list[tuple[int, int, int]], int]:
    """Record orders, each up to three goals before its own, and what becomes of the goals.

    Return what the hardware tells, and how many goals it cancels.
    """
    choice = random.Random(SEED)
    orders = [choice.choice([HELD + 128 * number, choice.randrange(1 << 20) & ~0x10]) for number in range(count)]
    told: list[tuple[int, int, int]] = []
    sent = canceled = 0
    for goal, order in enumerate(orders, 1):
        for _ in range(choice.randint(0, min(3, count - goal))):
            if sent < goal + 3 and sent < count:
                goals.order(orders[sent])
                sent += 1
        if sent < goal:
            goals.order(order)
            sent += 1
        goals.goal(goal, order)
        is_held = order & HELD == HELD
        values = [choice.randrange(1 << 16) for _ in range(choice.randint(is_held, 3))]
        for place, value in enumerate(values):
            goals.feedback(goal, value)
            if is_held and place == 0:
                goals.cancel(goal)
        state, value = (CANCELED if is_held else SUCCEEDED)[goals.version], choice.randrange(1 << 16)
        goals.result(goal, state, value)
        canceled += is_held
        told += [(order, FEEDBACK, item) for item in values] + [(order, state, value)]
    return told, canceled


@pytest.mark.one_in(2)
@pytest.mark.parametrize("version", [1, 2])
def test_hardware_sends_the_goals_of_a_bag(tmp_path: Path, version: int, capsys: pytest.CaptureFixture[str]) -> None:
    """All goals and cancellations are as recorded, with random stalls; the hardware tells all that the bag has."""
    print(f"seed {SEED}")
    goals = Goals(version)
    told, canceled = recorded_orders(goals, 24)
    source, spec = goals.write(tmp_path), planner(tmp_path, version)
    target = tmp_path / ("out.bag" if version == 1 else "out.mcap")
    arguments = ["replay", str(spec), "--in", str(source), "--out", str(target), "--json"]
    assert main([*arguments, "--stall-percent", "30", "--seed", "7", "--build-root", str(tmp_path / "build")]) == 0
    said = json.loads(capsys.readouterr().out.partition("\n")[2])
    counts = {
        kind: [row[name] for name in ("as_recorded", "different", "missing", "not_recorded") if name in row]
        for kind in ("goals", "cancellations")
        for row in said[kind]
    }
    assert counts == {"goals": [24, 0, 0, 0], "cancellations": [canceled, 0, 0]}
    assert 0 < canceled < 24, "the seed leads to both kinds of goals"
    assert what_is_told(target) == told
