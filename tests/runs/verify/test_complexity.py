"""Levels, fields, types and depth, counted by hand."""

from __future__ import annotations

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.runs.verify.complexity import Level, Statistics, statistics
from tests.runs.verify.messages import own, standard

S, E, A, V = Level.SIMPLE, Level.EXPANDING, Level.ARRAYS, Level.VARIABLE_SUBMESSAGES


@pytest.mark.parametrize(
    ("ros", "name", "expected"),
    [
        (ROS1, "std_msgs/Empty", Statistics(S, 0, 0, 1)),
        # x, y, z, w: all float64.
        (ROS1, "geometry_msgs/Quaternion", Statistics(S, 4, 1, 1)),
        # Point (3) and Quaternion (4); float64, Point, Quaternion.
        (ROS2, "geometry_msgs/Pose", Statistics(E, 7, 3, 2)),
        # The covariance counts once; a third level of messages; one type more.
        (ROS2, "geometry_msgs/PoseWithCovariance", Statistics(E, 8, 4, 3)),
        # seq, stamp, frame_id: uint32, time, string.
        (ROS1, "std_msgs/Header", Statistics(A, 3, 3, 1)),
        # sec, nanosec, frame_id; Time, int32, uint32, string.
        (ROS2, "std_msgs/Header", Statistics(A, 3, 4, 2)),
        # Header (3), height, width, encoding, is_bigendian, step, data; uint8 is new.
        (ROS1, "sensor_msgs/Image", Statistics(A, 9, 5, 2)),
        # Header (3) and seven of each pose; Header, uint32, time, string, Pose, Point, Quaternion, float64.
        (ROS1, "geometry_msgs/PoseArray", Statistics(V, 10, 8, 3)),
        # Header (3), name, position, velocity, effort; an array of strings is of the highest level.
        (ROS1, "sensor_msgs/JointState", Statistics(V, 7, 5, 2)),
    ],
)
def test_messages_of_distributions(ros: Middleware, name: str, expected: Statistics) -> None:
    assert statistics(*standard(ros, name)) == expected


@pytest.mark.parametrize(
    ("fields", "level"),
    [
        ("bool b\nfloat32 f\n", S),
        ("uint8[3] a\n", E),
        ("Cell c\n", E),
        ("Cell[3] c\n", E),
        ("string s\n", A),
        ("string<=5 s\n", A),
        ("wstring s\n", A),
        ("float64[] a\n", A),
        ("float64[<=4] a\n", A),
        ("Text[2] t\n", A),
        ("string[2] s\n", V),
        ("string[] s\n", V),
        ("Cell[] c\n", V),
        ("Cell[<=2] c\n", V),
        ("Many[2] m\n", V),
    ],
)
def test_the_level_is_that_of_the_most_complex_field(fields: str, level: Level) -> None:
    texts = {"Cell": "int8 a\n", "Text": "string s\n", "Many": "Cell[] c\n", "Outer": f"bool before\n{fields}"}
    assert statistics(*own(ROS2, texts)).level is level


def test_a_bound_makes_no_type() -> None:
    assert statistics(*own(ROS2, {"M": "string a\nstring<=3 b\nstring<=4[] c\nint8[2] d\nint8 e\n"})).types == 2
