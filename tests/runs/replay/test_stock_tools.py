"""Recorded bags in independent tools: ROS 1's rosbag, mcap with its decoder for ROS 2, rosbags."""

from __future__ import annotations

import sqlite3
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from fusesoc_firm.message.bag_reader import Form
from fusesoc_firm.runs.replay.options import Target
from tests.runs.replay.replays import Item, load, passing, payload, read, run, specification, write

PYTHON = "/usr/bin/python3"
HAS_ROSBAG = Path("/usr/lib/python3/dist-packages/rosbag").is_dir()

# Messages that only the specification's paths define: constants, bounds, arrays, and nesting at two levels.
OWN = {
    1: {
        "Plan": "# A way.\nuint8 FAST = 2  # m/s\nstring NAME = to # there\nHeader header\nown_msgs/Step[] steps\n"
        "Step last\ntime[2] times\nuint8 mode\n",
        "Step": "float32 LENGTH=0.5\nfloat64 x\nstring label\nduration took\ngeometry_msgs/Point at\n",
    },
    2: {
        "Plan": 'uint8 FAST = 2   # m/s\nstring NAME = "to"\nstd_msgs/Header header\nown_msgs/Step[<=4] steps\n'
        "Step last\nuint8 mode 1\nint32[] numbers [1, 2]\n",
        "Step": 'float32 LENGTH=0.5\nfloat64 x 0.5\nstring<=8 label "none"\ngeometry_msgs/Point at\n',
    },
}
POINT, HEADER = "geometry_msgs/msg/Point", "std_msgs/msg/Header"


def own_store(ros: int) -> Typestore:
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_JAZZY)
    for name in ("Step", "Plan"):
        # Constants with capitals and without blanks, which rosbags reads correctly.
        text = (
            OWN[ros][name].replace("Header header", "std_msgs/Header header").replace("std_msgs/std_msgs", "std_msgs")
        )
        text = text.replace(" = ", "=").replace("   # m/s", "")
        store.register(get_types_from_msg(text, f"own_msgs/msg/{name}"))
    return store


def value(store: Typestore, type_: str, **fields: Any) -> Any:
    return store.types[type_](**fields)


def plan(store: Typestore, ros: int) -> bytes:
    """A message with a value in every field."""
    import numpy as np

    time, duration = "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"
    stamp = value(store, time, sec=7, nanosec=8)
    header = {"seq": 3} if ros == 1 else {}
    took = {"took": value(store, duration, sec=1, nanosec=2)} if ros == 1 else {}
    more = {"times": [stamp, stamp]} if ros == 1 else {"numbers": np.array([5, 6, 7], np.int32)}
    steps = [
        value(store, "own_msgs/msg/Step", x=n / 4, label="s" * n, at=value(store, POINT, x=1.0, y=2.0, z=3.0), **took)
        for n in range(3)
    ]
    message = value(
        store,
        "own_msgs/msg/Plan",
        header=value(store, HEADER, stamp=stamp, frame_id="map", **header),
        steps=steps,
        last=steps[1],
        mode=2,
        **more,
    )
    serialise = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    return bytes(serialise(message, "own_msgs/msg/Plan"))


def recorded(folder: Path, ros: int, form: Form) -> tuple[Path, Typestore, list[Item]]:
    """A bag of plans and points written by replay, rosbags' types, and the expected messages."""
    package = folder / "own_msgs" / "msg"
    package.mkdir(parents=True)
    for name, text in OWN[ros].items():
        (package / f"{name}.msg").write_text(text)
    (package.parent / "package.xml").write_text("<package><name>own_msgs</name></package>")
    store = own_store(ros)
    data = plan(store, ros)
    point = bytes(24) if ros == 1 else b"\0\1\0\0" + bytes(24)
    items = [
        (topic, type_, 10**18 + n, payload)
        for n in range(5)
        for topic, type_, payload in (("/plan", "own_msgs/msg/Plan", data), ("/p", POINT, point))
    ]
    source = write(folder / ("in.bag" if ros == 1 else "in"), "ros1" if ros == 1 else "mcap", items, store)
    blocks = passing("plan", "own_msgs/Plan", ros) + passing("p", "geometry_msgs/Point", ros)
    target = folder / {Form.ROS1: "out.bag", Form.MCAP: "out.mcap", Form.SQLITE3: "out"}[form]
    run(load(specification(folder, blocks), folder), source, Target(target, form), "echo", "echo")
    expected = [(f"{topic}_out", type_, stamp, payload) for topic, type_, stamp, payload in items]
    assert read(target) == expected
    return target, store, expected


@pytest.mark.skipif(not HAS_ROSBAG, reason="python3-rosbag is not installed")
def test_rosbag_of_ros1(tmp_path: Path) -> None:
    path, store, _ = recorded(tmp_path, 1, Form.ROS1)
    info = subprocess.run(["rosbag", "info", "--yaml", path], capture_output=True, text=True, check=True)
    assert info.stderr == ""
    found = yaml.safe_load(info.stdout)
    assert (found["version"], found["indexed"], found["messages"]) == (2.0, True, 10)
    md5 = {
        name: store.generate_msgdef(f"{name.replace('/', '/msg/')}")[1]
        for name in ("own_msgs/Plan", "geometry_msgs/Point")
    }
    assert {(item["type"], item["md5"]) for item in found["types"]} == set(md5.items())
    assert {(item["topic"], item["type"], item["messages"]) for item in found["topics"]} == {
        ("/plan_out", "own_msgs/Plan", 5),
        ("/p_out", "geometry_msgs/Point", 5),
    }
    # genpy creates classes from the definitions in the bag, and warns if their sum differs from the bag's.
    script = (
        "import sys, rosbag\n"
        "for topic, message, time in rosbag.Bag(sys.argv[1]).read_messages():\n"
        "    print(topic, time.to_nsec(), getattr(message, 'mode', message))\n"
        "    if topic == '/plan_out':\n"
        "        labels = [step.label for step in message.steps]\n"
        "        print(message.FAST, message.NAME, message.header.frame_id, labels, message.times[1])\n"
    )
    done = subprocess.run([PYTHON, "-c", script, path], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert lines[:2] == [f"/plan_out {10**18} 2", "2 to # there map ['', 's', 'ss'] 7000000008"]
    assert "WARNING" not in done.stdout
    assert len([line for line in lines if line.startswith("/p")]) == 10


def test_mcap_and_its_decoder_of_ros2(tmp_path: Path) -> None:
    path, _, expected = recorded(tmp_path, 2, Form.MCAP)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        found = list(reader.iter_decoded_messages())
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == 10
    assert [(c.topic, s.name, m.log_time, m.data) for s, c, m, _ in found if s] == expected
    message = next(decoded for _, channel, _, decoded in found if channel.topic == "/plan_out")
    assert (message.header.frame_id, message.mode, list(message.numbers)) == ("map", 2, [5, 6, 7])
    assert [(step.x, step.label) for step in message.steps] == [(0.0, ""), (0.25, "s"), (0.5, "ss")]


@pytest.mark.parametrize("form", [Form.SQLITE3, Form.MCAP, Form.ROS1])
def test_rosbags(tmp_path: Path, form: Form) -> None:
    """Its reader creates types from the definitions, and rejects a bag whose hashes differ from theirs."""
    path, _, expected = recorded(tmp_path, form.ros.number, form)
    with AnyReader([path]) as reader:
        assert {(item.topic, item.msgtype, item.msgcount) for item in reader.connections} == {
            ("/plan_out", "own_msgs/msg/Plan", 5),
            ("/p_out", POINT, 5),
        }
        for (connection, stamp, data), item in zip(reader.messages(), expected, strict=True):
            assert (connection.topic, connection.msgtype, stamp, data) == item
            message = reader.deserialize(data, connection.msgtype)
            assert connection.topic == "/p_out" or [step.label for step in message.steps] == ["", "s", "ss"]  # type: ignore[attr-defined]


def test_the_tables_of_sqlite3(tmp_path: Path) -> None:
    path, store, _ = recorded(tmp_path, 2, Form.SQLITE3)
    hashes = {type_: store.hash_rihs01(type_) for type_ in ("own_msgs/msg/Plan", POINT)}
    with sqlite3.connect(path / "out.db3") as database:
        topics = database.execute("select name, type, serialization_format, type_description_hash from topics")
        assert sorted(topics) == [
            ("/p_out", POINT, "cdr", hashes[POINT]),
            ("/plan_out", "own_msgs/msg/Plan", "cdr", hashes["own_msgs/msg/Plan"]),
        ]
    metadata = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (metadata["storage_identifier"], metadata["message_count"]) == ("sqlite3", 10)
    assert {item["topic_metadata"]["type_description_hash"] for item in metadata["topics_with_message_count"]} == set(
        hashes.values()
    )


# --- what others record ----------------------------------------------------------------------------------------------

WRITE = """
import sys, genpy, rosbag
from genpy.dynamic import generate_dynamic
point = generate_dynamic("geometry_msgs/Point", "float64 x\\nfloat64 y\\nfloat64 z\\n")["geometry_msgs/Point"]
with rosbag.Bag(sys.argv[1], "w", compression=sys.argv[2], chunk_threshold=1000) as bag:
    for number in range(100):
        bag.write("/p", point(float(number), 0.0, 0.0), genpy.Time(1000, number))
"""


@pytest.mark.skipif(not HAS_ROSBAG, reason="python3-rosbag is not installed")
@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_a_bag_of_rosbag(tmp_path: Path, compression: str) -> None:
    source = tmp_path / "in.bag"
    subprocess.run([PYTHON, "-c", WRITE, source, compression], capture_output=True, check=True)
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 1)))
    run(loaded, source, tmp_path / "out.bag", "echo")
    stamps = [10**12 + number for number in range(100)]
    values = [payload("ros1", POINT, float(number), 0.0, 0.0) for number in range(100)]
    expected = [("/p_out", POINT, *each) for each in zip(stamps, values, strict=True)]
    assert read(tmp_path / "out.bag") == expected


@pytest.mark.parametrize("compression", CompressionType)
def test_a_bag_of_mcap(tmp_path: Path, compression: CompressionType) -> None:
    source = tmp_path / "in.mcap"
    with source.open("wb") as file:
        writer = McapWriter(file, chunk_size=1000, compression=compression)
        schema = writer.register_msgdef(POINT, "float64 x\nfloat64 y\nfloat64 z")
        for number in range(100):
            value = {"x": float(number), "y": 0.0, "z": 0.0}
            writer.write_message("/p", schema, value, log_time=number, publish_time=number)
        writer.finish()  # type: ignore[no-untyped-call]
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 2)))
    run(loaded, source, tmp_path / "out.mcap", "echo")
    assert [(stamp, data) for _, _, stamp, data in read(tmp_path / "out.mcap")] == [
        (number, payload("mcap", POINT, float(number), 0.0, 0.0)) for number in range(100)
    ]
