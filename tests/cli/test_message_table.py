"""The rows of the table of `firm sim`."""

from __future__ import annotations

from typing import Any

import pytest

from fusesoc_firm.builds.setup.simulation import Message, Report
from fusesoc_firm.cli.message_table import row, with_answers
from fusesoc_firm.cli.sim import print_messages
from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.defaults import completed
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.simulation.answers import Answer, Payload
from fusesoc_firm.system.derived.model import Topic

LIBRARY = MessageLibrary(ROS2)


def payload(block: str, type_: str, message: dict[str, Any]) -> Payload:
    name = parse_name(type_)
    frame = frame_of(name, LIBRARY.closure(name))
    return Payload(Topic(block, frame), encode(frame, completed(frame, message)).hex())


def shown(types: tuple[str, str], messages: tuple[dict[str, Any], ...], width: int = 37) -> list[str]:
    """Return the row for a message sent, the expected one and the received one, by default as expected."""
    sent, expected, *received = messages
    pair = (payload("pub", types[1], value) for value in (expected, *(received or [expected])))
    answer = Answer("pub", 0, payload("sub", types[0], sent), *pair)
    return row(Message(0, "sub", ["pub"]), [answer], width)


IMU = ("sensor_msgs/Imu", "geometry_msgs/Vector3Stamped")
TWIST = ("geometry_msgs/TwistStamped", "geometry_msgs/TwistStamped")


def twist(x: float, z: float) -> dict[str, Any]:
    return {"header": {"frame_id": "base"}, "twist": {"linear": {"x": x, "y": 2.5}, "angular": {"z": z}}}


@pytest.mark.parametrize(
    ("types", "messages", "texts"),
    [
        # A copied header and zeros, also in arrays, are left out.
        (
            IMU,
            ({"linear_acceleration": {"y": 9.5}, "orientation": {"w": 0.0}}, {"vector": {"y": -9.5}}),
            ["sub linear_acceleration.y=9.5", "pub vector.y=-9.5 vector.x=0.0 vec..."],
        ),
        # A truth value is none of them.
        (
            ("sensor_msgs/BatteryState", "geometry_msgs/Vector3"),
            ({"voltage": 12.5, "present": False}, {"x": 1.0}),
            ["sub voltage=12.5 present=False", "pub x=1.0 y=0.0 z=0.0"],
        ),
        # Of two changed fields, the cut one leaves dots.
        (
            TWIST,
            (twist(3.0, 2.0), twist(1.0, 0.0)),
            ["sub twist.linear.x=3.0 twist.angul...", "pub twist.linear.x=1.0 twist.angul..."],
        ),
        # The wrong field is the first, and the received value follows it.
        (
            TWIST,
            (twist(3.0, 2.0), twist(1.0, 1.0), twist(1.0, 2.0)),
            ["sub twist.angular.z=2.0 twist.line...", "pub twist.angular.z=1.0 (got 2.0) ..."],
        ),
        # A wrong field that should be copied.
        (
            TWIST,
            (twist(1.0, 0.0), twist(1.0, 0.0), twist(1.0, 2.0)),
            ["sub twist.angular.z=0.0", "pub twist.angular.z=0.0 (got 2.0)"],
        ),
        # If everything is copied, only zeros that were sent are left out.
        (
            TWIST,
            (twist(0.0, 0.0), twist(0.0, 0.0)),
            ['sub header.frame_id="base" twist.l...', 'pub header.frame_id="base" twist.l...'],
        ),
    ],
)  # fmt: skip
def test_a_long_row(types: tuple[str, str], messages: tuple[dict[str, Any], ...], texts: list[str]) -> None:
    assert shown(types, messages) == texts


def test_a_short_row_is_complete() -> None:
    point = ("geometry_msgs/Point", "geometry_msgs/Point")
    texts = shown(point, ({"x": 1.0}, {"x": 1.0}, {"x": 1.0, "y": 2.0}), 45)
    assert texts == ["sub x=1.0 y=0.0 z=0.0", "pub x=1.0 y=0.0 (got 2.0) z=0.0"]


def test_without_frames_a_row_has_the_labels_of_the_report() -> None:
    message = Message(0, "sub x=1.0 y=2.0", ["pub x=1.0"])
    ((_, answers),) = with_answers([message], [])
    assert row(message, answers, 12) == ["sub x=1.0...", "pub x=1.0"]
    assert row(Message(0, "sub"), [], 12) == ["sub", "-"]


def test_answers_belong_to_the_messages_in_the_same_order() -> None:
    part = payload("pub", "geometry_msgs/Point", {})
    answers = [Answer(f"pub geometry_msgs/Point x={number}", number, part, part, part) for number in range(3)]
    messages = [
        Message(0, "sub", ["pub x=0", "pub x=1"]),
        Message(1, "sub", ["pub x=2"]),
        Message(2, "sub", ["pub x=3"]),
    ]
    assert [len(own) for _, own in with_answers(messages, answers)] == [2, 1, 0]


def test_unknown_cycles_are_blank(capsys: pytest.CaptureFixture[str]) -> None:
    """A response that came before its message has none."""
    early, usual = Message(7, "sub a", ["pub x=1"], is_wrong=True), Message(8, "sub b", ["pub x=2"], 30, -4)
    print_messages(Report(messages=[early, usual]), [], {}, "sim.log")
    _, first, second = (line.split() for line in capsys.readouterr().out.splitlines())
    assert first == ["!7", "sub", "a", "pub", "x=1"]
    assert second == ["8", "30", "-4", "sub", "b", "pub", "x=2"]
