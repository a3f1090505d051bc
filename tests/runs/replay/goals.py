"""Bags with the goals of the action in tests/ros/arm, as rosbags writes them, for both versions of ROS."""

from __future__ import annotations

import shutil
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import get_types_from_idl

from tests.ros.action_simulator import HERE, in_ros2
from tests.runs.replay.replays import read, store_of, write

# The states of results, for each version of ROS.
SUCCEEDED, CANCELED, REJECTED = {1: 3, 2: 4}, {1: 2, 2: 5}, {1: 5, 2: 0}
RECALLED = {1: 8, 2: 5}
# The values of event_type of a client and of a server.
CLIENT, SERVER = (0, 3), (1, 2)

# rosidl writes them beside its interfaces; rosbags computes others for messages with bounded arrays.
HASHES = {
    f"{name}_Event": f"RIHS01_{digits}"
    for name, digits in (
        ("test_msgs/action/Fibonacci_SendGoal", "a20e708c6aae7a99d1eb0e930a0916f596bb5bae93a342a61752e13135be2c44"),
        ("test_msgs/action/Fibonacci_GetResult", "fe0aa5843ef10550a9b322aeeccd5b11e78bca05b3571cf6999c51bff30c1e23"),
        ("action_msgs/srv/CancelGoal", "178f81615ce6be41ad328211d7a56b08b00e73f41f0b8aec256b2f3ff97a5e7e"),
    )
}
_FIBONACCI = "test_msgs/action/Fibonacci"
_IDL = """
module test_msgs { module action {
  struct Fibonacci_Goal { int32 order; };
  struct Fibonacci_Result { sequence<int32> sequence; };
  struct Fibonacci_Feedback { sequence<int32> sequence; };
  struct Fibonacci_SendGoal_Request {
    unique_identifier_msgs::msg::UUID goal_id;
    test_msgs::action::Fibonacci_Goal goal;
  };
  struct Fibonacci_SendGoal_Response { boolean accepted; builtin_interfaces::msg::Time stamp; };
  struct Fibonacci_GetResult_Request { unique_identifier_msgs::msg::UUID goal_id; };
  struct Fibonacci_GetResult_Response { int8 status; test_msgs::action::Fibonacci_Result result; };
  struct Fibonacci_FeedbackMessage {
    unique_identifier_msgs::msg::UUID goal_id;
    test_msgs::action::Fibonacci_Feedback feedback;
  };
"""
_EVENT = """
  struct {0}_Event {{
    service_msgs::msg::ServiceEventInfo info;
    sequence<{1}::{0}_Request, 1> request;
    sequence<{1}::{0}_Response, 1> response;
  }};
"""
_CANCEL_IDL = """
module action_msgs { module srv {
  struct CancelGoal_Request { action_msgs::msg::GoalInfo goal_info; };
  struct CancelGoal_Response { int8 return_code; sequence<action_msgs::msg::GoalInfo> goals_canceling; };
"""


class Goals:
    """A recording of goals, whose ids are numbers; each message is 1 ms later than the one before."""

    def __init__(self, version: int, name: str = "/count") -> None:
        self.version, self.name = version, name
        self.store = store_of("ros1" if version == 1 else "mcap")
        self.items: list[tuple[str, str, int, bytes]] = []
        self._stamps = (10**18 + 10**6 * number for number in count())
        self._calls = count()
        if version == 2:
            events = "".join(
                _EVENT.format(f"Fibonacci_{end}", "test_msgs::action") for end in ("SendGoal", "GetResult")
            )
            self.store.register(get_types_from_idl(f"{_IDL}{events}}}; }};"))
            event = _EVENT.format("CancelGoal", "action_msgs::srv")
            self.store.register(get_types_from_idl(f"{_CANCEL_IDL}{event}}}; }};"))

    def goal(self, goal: int, value: int, *, is_accepted: bool = True) -> None:
        """Record a goal."""
        if self.version == 1:
            message = self._made("actionlib/msg/TestGoal", value)
            self._add("goal", "actionlib/msg/TestActionGoal", self._header(), self._id(goal), message)
            return
        response = self._made(f"{_FIBONACCI}_SendGoal_Response", is_accepted, self._time(1))
        self._call("send_goal", f"{_FIBONACCI}_SendGoal", self._request(goal, value), response)

    def _request(self, goal: int, value: int) -> Any:
        return self._made(f"{_FIBONACCI}_SendGoal_Request", self._id(goal), self._made(f"{_FIBONACCI}_Goal", value))

    def payload(self, goal: int, value: int) -> bytes:
        """The message of a goal."""
        if self.version == 2:
            return bytes(self._serialise(self._request(goal, value), f"{_FIBONACCI}_SendGoal_Request"))
        self.goal(goal, value)
        return self.items.pop()[3]

    def id_in(self, kind: str, payload: bytes) -> int:
        """The goal to which feedback or a result of ROS 1 belongs."""
        message: Any = (
            self.store.deserialize_ros1(payload, f"actionlib/msg/TestAction{kind}")
            if self.version == 1
            else self.store.deserialize_cdr(payload, f"{_FIBONACCI}_{kind}Message")
        )
        return int(message.status.goal_id.id.removeprefix("client-") if self.version == 1 else message.goal_id.uuid[0])

    def cancel(self, goal: int) -> None:
        """Record the cancellation of a goal."""
        if self.version == 1:
            self._add("cancel", "actionlib_msgs/msg/GoalID", self._time(0), self._name(goal))
            return
        kind = "action_msgs/srv/CancelGoal"
        info = self._made("action_msgs/msg/GoalInfo", self._id(goal), self._time(0))
        self._call("cancel_goal", kind, self._made(f"{kind}_Request", info), self._made(f"{kind}_Response", 0, [info]))

    def feedback(self, goal: int, value: int) -> None:
        """Record feedback."""
        if self.version == 1:
            message = self._made("actionlib/msg/TestFeedback", value)
            self._add("feedback", "actionlib/msg/TestActionFeedback", self._header(), self._status(goal, 1), message)
            return
        message = self._made(f"{_FIBONACCI}_Feedback", np.array([value], np.int32))
        self._add("_action/feedback", f"{_FIBONACCI}_FeedbackMessage", self._id(goal), message)

    def result(self, goal: int, state: int, value: int | None) -> None:
        """Record a result, or one without contents."""
        if self.version == 1:
            message = self._made("actionlib/msg/TestResult", value or 0)
            self._add("result", "actionlib/msg/TestActionResult", self._header(), self._status(goal, state), message)
            return
        request = self._made(f"{_FIBONACCI}_GetResult_Request", self._id(goal))
        message = self._made(f"{_FIBONACCI}_Result", np.array([] if value is None else [value], np.int32))
        response = self._made(f"{_FIBONACCI}_GetResult_Response", state, message)
        self._call("get_result", f"{_FIBONACCI}_GetResult", request, response)

    def states(self) -> None:
        """Record a message with the states of no goals."""
        if self.version == 1:
            self._add("status", "actionlib_msgs/msg/GoalStatusArray", self._header(), [])
        else:
            self._add("_action/status", "action_msgs/msg/GoalStatusArray", [])

    def order(self, value: int) -> None:
        """Record an order to the hardware of tests/ros/planner."""
        kind = "std_msgs/msg/UInt32"
        payload = bytes(self._serialise(self._made(kind, value), kind))
        self.items.append(("/order", kind, next(self._stamps), payload))

    def damage(self) -> None:
        """Cut off the last byte of the message recorded last."""
        topic, kind, stamp, payload = self.items[-1]
        self.items[-1] = topic, kind, stamp, payload[:-1]

    def write(self, folder: Path) -> Path:
        """Write the bag."""
        if self.version == 1:
            return write(folder / "in.bag", "ros1", self.items)
        path = folder / "in"
        with Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            made: dict[str, Any] = {}
            for topic, kind, stamp, payload in self.items:
                if topic not in made:
                    signature = HASHES.get(kind) or self.store.hash_rihs01(kind)
                    made[topic] = writer.add_connection(topic, kind, msgdef="", rihs01=signature)
                writer.write(made[topic], stamp, payload)
        return path

    def told(self, path: Path) -> list[tuple[str, int]]:
        """What the hardware has sent, from the bag of a replay: each feedback, and each result."""
        found = []
        for topic, kind, _, payload in read(path):
            message: Any = (
                self.store.deserialize_ros1(payload, kind.replace("/action/", "/msg/"))
                if self.version == 1
                else self.store.deserialize_cdr(payload, kind)
            )
            part = message.feedback if hasattr(message, "feedback") else message.result
            word = "feedback" if hasattr(message, "feedback") else "result"
            value = getattr(part, word) if self.version == 1 else part.sequence[0]
            assert topic.endswith(word), topic
            found.append((word, int(value)))
        return found

    def _call(self, service: str, kind: str, request: Any, response: Any) -> None:
        """Add the events of a call at both ends, which number it differently."""
        call = next(self._calls)
        for end, values in ((7, CLIENT), (9, SERVER)):
            for event_type, parts in zip(values, (([request], []), ([], [response])), strict=True):
                info = self._made(
                    "service_msgs/msg/ServiceEventInfo",
                    event_type,
                    self._time(call),
                    np.full(16, end, np.uint8),
                    call * end,
                )
                self._add(f"_action/{service}/_service_event", f"{kind}_Event", info, *parts)

    def _add(self, ending: str, kind: str, *values: Any) -> None:
        payload = bytes(self._serialise(self._made(kind, *values), kind))
        self.items.append((f"{self.name}/{ending}", kind, next(self._stamps), payload))

    def _serialise(self, message: Any, kind: str) -> Any:
        return (self.store.serialize_ros1 if self.version == 1 else self.store.serialize_cdr)(message, kind)

    def _made(self, kind: str, *values: Any) -> Any:
        return self.store.types[kind](*values)

    def _time(self, second: int) -> Any:
        return self._made("builtin_interfaces/msg/Time", second, 0)

    def _header(self) -> Any:
        return self._made("std_msgs/msg/Header", len(self.items), self._time(len(self.items)), "recorder")

    def _name(self, goal: int) -> str:
        return f"client-{goal}"

    def _id(self, goal: int) -> Any:
        if self.version == 1:
            return self._made("actionlib_msgs/msg/GoalID", self._time(goal), self._name(goal))
        return self._made("unique_identifier_msgs/msg/UUID", np.full(16, goal, np.uint8))

    def _status(self, goal: int, state: int) -> Any:
        return self._made("actionlib_msgs/msg/GoalStatus", self._id(goal), state, "told by the server")


def what_is_told(path: Path) -> list[tuple[int, int, int]]:
    """What the hardware of tests/ros/planner has told, in the bag of a replay: an order, a kind and a number each."""
    values = (int.from_bytes(payload[-8:], "little") for topic, _, _, payload in read(path) if topic == "/told")
    return [(value >> 40, value >> 32 & 0xFF, value & 0xFFFFFFFF) for value in values]


def arm(folder: Path, version: int) -> Path:
    """The system of tests/ros/arm for a version of ROS."""
    return system("arm", folder, version)


def planner(folder: Path, version: int) -> Path:
    """The system of tests/ros/planner for a version of ROS."""
    shutil.copytree(HERE / "arm", folder / "arm")
    return system("planner", folder, version)


def arm_and_planner(folder: Path, version: int, topic: str) -> Path:
    """Both systems in one; the action of the planner, `asked`, has a topic."""
    spec = planner(folder, version)
    text = spec.read_text(encoding="utf-8").replace("name: count", "name: asked")
    both = yaml.safe_load(text.replace("mode: client", f"mode: client\n    topic: {topic}"))
    arm_text = (folder / "arm/arm.yaml").read_text(encoding="utf-8")
    other = yaml.safe_load(in_ros2(arm_text) if version == 2 else arm_text)
    for accelerator in other["accelerators"]:
        accelerator["sources"] = [f"../arm/{name}" for name in accelerator["sources"]]
    for key in ("accelerators", "blocks"):
        both[key] += other[key]
    spec.write_text(yaml.safe_dump(both), encoding="utf-8")
    return spec


def system(name: str, folder: Path, version: int) -> Path:
    """A system of tests/ros for a version of ROS."""
    shutil.copytree(HERE / name, folder / name)
    spec = folder / f"{name}/{name}.yaml"
    text = spec.read_text(encoding="utf-8")
    spec.write_text(in_ros2(text) if version == 2 else text, encoding="utf-8")
    return spec
