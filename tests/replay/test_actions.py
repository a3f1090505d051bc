"""A bag with the goals and cancellations of actionlib is replayed like other topics."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.replay.command import Settings, Source, Target, replay
from tests.replay.replays import load, read, store_of, write
from tests.ros.action_simulator import HELD, HERE

GOAL, CANCEL = "actionlib/msg/TestActionGoal", "actionlib_msgs/msg/GoalID"


def test_goals_of_a_bag_are_replayed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Feedback and results get the types and names of actionlib's topics."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    store = store_of("ros1")
    types = store.types

    def payload(kind: str, message: object) -> bytes:
        return bytes(store.serialize_ros1(message, kind))

    time = types["builtin_interfaces/msg/Time"](7, 8)
    identity = types[CANCEL](time, "goal")
    header = types["std_msgs/msg/Header"](1, time, "here")
    goals = [types[GOAL](header, identity, types["actionlib/msg/TestGoal"](goal)) for goal in (HELD, 6)]
    items = [
        ("/count/goal", GOAL, 10**18, payload(GOAL, goals[0])),
        ("/count/cancel", CANCEL, 10**18 + 10**6, payload(CANCEL, identity)),
        ("/count/goal", GOAL, 10**18 + 2 * 10**6, payload(GOAL, goals[1])),
    ]
    target = tmp_path / "out.bag"
    spec = (HERE / "arm/arm.yaml").read_text(encoding="utf-8").replace("paths: msg", f"paths: {HERE / 'arm/msg'}")
    spec = spec.replace("[counting.vhd, counter.vhd]", "[counter.vhd]")
    (tmp_path / "arm.yaml").write_text(spec, encoding="utf-8")
    (tmp_path / "counter.vhd").touch()
    command = [sys.executable, str(HERE / "action_simulator.py"), "1", str(tmp_path / "gate"), "--width", "32"]
    replay(
        load(tmp_path / "arm.yaml"),
        Source(write(tmp_path / "in.bag", "ros1", items)),
        Target(target),
        Settings({}, 1000),
        lambda: Simulator(command),
    )
    found: list[tuple[str, Any]] = [
        (topic, store.deserialize_ros1(data, kind)) for topic, kind, _, data in read(target)
    ]
    told = [
        (topic, message.feedback.feedback if topic == "/count/feedback" else message.result.result)
        for topic, message in found
    ]
    assert told == [
        ("/count/feedback", HELD + 1),
        ("/count/result", HELD),
        ("/count/feedback", 7),
        ("/count/feedback", 8),
        ("/count/result", 6),
    ]
    assert [message.status.status for topic, message in found if topic == "/count/result"] == [2, 3]
