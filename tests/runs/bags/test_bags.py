"""Stimuli from recorded bags, which the tests write with rosbags."""

from __future__ import annotations

import contextlib
import sqlite3
import tracemalloc
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_typestore

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.bag_reader import open_bag
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.runs.bags.routes import routes_of
from fusesoc_firm.runs.simulation.stimuli import Stimulus, read_stimuli
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.text.diagnostics import InputError
from tests.typestores import typestore

KINDS = ("ros1", "sqlite3", "mcap")
POINT, VECTOR, STRING = "geometry_msgs/msg/Point", "geometry_msgs/msg/Vector3", "std_msgs/msg/String"

# Topic, type, x, and the time of recording in ns.
Recording = tuple[str, str, float, int]


def version(kind: str) -> Middleware:
    return ROS1 if kind == "ros1" else ROS2


def subscriber(block: str, message: str, ros: Middleware, number: int = 0, topic: str = "") -> Converter:
    name = parse_name(message)
    return Converter(block, frame_of(name, MessageLibrary(ros).closure(name)), number, given_name=topic)


def write(folder: Path, kind: str, recordings: Iterable[Recording]) -> Path:
    """Write a bag of messages in which x is set and all else is zero; strings are 'x'."""
    path = folder / ("recorded.bag" if kind == "ros1" else "recorded")
    with open_writer(path, kind) as writer:
        fill(writer, kind, recordings)
    return path


def open_writer(path: Path, kind: str) -> Rosbag1Writer | Rosbag2Writer:
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    return Rosbag1Writer(path) if kind == "ros1" else Rosbag2Writer(path, version=9, storage_plugin=plugin)


def fill(writer: Any, kind: str, recordings: Iterable[Recording]) -> None:
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_JAZZY)
    connections = {}
    for topic, message, x, time in recordings:
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, message, typestore=store)
        value = store.types[message]("x") if message == STRING else store.types[message](x=x, y=0.0, z=0.0)
        serialise = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
        writer.write(connections[topic], time, bytes(serialise(value, message)))


def cut(path: Path, share: float) -> None:
    """Truncate the file of a bag."""
    file = path if path.is_file() else next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))
    data = file.read_bytes()
    file.write_bytes(data[: int(len(data) * share)])


def many(kind: str, count: int = 300) -> list[Recording]:
    return [("/p", POINT, float(number), number) for number in range(count)]


def read_x(path: Path, kind: str) -> list[float]:
    stimuli = read_stimuli(path, [subscriber("p", "geometry_msgs/Point", version(kind))])
    return [item.message["x"] for item in stimuli]


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


def test_a_recorded_message_that_is_too_long(tmp_path: Path) -> None:
    path = write(tmp_path, "ros1", [("/s", STRING, 0.0, 0)])
    topic = replace(subscriber("s", "std_msgs/String", ROS1), max_length=4)
    with pytest.raises(InputError, match=rf"{path}: a message has 5 bytes, but 's' accepts 4"):
        read_stimuli(path, [topic])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_damaged_bag(tmp_path: Path, kind: str, share: float) -> None:
    path = write(tmp_path, kind, many(kind, 100))
    cut(path, share)
    with pytest.raises(InputError, match="is not a readable bag"):
        read_stimuli(path, [subscriber("p", "geometry_msgs/Point", version(kind))])


@pytest.mark.parametrize("page_bytes", [4096, 65536])
@pytest.mark.parametrize("missing", [1, 100])
def test_a_database_whose_last_page_is_incomplete(tmp_path: Path, page_bytes: int, missing: int) -> None:
    """SQLite reads zeros there."""
    path = write(tmp_path, "sqlite3", many("sqlite3", 100))
    file = path / "recorded.db3"
    with contextlib.closing(sqlite3.connect(file)) as database:
        database.execute(f"pragma page_size={page_bytes}")
        database.execute("vacuum")
    assert read_x(path, "sqlite3") == list(range(100))
    size = file.stat().st_size
    cut(path, 1 - missing / size)
    left = file.stat().st_size
    for bag in (path, file):
        with pytest.raises(
            InputError, match=rf"cut off: it has {left} of {size} bytes\n.*sqlite3 .*recorded\.db3 \.recover"
        ):
            read_x(bag, "sqlite3")


@pytest.mark.parametrize(("kind", "ros"), [("ros1", ROS2), ("mcap", ROS1)])
def test_a_bag_of_the_other_version(tmp_path: Path, kind: str, ros: Middleware) -> None:
    path = write(tmp_path, kind, [("/p", POINT, 1.0, 0), ("/q", POINT, 1.0, 0)])
    with pytest.raises(InputError) as raised:
        read_stimuli(path, [subscriber("p", "geometry_msgs/Point", ros)])
    assert str(raised.value).splitlines() == [
        f"error: topic /{topic} in {path} uses {version(kind).title}, but 'p' uses {ros.title}" for topic in "pq"
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_a_topic_that_could_go_to_two(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, [("/left", POINT, 1.0, 0), ("/middle", POINT, 1.0, 0)])
    subscribers = [subscriber(name, "geometry_msgs/Point", version(kind)) for name in ("left", "right")]
    with pytest.raises(InputError) as raised:
        read_stimuli(path, subscribers)
    assert str(raised.value) == (
        f"error: topic /middle in {path} could go to several blocks: left, right\n"
        "      = give the topic the name of one of these blocks, or add the key 'topic' to one of them"
    )


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_without_a_message_for_anybody(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, [("/chatter", STRING, 0.0, 0)])
    with pytest.raises(InputError, match="contains no message for p"):
        read_stimuli(path, [subscriber("p", "geometry_msgs/Point", version(kind))])


@pytest.mark.parametrize("name", ["notes.txt", "broken.bag", "broken.mcap", "broken.db3"])
def test_what_is_no_bag(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"This is no bag, whatever it is called.\n" * 10)
    with pytest.raises(InputError, match=r"is not a readable bag: .*\n +=? .*YAML"):
        read_stimuli(tmp_path / name, [subscriber("p", "geometry_msgs/Point", ROS1)])


def test_a_folder_that_is_no_bag(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a readable bag"):
        read_stimuli(tmp_path, [subscriber("p", "geometry_msgs/Point", ROS1)])


# --- bags as recorders leave them ------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", Rosbag1Writer.CompressionFormat)
def test_a_compressed_bag_of_ros1(tmp_path: Path, form: Rosbag1Writer.CompressionFormat) -> None:
    writer = Rosbag1Writer(tmp_path / "a.bag")
    writer.set_compression(form)
    with writer:
        fill(writer, "ros1", many("ros1"))
    assert read_x(tmp_path / "a.bag", "ros1") == list(range(300))


@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        ("sqlite3", CompressionMode.FILE),
        ("sqlite3", CompressionMode.MESSAGE),
        ("mcap", CompressionMode.FILE),
        ("mcap", CompressionMode.STORAGE),
    ],
)
def test_a_compressed_bag_of_ros2(tmp_path: Path, kind: str, mode: CompressionMode) -> None:
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer = Rosbag2Writer(tmp_path / "a", version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        fill(writer, kind, many(kind))
    assert read_x(tmp_path / "a", kind) == list(range(300))


@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_a_folder_without_metadata(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, many(kind, 10))
    (path / "metadata.yaml").unlink()
    assert read_x(path, kind) == list(range(10))
    (file,) = path.iterdir()
    assert read_x(file, kind) == list(range(10))


@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_a_folder_of_many_files_without_metadata(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "split"
    folder.mkdir()
    for number in range(12):
        part = tmp_path / f"part_{number}"
        part.mkdir()
        path = write(part, kind, [("/p", POINT, float(number), number)])
        (file,) = (file for file in path.iterdir() if file.suffix != ".yaml")
        file.rename(folder / f"split_{number}{file.suffix}")
    assert read_x(folder, kind) == list(range(12))


def test_a_bag_of_ros1_is_known_by_its_beginning(tmp_path: Path) -> None:
    path = write(tmp_path, "ros1", many("ros1", 3)).rename(tmp_path / "drive.orig")
    assert read_x(path, "ros1") == [0, 1, 2]


@pytest.mark.parametrize(
    ("kind", "hint"),
    [
        ("ros1", "the bag was not closed; run: rosbag reindex {path}"),
        (
            "mcap",
            "not closed or is cut off\n      = copy the file again, or keep the rest; run: mcap recover {path}/a.mcap",
        ),
    ],
)
def test_a_bag_that_was_not_closed(tmp_path: Path, kind: str, hint: str) -> None:
    path = tmp_path / ("a.bag" if kind == "ros1" else "a")
    writer = open_writer(path, kind)
    writer.open()
    fill(writer, kind, many(kind, 50_000))
    writer.abort()
    with pytest.raises(InputError) as raised:
        read_x(path, kind)
    assert hint.format(path=path) in str(raised.value)


def test_messages_in_a_journal_are_not_missed(tmp_path: Path) -> None:
    path = write(tmp_path, "sqlite3", many("sqlite3", 10))
    with contextlib.closing(sqlite3.connect(path / "recorded.db3")) as database:
        database.execute("pragma journal_mode=wal")
        database.execute("update messages set timestamp = timestamp + 1")
        database.commit()
        for bag in (path, path / "recorded.db3"):
            with pytest.raises(InputError, match=r"in the journal recorded\.db3-wal\n.*sqlite3 FILE 'pragma"):
                read_x(bag, "sqlite3")
        database.execute("pragma wal_checkpoint(truncate)")
        assert read_x(path, "sqlite3") == list(range(10))


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_is_not_held_in_memory(tmp_path: Path, kind: str) -> None:
    image = bytes(2**20)
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_JAZZY)
    path = tmp_path / ("a.bag" if kind == "ros1" else "a")
    with open_writer(path, kind) as writer:
        connection: Any = writer.add_connection("/p", "std_msgs/msg/ByteMultiArray", typestore=store)
        for number in range(40):
            writer.write(connection, number, image)
    tracemalloc.start()
    with open_bag(path) as bag:
        sizes = [len(recorded.payload) for recorded in bag.messages({"/p"})]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert sizes == [len(image)] * 40
    assert peak < 10 * len(image)


# --- what a topic means ----------------------------------------------------------------------------------------------


def routed(path: Path, kind: str, signature: str) -> list[str]:
    name = parse_name("geometry_msgs/Point")
    with open_bag(path) as bag:
        routes = routes_of(bag, [subscriber("p", str(name), version(kind))], {(version(kind), name): signature})
        return [route.misfit for route in routes.values()]


@pytest.mark.parametrize("kind", KINDS)
def test_another_message_of_the_same_name(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, many(kind, 1))
    name = parse_name("geometry_msgs/Point")
    ours = signature(name, MessageLibrary(version(kind)).closure(name))
    assert routed(path, kind, ours) == [""]
    assert routed(path, kind, "other") == [
        f"its definition of geometry_msgs/Point differs from the one of 'p': {ours}, not other"
    ]


@pytest.mark.parametrize(
    ("digest", "text"), [("*", ""), ("0" * 32, "float64 x\nfloat64 y\nfloat64 z\n"), ("*", "a b c")]
)
def test_a_topic_whose_definition_or_sum_is_ours(tmp_path: Path, digest: str, text: str) -> None:
    with Rosbag1Writer(tmp_path / "a.bag") as writer:
        connection = writer.add_connection("/p", POINT, msgdef=text, md5sum=digest)
        writer.write(connection, 0, bytes(24))
    name = parse_name("geometry_msgs/Point")
    ours = signature(name, MessageLibrary(ROS1).closure(name))
    assert routed(tmp_path / "a.bag", "ros1", ours) == [""]


def test_two_types_on_one_topic(tmp_path: Path) -> None:
    with Rosbag1Writer(tmp_path / "a.bag") as writer:
        fill(writer, "ros1", [("/q", POINT, 1.0, 0)])
        fill(writer, "ros1", [("/q", STRING, 1.0, 1)])
    with pytest.raises(
        InputError, match=r"topic /q in .*: its type is std_msgs/String, but 'p' takes geometry_msgs/Point"
    ):
        read_x(tmp_path / "a.bag", "ros1")


@pytest.mark.parametrize("kind", KINDS)
def test_a_topic_that_nobody_takes(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, [("/p", POINT, 1.0, 0), ("/q", POINT, 2.0, 0), ("/p", POINT, 3.0, 0)])
    assert read_x(path, kind) == [1.0, 3.0]


@pytest.mark.parametrize("ours", ["tf2_msgs/TFMessage", "tf/tfMessage"])
@pytest.mark.parametrize("theirs", ["tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"])
def test_transforms_under_either_name_of_their_message(tmp_path: Path, ours: str, theirs: str) -> None:
    store = typestore(Stores.ROS1_NOETIC)
    taker = subscriber("transforms", ours, ROS1, topic="/tf")
    payload = encode(taker.frame, {"transforms": []})
    with Rosbag1Writer(tmp_path / "drive.bag") as writer:
        connection = writer.add_connection("/tf", theirs, typestore=store)
        writer.write(connection, 5, payload)
    with open_bag(tmp_path / "drive.bag") as bag:
        ((stream, route),) = routes_of(bag, [taker], signatures_of([taker])).items()
    assert (route.misfit, route.subscribers) == ("", (taker,))
    assert stream.signature == "94810edda583a504dfda3829e70d7eec"
    # Matched by type alone, too.
    (found,) = read_stimuli(tmp_path / "drive.bag", [subscriber("transforms", ours, ROS1)])
    assert found.payload == payload


def signatures_of(topics: Iterable[Converter]) -> dict[tuple[Middleware, MessageName], str]:
    names = [topic.frame.message for topic in topics]
    library = MessageLibrary(ROS1)
    return {(ROS1, name): signature(name, library.closure(name)) for name in names}
