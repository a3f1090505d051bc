"""Actions: the converters of servers, where their connections lead, and their simulation."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.node.interface.description import describe
from fusesoc_firm.system.derived.model import Action, ServiceEnd
from fusesoc_firm.system.system_core import LoadedSystem, load_system
from fusesoc_firm.system.views.show import derived_description
from tests.ros.action_simulator import in_ros2
from tests.system.systems import LIBRARIES, connections

# Those of the two services of the action; the one of action_msgs/CancelGoal is not compared.
SIGNATURES = [
    "RIHS01_d807633803e38e164276573cd97e9fbd71e109c290bbf4cc312a0a1c9da7bbd9",
    "",
    "RIHS01_5d30fdeb21d20e117aa5f36c7b4f0b6874f1a8cf7a9c038d58f1156c5737b209",
]
ROS = Path(__file__).resolve().parents[1] / "ros"


def folder(path: Path, version: int, name: str = "arm") -> Path:
    """The system of tests/ros/arm or tests/ros/planner, for a version of ROS, with its stimuli."""
    for item in ("arm", "planner"):
        shutil.copytree(ROS / item, path / item)
    if version == 2:
        for file in (path / name).glob("*.[yp]*"):
            file.write_text(in_ros2(file.read_text(encoding="utf-8")), encoding="utf-8")
        if (stimuli := path / name / "ros2/stimuli.yaml").exists():
            shutil.copy(stimuli, path / name)
    return path / name


def load(path: Path, version: int, name: str = "arm") -> LoadedSystem:
    return load_system(folder(path, version, name) / f"{name}.yaml", LIBRARIES)


@pytest.mark.parametrize("version", [1, 2])
def test_an_action_is_four_converters(tmp_path: Path, version: int) -> None:
    system = load(tmp_path, version).system
    assert connections(system) == [
        "count_goal. -> counting.in0_",
        "count_cancel. -> counting.in1_",
        "counting.out0_ -> count_feedback.",
        "counting.out1_ -> count_result.",
    ]
    assert [item.block for item in system.subscribers] == ["count_goal", "count_cancel"]
    assert [item.block for item in system.publishers] == ["count_feedback", "count_result"]
    ros, type_ = {1: (ROS1, "actionlib/Test"), 2: (ROS2, "test_msgs/Fibonacci")}[version]
    ends = ("count_goal", "count_cancel", "count_feedback", "count_result")
    name = MessageName(*type_.split("/"))
    assert system.actions == (Action("count", ServiceEnd.SERVER, name, ros, "count", *ends, 100.0, 100.0),)
    names = [item.name for item in (*system.subscribers, *system.publishers)]
    if version == 1:
        # Those in bags.
        assert names == ["/count/goal", "/count/cancel", "/count/feedback", "/count/result"]
        assert [item.max_length for item in system.subscribers] == [4096, 65536]
    else:
        assert names[2] == "/count/_action/feedback"
    shown = derived_description(system)["Converters"]
    assert [item.get("action") for item in shown["AXIS_to_msg"]] == ["count", "count"]


def test_the_node_has_what_ros_makes_of_an_action(tmp_path: Path) -> None:
    """The hashes are those of ROS 2 Jazzy (test_msgs/action/Fibonacci.json)."""
    found = describe(load(tmp_path, 2))
    assert not found.subscribers
    assert not found.publishers
    assert found.versions == (2,)
    (action,) = found.actions
    assert [(item.name, item.type) for item in action.services] == [
        ("count/_action/send_goal", "test_msgs/action/Fibonacci_SendGoal"),
        ("count/_action/cancel_goal", "action_msgs/srv/CancelGoal"),
        ("count/_action/get_result", "test_msgs/action/Fibonacci_GetResult"),
    ]
    assert [item.signature for item in action.services] == SIGNATURES
    states, feedback = action.publishers
    assert (states.name, states.is_transient_local, states.depth) == ("count/_action/status", True, 1)
    assert (feedback.name, feedback.type) == ("count/_action/feedback", "test_msgs/action/Fibonacci_FeedbackMessage")
    # State, padding, no elements.
    assert action.no_result == b"\0\1\0\0" + bytes(8)


@pytest.mark.parametrize("version", [1, 2])
def test_a_client_has_the_reverse_directions(tmp_path: Path, version: int) -> None:
    loaded = load(tmp_path, version, "planner")
    system = loaded.system
    assert connections(system) == [
        "order. -> planner.in0_",
        "count_feedback. -> planner.in1_",
        "count_result. -> planner.in2_",
        "planner.out0_ -> count_goal.",
        "planner.out1_ -> count_cancel.",
        "planner.out2_ -> told.",
    ]
    assert [item.block for item in system.subscribers] == ["order", "count_feedback", "count_result"]
    assert [item.block for item in system.publishers] == ["count_goal", "count_cancel", "told"]
    (action,) = system.actions
    assert (action.end, action.time_limit) == (ServiceEnd.CLIENT, 100.0)
    names = [item.name for item in (*system.subscribers[1:], *system.publishers[:2])]
    if version == 1:
        assert names == ["/count/feedback", "/count/result", "/count/goal", "/count/cancel"]
    else:
        assert names[0] == "/count/_action/feedback"
    (found,) = describe(loaded).actions
    assert not found.is_server
    assert not any(service.is_server for service in found.services)
    topics = [item.name for item in (*found.subscribers, *found.publishers)]
    ends = [name.rpartition("/")[2] for name in (*topics, *(item.name for item in found.services))]
    ros1, ros2 = ["status", "feedback", "result", "goal", "cancel"], ["send_goal", "cancel_goal", "get_result"]
    assert ends == (ros1 if version == 1 else ["status", "feedback", *ros2])


@pytest.mark.check
@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(("name", "count"), [("arm", 9), ("planner", 5)])
def test_an_action_is_simulated(
    tmp_path: Path, version: int, name: str, count: int, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Goals and a cancellation, or feedback and a result, as stimuli, compared with the model."""
    monkeypatch.chdir(folder(tmp_path, version, name))
    assert main(["system", "core", f"{name}.yaml", "--stimuli", "stimuli.yaml", "--model", "model.py"]) == 0
    assert main(["sim", f"{name}.core"]) == 0
    assert f"PASS {count}/{count}" in capsys.readouterr().out
