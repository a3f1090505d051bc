"""The end of a message within a longer payload; test_every_message finds it for every kind of message."""

from __future__ import annotations

import pytest

from fusesoc_firm.frame.codec import encode, trimmed
from fusesoc_firm.message import ROS1, ROS2
from tests.frame.test_nodes import frame, standard

JOINTS = {
    "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "base"},
    "name": ["shoulder", "elbow"],
    "position": [1.0, 2.0],
    "velocity": [],
    "effort": [],
}


@pytest.mark.parametrize("more", [0, 1, 3, 4, 8, 92, 200])
def test_a_tail_is_removed(more: int) -> None:
    joints = standard(ROS2, "sensor_msgs/JointState")
    payload = encode(joints, JOINTS)
    assert trimmed(joints, payload + b"\xee" * more) == payload


def test_no_cut_changes_a_payload() -> None:
    joints = standard(ROS2, "sensor_msgs/JointState")
    payload = encode(joints, JOINTS)
    for length in range(len(payload)):
        assert trimmed(joints, payload[:length]) == payload[:length]


def test_another_encoding_and_ros_1_stay() -> None:
    for header in ("0000 0000", "0003 0000"):
        payload = bytes.fromhex(header) + bytes(200)
        assert trimmed(frame(ROS2, "uint8 x\n"), payload) == payload
    assert trimmed(frame(ROS1, "uint8 x\n"), bytes(200)) == bytes(200)


@pytest.mark.parametrize("text", ["string[] s\n", "Rows[] s\n", "float64[] s\n", "Rows[4294967295] s\n"])
def test_a_count_of_billions_takes_no_time(text: str) -> None:
    """The walk ends with the payload: without its limit, this test would not end."""
    made = frame(ROS2, text, Rows="string[] cells\n")
    payload = bytes.fromhex("00010000") + b"\xff" * 4 + b"\0" * 40
    assert trimmed(made, payload) == payload
