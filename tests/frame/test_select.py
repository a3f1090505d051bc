"""Selection of used fields by dotted paths."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.model import Data, Fixed, Frame, Loop, Pad, all_nodes
from fusesoc_firm.frame.select import select
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.text.diagnostics import InputError, SourceRef
from tests.frame.test_codec_of_any_message import image
from tests.frame.test_nodes import frame, outline, standard


def used(made: Frame) -> list[str]:
    found = []
    for node in all_nodes(made.nodes):
        if not isinstance(node, Pad):
            leaves = node.fields if isinstance(node, Fixed) else (node,)
            found += [".".join(leaf.names) for leaf in leaves if leaf.is_used]
    return found


@pytest.mark.parametrize(
    ("include", "exclude", "expected"),
    [
        ("height width", "", "height width"),
        ("header", "", "header.stamp.sec header.stamp.nanosec header.frame_id"),
        ("header", "header.stamp", "header.frame_id"),
        ("header.stamp.sec", "", "header.stamp.sec"),
        ("", "header encoding is_bigendian step", "height width data"),
        ("data", "data", ""),
    ],
)
def test_paths(include: str, exclude: str, expected: str) -> None:
    made = select(standard(ROS2, "sensor_msgs/Image"), dict.fromkeys(include.split()), dict.fromkeys(exclude.split()))
    assert used(made) == expected.split()


def test_all_is_used_unless_something_is_said() -> None:
    made = standard(ROS2, "sensor_msgs/Image")
    assert select(made) == made


def test_a_name_is_not_its_beginning() -> None:
    made = frame(ROS1, "uint8 a\nuint8 ab\n")
    assert used(select(made, {"a": None})) == ["a"]


@pytest.mark.parametrize(
    ("include", "exclude", "expected"),
    [
        ("poses.position.x", "", "poses poses.position.x"),
        ("header", "", "header.seq header.stamp.sec header.stamp.nsec header.frame_id"),
        ("poses", "poses.position poses.orientation", ""),
    ],
)
def test_a_loop_is_used_if_anything_in_it_is(include: str, exclude: str, expected: str) -> None:
    made = standard(ROS1, "geometry_msgs/PoseArray")
    assert used(select(made, dict.fromkeys(include.split()), dict.fromkeys(exclude.split()))) == expected.split()


def test_the_number_of_empty_messages_can_be_used() -> None:
    made = frame(ROS1, "Nothing[] a\nuint8 b\n", Nothing="")
    assert used(select(made, {"a": None})) == ["a"]
    assert used(select(made, {"b": None})) == ["b"]


def test_the_wire_stays_as_it_is() -> None:
    made = standard(ROS2, "sensor_msgs/Image")
    chosen = select(made, {"data": None})
    assert outline(chosen.nodes) == outline(made.nodes)
    value = image(ROS2, b"abc")
    assert encode(chosen, value) == encode(made, value)


def test_unknown_paths_are_told_where_they_stand_with_the_nearest() -> None:
    made = standard(ROS2, "sensor_msgs/Image")
    place = SourceRef("robot.yaml", 7, 3)
    with pytest.raises(InputError) as caught:
        select(made, {"heigth": place, "width": place}, {"header.stamp.secs": replace(place, line=8)})
    first, second = map(str, caught.value.diagnostics)
    assert first.startswith("robot.yaml:7:3: error: sensor_msgs/Image has no field 'heigth'")
    assert "did you mean 'height'?" in first
    assert second.startswith("robot.yaml:8:3: ")
    assert "did you mean 'header.stamp.sec'?" in second


def test_parts_know_where_they_are_defined() -> None:
    made = frame(ROS2, "uint8 a\nstring s\nText[] t\n", Text="string x\n")
    lines = [node.source.line for node in all_nodes(made.nodes) if isinstance(node, Data | Loop) and node.source]
    assert lines == [2, 3, 1]
