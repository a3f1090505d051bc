"""Layouts derived by hand from the two serialisations, and the faults of messages without a fixed size."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame, Run
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from tests.frame.oracle import parsed


def layout(ros: Middleware, text: str, others: Mapping[str, str] | None = None) -> Frame:
    """The frame of `p/M`."""
    return frame_of(parse_name("p/M"), parsed({"p/M": text, **(others or {})}, ros))


def runs(frame: Frame) -> dict[str, list[tuple[int, int]]]:
    """(offset, count) of each run, by the field's name."""
    return {".".join(leaf.names): [(run.offset, run.count) for run in leaf.runs] for leaf in frame.fields}


def test_ros1_is_packed() -> None:
    frame = layout(ROS1, "bool a\nfloat64 b\nuint16[3] c\nuint32 d\n")
    assert runs(frame) == {"a": [(0, 1)], "b": [(1, 1)], "c": [(9, 3)], "d": [(15, 1)]}
    assert (frame.prefix, frame.checked_prefix, frame.trailing_bytes) == (b"", 0, 0)
    assert (frame.payload_bytes, frame.frame_bytes) == (19, 24)


def test_ros2_is_aligned_behind_its_header() -> None:
    frame = layout(ROS2, "bool a\nfloat64 b\nuint16[3] c\nuint32 d\nuint8 e\n")
    assert runs(frame) == {"a": [(4, 1)], "b": [(12, 1)], "c": [(20, 3)], "d": [(28, 1)], "e": [(32, 1)]}
    assert (frame.prefix, frame.checked_prefix, frame.trailing_bytes) == (b"\0\1\0\0", 2, 3)
    # There is no padding after the last field.
    assert (frame.payload_bytes, frame.frame_bytes) == (33, 38)


@pytest.mark.parametrize(("kind", "size"), [("uint8", 1), ("int16", 2), ("float32", 4), ("int64", 8), ("float64", 8)])
def test_ros2_aligns_by_the_size_of_the_number(kind: str, size: int) -> None:
    frame = layout(ROS2, f"uint8 a\n{kind} b\n")
    assert runs(frame)["b"] == [(4 + size, 1)]


def test_gaps_change_from_element_to_element() -> None:
    frame = layout(ROS2, "E[3] e\n", {"p/E": "uint16 a\nuint32 b\nuint8 c\n"})
    assert runs(frame) == {
        "e.a": [(4, 1), (14, 1), (22, 1)],
        "e.b": [(8, 1), (16, 1), (24, 1)],
        "e.c": [(12, 1), (20, 1), (28, 1)],
    }


def test_runs_that_touch_are_one() -> None:
    frame = layout(ROS1, "E[3] e\nuint8[2] f\nuint8 g\n", {"p/E": "uint16[2] a\n"})
    assert [leaf.runs for leaf in frame.fields] == [(Run(0, 6),), (Run(12, 2),), (Run(14, 1),)]
    assert [leaf.count for leaf in frame.fields] == [6, 2, 1]
    assert list(frame.fields[0].offsets) == [0, 2, 4, 6, 8, 10]


def test_times_of_ros1_are_two_numbers() -> None:
    frame = layout(ROS1, "time stamp\nduration[2] spans\n")
    assert runs(frame) == {
        "stamp.sec": [(0, 1)],
        "stamp.nsec": [(4, 1)],
        "spans.sec": [(8, 1), (16, 1)],
        "spans.nsec": [(12, 1), (20, 1)],
    }
    assert [leaf.type.name for leaf in frame.fields] == ["uint32", "uint32", "int32", "int32"]


@pytest.mark.parametrize(
    ("ros", "kind", "name", "bits"),
    [
        (ROS1, "byte", "int8", 8),
        (ROS1, "char", "uint8", 8),
        (ROS2, "byte", "uint8", 8),
        (ROS2, "char", "uint8", 8),
        (ROS1, "bool", "bool", 1),
        (ROS2, "bool", "bool", 1),
    ],
)
def test_what_old_names_mean(ros: Middleware, kind: str, name: str, bits: int) -> None:
    (leaf,) = layout(ros, f"{kind} x\n").fields
    assert (leaf.type.name, leaf.type.bits, leaf.type.size) == (name, bits, 1)


@pytest.mark.parametrize(("ros", "payload", "last"), [(ROS1, 9, 1), (ROS2, 20, 12)])
def test_a_message_without_fields_is_a_byte_in_ros2_only(ros: Middleware, payload: int, last: int) -> None:
    frame = layout(ros, "E e\nuint8 a\nE[2] f\nfloat64 b\n", {"p/E": ""})
    assert frame.payload_bytes == payload
    assert runs(frame)["b"] == [(last, 1)]
    assert layout(ROS1, "").payload_bytes == 0
    assert layout(ROS2, "").payload_bytes == 5


def test_arrays_of_nothing_are_nothing() -> None:
    frame = layout(ROS1, "uint8[0] none\nuint16 a\nE[0] nobody\n", {"p/E": "uint8 x\n"})
    assert runs(frame) == {"none": [], "a": [(0, 1)]}


def test_constants_and_defaults_take_no_room() -> None:
    assert layout(ROS2, "uint8 A=3\nuint8 a 7\n").payload_bytes == 5


@pytest.mark.parametrize("kind", ["string<=5", "wstring", "uint8[<=4]", "string[2]", "E[<=2]"])
def test_a_bound_is_no_fixed_size(kind: str) -> None:
    assert not layout(ROS2, f"{kind} x\n", {"p/E": "uint8 x\n"}).is_fixed_size
    assert layout(ROS2, "E[2] x\n", {"p/E": "uint8 x\n"}).is_fixed_size
