"""Readable forms of a Frame: plain data and a tree."""

from __future__ import annotations

import yaml

from fusesoc_firm.frame.description import description
from fusesoc_firm.frame.tree import Row, rows
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from tests.frame.test_nodes import frame, standard


def test_a_message_of_variable_size_as_data() -> None:
    made = frame(ROS2, "uint8 x\nfloat64[<=3] a\nCell[2] b\n", Cell="string<=4 s\nuint8[2] c\n")
    assert yaml.safe_load(yaml.safe_dump(description(made))) == {
        "message": "layout_msgs/Main",
        "ros": 2,
        "prefix": "00010000",
        "trailing_bytes": 3,
        "payload_bytes": {"minimum": 27, "maximum": 59, "from": "counts and what loops hold"},
        "nodes": [
            {"fixed": 8, "fields": [{"path": "x", "type": "uint8", "runs": [{"offset": 4, "count": 1}]}]},
            {"data": "a", "type": "float64[<=3]", "element_bytes": 8, "bound": 3},
            {
                "loop": "b",
                "type": "layout_msgs/Cell[2]",
                "count": 2,
                "nodes": [
                    {"pad": 4},
                    {"data": "b.s", "type": "string<=4", "element_bytes": 1, "bound": 4},
                    {
                        "fixed": 2,
                        "fields": [{"path": "b.c", "type": "uint8", "count": 2, "runs": [{"offset": 0, "count": 2}]}],
                    },
                ],
            },
        ],
    }


def test_a_message_of_fixed_size_as_data() -> None:
    assert description(standard(ROS2, "geometry_msgs/Point"))["payload_bytes"] == 28


def test_padding_at_run_time_is_told() -> None:
    nodes = description(frame(ROS2, "string s\nfloat64[] a\n"))["nodes"]
    assert nodes[-1] == {"data": "a", "type": "float64[]", "element_bytes": 8, "padding": "at run time"}


def tree(ros: Middleware, name: str) -> dict[str, Row]:
    definitions = MessageLibrary(ros).closure(parse_name(name))
    return {row.name: row for row in rows(parse_name(name), definitions, standard(ros, name))}


def test_only_what_lies_in_front_of_all_that_varies_has_an_offset() -> None:
    found = tree(ROS2, "sensor_msgs/Image")
    assert (found["sec"].bits, found["sec"].offset) == (32, 4)
    assert (found["stamp"].bits, found["stamp"].offset) == (64, 4)
    assert (found["header"].bits, found["header"].offset) == (None, 4)
    assert (found["frame_id"].bits, found["frame_id"].offset) == (None, None)
    assert (found["height"].bits, found["height"].offset) == (32, None)


def test_bits_in_a_loop_are_those_of_one_element() -> None:
    found = tree(ROS2, "geometry_msgs/PoseArray")
    assert (found["position"].bits, found["position"].offset) == (192, None)
    assert found["poses"].bits is None
