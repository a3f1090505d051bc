"""Stimuli out of recorded bags, which the tests write with rosbags."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_typestore

from fusesoc_firm.diagnostics import InputError
from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.host.stimuli import Stimulus, read_stimuli
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import RosVersion
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.derived import Converter

KINDS = ("ros1", "sqlite3", "mcap")
POINT, VECTOR, STRING = "geometry_msgs/msg/Point", "geometry_msgs/msg/Vector3", "std_msgs/msg/String"

# Topic, type, x, and when it was recorded, in ns.
Recording = tuple[str, str, float, int]


def version(kind: str) -> RosVersion:
    return RosVersion.ROS1 if kind == "ros1" else RosVersion.ROS2


def subscriber(block: str, message: str, ros: RosVersion, number: int = 0, topic: str = "") -> Converter:
    name = parse_name(message)
    return Converter(block, frame_of(name, MessageLibrary(ros).closure(name)), number, given_name=topic)


def write(folder: Path, kind: str, recordings: Iterable[Recording]) -> Path:
    """A bag of messages with x set and all else zero; of a string, 'x'."""
    path = folder / ("recorded.bag" if kind == "ros1" else "recorded")
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_JAZZY)
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer = Rosbag1Writer(path) if kind == "ros1" else Rosbag2Writer(path, version=9, storage_plugin=plugin)
    with writer:
        connections = {}
        for topic, message, x, time in recordings:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message, typestore=store)
            value = store.types[message]("x") if message == STRING else store.types[message](x=x, y=0.0, z=0.0)
            serialise = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
            writer.write(connections[topic], time, bytes(serialise(value, message)))
    return path


def x_values(stimuli: Iterable[Stimulus]) -> list[tuple[str, float]]:
    return [(item.subscriber.block, item.message["x"]) for item in stimuli]


@pytest.mark.parametrize("kind", KINDS)
def test_messages_go_by_topic_or_type_in_order_of_time(tmp_path: Path, kind: str) -> None:
    recordings = [
        ("/arm/left", POINT, 1.0, 30),
        ("/arm/right", POINT, 2.0, 10),
        ("/whatever", VECTOR, 3.0, 20),
        ("/chatter", STRING, 0.0, 15),
        ("/arm/left", POINT, 4.0, 40),
    ]
    ros = version(kind)
    subscribers = [
        subscriber("arm_left", "geometry_msgs/Point", ros, 0, "/arm/left"),
        subscriber("arm_right", "geometry_msgs/Point", ros, 1, "/arm/right"),
        subscriber("wind", "geometry_msgs/Vector3", ros, 2),
    ]
    found = read_stimuli(write(tmp_path, kind, recordings), subscribers)
    assert x_values(found) == [("arm_right", 2.0), ("wind", 3.0), ("arm_left", 1.0), ("arm_left", 4.0)]
    assert all(item.payload == encode(item.subscriber.frame, item.message) for item in found)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("kept", [0.1, 0.5, 0.9])
def test_a_damaged_bag(tmp_path: Path, kind: str, kept: float) -> None:
    path = write(tmp_path, kind, [("/p", POINT, float(number), number) for number in range(100)])
    file = path if kind == "ros1" else next(path.glob("*.mcap" if kind == "mcap" else "*.db3"))
    data = file.read_bytes()
    file.write_bytes(data[: int(len(data) * kept)])
    with pytest.raises(InputError, match="is not a bag that can be read"):
        read_stimuli(path, [subscriber("p", "geometry_msgs/Point", version(kind))])


@pytest.mark.parametrize(("kind", "ros"), [("ros1", RosVersion.ROS2), ("mcap", RosVersion.ROS1)])
def test_a_bag_of_the_other_version(tmp_path: Path, kind: str, ros: RosVersion) -> None:
    path = write(tmp_path, kind, [("/p", POINT, 1.0, 0), ("/q", POINT, 1.0, 0)])
    with pytest.raises(InputError) as raised:
        read_stimuli(path, [subscriber("p", "geometry_msgs/Point", ros)])
    assert str(raised.value).splitlines() == [
        f"error: topic /{topic} of {path} is of ROS {version(kind)}, but 'p' speaks ROS {ros}" for topic in "pq"
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_a_topic_that_could_go_to_two(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, [("/left", POINT, 1.0, 0), ("/middle", POINT, 1.0, 0)])
    subscribers = [subscriber(name, "geometry_msgs/Point", version(kind)) for name in ("left", "right")]
    with pytest.raises(InputError) as raised:
        read_stimuli(path, subscribers)
    assert str(raised.value) == (
        f"error: topic /middle of {path} could go to left, right\n"
        "      = name the topic like one of them, or give one the key 'topic'"
    )


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_without_a_message_for_anybody(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, [("/chatter", STRING, 0.0, 0)])
    with pytest.raises(InputError, match="holds no message for p"):
        read_stimuli(path, [subscriber("p", "geometry_msgs/Point", version(kind))])


@pytest.mark.parametrize("name", ["notes.txt", "broken.bag", "broken.mcap", "broken.db3"])
def test_what_is_no_bag(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"This is no bag, whatever it is called.\n" * 10)
    with pytest.raises(InputError, match=r"is not a bag that can be read: .*\n +=? .*YAML"):
        read_stimuli(tmp_path / name, [subscriber("p", "geometry_msgs/Point", RosVersion.ROS1)])


def test_a_folder_that_is_no_bag(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a bag that can be read"):
        read_stimuli(tmp_path, [subscriber("p", "geometry_msgs/Point", RosVersion.ROS1)])
