"""The stimuli of new projects: every string and array is longer than a beat in one message, and all elements differ."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from fusesoc_firm.frame.codec import decode, encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Data, DataKind, Frame, Loop, all_nodes
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.scaffold.first_stimuli import first_stimuli

MESSAGES = ("sensor_msgs/JointState", "sensor_msgs/Imu", "visualization_msgs/MarkerArray", "sensor_msgs/PointCloud2")


def messages_of(name: str, ros: Middleware, width: int) -> tuple[Frame, list[dict[str, Any]]]:
    frame = frame_of(parse_name(name), MessageLibrary(ros).closure(parse_name(name)))
    return frame, [item["sub"] for item in yaml.safe_load(first_stimuli("sub", frame, width))]


def values(message: Any, names: tuple[str, ...]) -> list[Any]:
    """All values at the end of a path, one for each element of the arrays on it."""
    if not names:
        return [message]
    items = message if isinstance(message, list) else [message]
    return [value for item in items for value in values(item[names[0]], names[1:])]


@pytest.mark.parametrize("width", [8, 128, 512])
@pytest.mark.parametrize("ros", [ROS1, ROS2], ids=["ros1", "ros2"])
@pytest.mark.parametrize("name", MESSAGES)
def test_one_message_has_long_parts_only(name: str, ros: Middleware, width: int) -> None:
    frame, messages = messages_of(name, ros, width)
    assert len(messages) == 3
    for message in messages:
        again = decode(frame, encode(frame, message))
        assert encode(frame, again) == encode(frame, message)
    for node in all_nodes(frame.nodes):
        if isinstance(node, Data):
            found = [value for item in values(messages[1], node.names) for value in _parts(item, node)]
            assert found
            assert all(len(value) * node.element.size > max(16, width // 8) for value in found), node.names
        elif isinstance(node, Loop):
            assert all(len(value) > 1 for value in values(messages[1], node.names)), node.names
            assert all(len(value) == 1 for value in values(messages[0], node.names)), node.names


def _parts(value: Any, node: Data) -> list[Any]:
    """The texts in an array of texts, or the only text or array of numbers."""
    return value if node.kind is not DataKind.ARRAY and isinstance(value, list) else [value]


def test_the_elements_of_an_array_differ() -> None:
    _, messages = messages_of("sensor_msgs/Imu", ROS2, 64)
    for message in messages:
        assert len(set(message["orientation_covariance"])) == 9
