"""Bags in the forms of many recorders, each with the same messages."""

from __future__ import annotations

import shutil
import sqlite3
import struct
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_typestore

from fusesoc_firm.storage.compression import zstd

# The Python of Debian's rosbag.
SYSTEM_PYTHON = "/usr/bin/python3"
POINT, TEXT = "geometry_msgs/msg/Point", "float64 x\nfloat64 y\nfloat64 z\n"
POINT_HASH = "RIHS01_6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881"
POINT_SUM = "4a842b65f413084dc2b10fb484ea7f17"
TOPICS = ("/p", "/q")


class Item(NamedTuple):
    """A message: its topic, the time of recording in ns, and its payload."""

    topic: str
    stamp: int
    payload: bytes


def items(ros: int, count: int = 100) -> list[Item]:
    """Points on two topics, two of three on the first."""
    begin = b"" if ros == 1 else b"\0\1\0\0"
    return [
        Item(TOPICS[number % 3 == 2], 10**18 + number * 10**7, begin + struct.pack("<3d", number, 2.5, -number))
        for number in range(count)
    ]


# --- rosbags -------------------------------------------------------------------------------------------------------


def with_rosbags1(folder: Path, found: Sequence[Item], form: Rosbag1Writer.CompressionFormat | None = None) -> Path:
    writer = Rosbag1Writer(folder / "a.bag")
    if form:
        writer.set_compression(form)
    with writer:
        _fill(writer, found, Stores.ROS1_NOETIC)
    return folder / "a.bag"


def with_rosbags2(
    folder: Path, found: Sequence[Item], plugin: StoragePlugin, version: int, mode: CompressionMode
) -> Path:
    writer = Rosbag2Writer(folder / "a", version=8 if version == 8 else 9, storage_plugin=plugin)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        _fill(writer, found, Stores.ROS2_JAZZY)
    return folder / "a"


def _fill(writer: Any, found: Sequence[Item], store: Stores) -> None:
    connections = {topic: writer.add_connection(topic, POINT, typestore=get_typestore(store)) for topic in TOPICS}
    for item in found:
        writer.write(connections[item.topic], item.stamp, item.payload)


# --- the package mcap ----------------------------------------------------------------------------------------------


def with_mcap(
    folder: Path,
    found: Sequence[Item],
    ros: int = 2,
    foreign: Sequence[str] = (),
    profile: str = "",
    topics: Sequence[str] = TOPICS,
    **options: Any,
) -> Path:
    """Write a file with options of mcap's writer; `foreign` are encodings of more channels, with a message each."""
    path = folder / "a.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file, **{"chunk_size": 500, "use_statistics": True, **options})
        writer.start(profile=profile)
        name, language, encoding = ("geometry_msgs/Point", "ros1msg", "ros1") if ros == 1 else (POINT, "ros2msg", "cdr")
        schema = writer.register_schema(name, language, TEXT.encode())
        channels = {topic: writer.register_channel(topic, encoding, schema) for topic in topics}
        for number, other in enumerate(foreign):
            kind = writer.register_schema(f"other.Type{number}", f"{other}schema", b"\xff\0{")
            channel = writer.register_channel(f"/other{number}", other, kind)
            writer.add_message(channel, 10**18, b"{}", 10**18)
        for item in found:
            writer.add_message(channels[item.topic], item.stamp, item.payload, item.stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def out_of_order(folder: Path, found: Sequence[Item], **options: Any) -> Path:
    """A file in which later messages come first."""
    return with_mcap(folder, found[::-1], **options)


# --- hand-made SQLite files, as rosbag2 wrote them ------------------------------------------------------------------


def with_sqlite(
    folder: Path,
    found: Sequence[Item],
    version: int = 4,
    files: int = 1,
    mode: str = "",
    metadata: Mapping[str, Any] | None = None,
) -> Path:
    """Write a bag with the tables and the metadata of a version, split into some files.

    `mode` is that of the compression, and `metadata` replaces parts of the metadata; without it, there are none.
    """
    bag = folder / "a"
    bag.mkdir()
    names = []
    for number in range(files):
        name = f"a_{number}.db3"
        part = found[number * len(found) // files : (number + 1) * len(found) // files]
        _database(bag / name, part, version, is_packed=mode == "MESSAGE")
        names.append(name)
        if mode == "FILE":
            (bag / f"{name}.zstd").write_bytes(zstd.compress((bag / name).read_bytes()))
            (bag / name).unlink()
            names[-1] += ".zstd"
    if metadata is not None:
        text = described(names, found, version, mode) | dict(metadata)
        (bag / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": text}), encoding="utf-8")
    return bag


def described(names: Sequence[str], found: Sequence[Item], version: int, mode: str) -> dict[str, Any]:
    """The metadata of a bag."""
    topics = [
        {
            "topic_metadata": {"name": topic, "type": POINT, "serialization_format": "cdr"}
            | ({"offered_qos_profiles": ""} if version >= 4 else {}),
            "message_count": sum(item.topic == topic for item in found),
        }
        for topic in TOPICS
    ]
    return {
        "version": version,
        "storage_identifier": "sqlite3",
        "relative_file_paths": [*names] if version >= 4 else [f"a/{name}" for name in names],
        "duration": {"nanoseconds": found[-1].stamp - found[0].stamp},
        "starting_time": {"nanoseconds_since_epoch": found[0].stamp},
        "message_count": len(found),
        "topics_with_message_count": topics,
        "compression_format": "zstd" if mode else "",
        "compression_mode": mode,
    }


def _database(path: Path, found: Iterable[Item], version: int, *, is_packed: bool) -> None:
    more = {"offered_qos_profiles": "''"} if version >= 4 else {}
    more |= {"type_description_hash": f"'{POINT_HASH}'"} if version >= 7 else {}
    columns = "".join(f", {name} TEXT NOT NULL" for name in more)
    with closing(sqlite3.connect(path)) as database:
        database.executescript(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
            f" serialization_format TEXT NOT NULL{columns});"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
            " data BLOB NOT NULL);"
            "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
        )
        for number, topic in enumerate(TOPICS, 1):
            values = "".join(f", {value}" for value in more.values())
            database.execute(f"INSERT INTO topics VALUES(?, ?, ?, 'cdr'{values})", (number, topic, POINT))
        for item in found:
            data = zstd.compress(item.payload) if is_packed else item.payload
            row = (TOPICS.index(item.topic) + 1, item.stamp, data)
            database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", row)
        database.commit()


def alone(folder: Path, found: Sequence[Item], **options: Any) -> Path:
    """The only file of a bag."""
    (file,) = (file for file in with_sqlite(folder, found, **options).iterdir() if file.suffix != ".yaml")
    return file


# --- hand-made ROS 1 bags, with headers as recorders of 2010 wrote them ----------------------------------------------


def with_old_headers(folder: Path, found: Sequence[Item]) -> Path:
    """Write a bag whose headers are in another order, whose index has one more field, and that has no caller ids."""
    path = folder / "old.bag"
    connections = b"".join(
        _record(
            {"topic": topic.encode(), "conn": _word(number), "op": b"\7"},
            _header(
                {
                    "type": b"geometry_msgs/Point",
                    "md5sum": POINT_SUM.encode(),
                    "message_definition": TEXT.encode(),
                    "topic": topic.encode(),
                }
            ),
        )
        for number, topic in enumerate(TOPICS)
    )
    start = 4117 - 8
    parts: list[bytes] = []
    infos: list[bytes] = []
    for first in range(0, len(found), 30):
        part = found[first : first + 30]
        content, index = bytearray(connections), {number: bytearray() for number in range(len(TOPICS))}
        for item in part:
            number = TOPICS.index(item.topic)
            index[number] += _time(item.stamp) + _word(len(content))
            content += _record({"time": _time(item.stamp), "op": b"\2", "conn": _word(number)}, item.payload)
        fields = {"size": _word(len(content)), "op": b"\5", "compression": b"none"}
        position = start + sum(map(len, parts))
        parts.append(_record(fields, bytes(content)))
        parts += [
            _record(
                {"op": b"\4", "conn": _word(number), "ver": _word(1), "count": _word(len(rows) // 12), "old": b""}, rows
            )
            for number, rows in index.items()
        ]
        counts = b"".join(_word(number) + _word(len(rows) // 12) for number, rows in index.items())
        info = {
            "op": b"\6",
            "end_time": _time(part[-1].stamp),
            "start_time": _time(part[0].stamp),
            "chunk_pos": struct.pack("<Q", position),
            "ver": _word(1),
            "count": _word(len(index)),
        }
        infos.append(_record(info, counts))
    end = struct.pack("<Q", start + sum(map(len, parts)))
    head = {"chunk_count": _word(len(infos)), "conn_count": _word(len(TOPICS)), "index_pos": end, "op": b"\3"}
    header = _header(head)
    padding = start - 13 - 8 - len(header)
    begin = b"#ROSBAG V2.0\n" + _word(len(header)) + header + _word(padding) + b" " * padding
    path.write_bytes(begin + b"".join(parts) + connections + b"".join(infos))
    return path


def _record(fields: Mapping[str, bytes], data: bytes | bytearray) -> bytes:
    header = _header(fields)
    return _word(len(header)) + header + _word(len(data)) + bytes(data)


def _header(fields: Mapping[str, bytes]) -> bytes:
    parts = (name.encode() + b"=" + value for name, value in fields.items())
    return b"".join(_word(len(part)) + part for part in parts)


def _word(number: int) -> bytes:
    return struct.pack("<I", number)


def _time(stamp: int) -> bytes:
    return struct.pack("<II", *divmod(stamp, 10**9))


# --- Debian's rosbag -------------------------------------------------------------------------------------------------

_SCRIPT = """
import struct, sys, rosbag, rospy
from geometry_msgs.msg import Point
with rosbag.Bag(sys.argv[1], "w", compression=sys.argv[2], chunk_threshold=int(sys.argv[3])) as bag:
    for line in sys.stdin:
        topic, stamp, payload = line.split()
        bag.write(topic, Point().deserialize(bytes.fromhex(payload)), rospy.Time(*divmod(int(stamp), 10**9)))
"""


def has_debian_rosbag() -> bool:
    probe = [SYSTEM_PYTHON, "-c", "import rosbag, geometry_msgs.msg"]
    return bool(shutil.which(SYSTEM_PYTHON)) and subprocess.run(probe, capture_output=True, check=False).returncode == 0


def with_debian_rosbag(folder: Path, found: Sequence[Item], compression: str, threshold: int) -> Path:
    lines = "".join(f"{item.topic} {item.stamp} {item.payload.hex()}\n" for item in found)
    command = [SYSTEM_PYTHON, "-c", _SCRIPT, str(folder / "debian.bag"), compression, str(threshold)]
    subprocess.run(command, input=lines, text=True, check=True)
    return folder / "debian.bag"


# --- all -------------------------------------------------------------------------------------------------------------

Form = Callable[[Path, Sequence[Item]], Path]


def _rosbags() -> Iterable[tuple[str, Form]]:
    yield "rosbags-ros1", with_rosbags1
    for form in Rosbag1Writer.CompressionFormat:
        yield f"rosbags-ros1-{form.name}", partial(with_rosbags1, form=form)
    modes = {
        StoragePlugin.SQLITE3: (CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE),
        StoragePlugin.MCAP: tuple(CompressionMode),
    }
    for plugin, version in product(modes, (8, 9)):
        for mode in modes[plugin]:
            name = f"rosbags-{plugin.name}-{version}-{mode.name}"
            yield name, partial(with_rosbags2, plugin=plugin, version=version, mode=mode)


def _mcap() -> Iterable[tuple[str, Form]]:
    for compression in CompressionType:
        yield f"mcap-{compression.name}", partial(with_mcap, compression=compression)
        yield f"mcap-{compression.name}-no-crc", partial(with_mcap, compression=compression, enable_crcs=False)
        chunk_index = partial(with_mcap, compression=compression, index_types=IndexType.CHUNK)
        yield f"mcap-{compression.name}-chunk-index", chunk_index
        yield f"mcap-{compression.name}-ros1", partial(with_mcap, ros=1, compression=compression)
        yield f"mcap-{compression.name}-reversed", partial(out_of_order, compression=compression)
    yield "mcap-no-chunks", partial(with_mcap, use_chunking=False)
    yield "mcap-no-chunks-no-crc", partial(with_mcap, use_chunking=False, enable_crcs=False)
    yield "mcap-no-chunks-reversed", partial(out_of_order, use_chunking=False)
    yield "mcap-no-statistics", partial(with_mcap, use_statistics=False)
    yield "mcap-no-index", partial(with_mcap, index_types=IndexType.NONE)
    bare: dict[str, Any] = {
        "use_statistics": False,
        "use_summary_offsets": False,
        "repeat_channels": False,
        "repeat_schemas": False,
        "index_types": IndexType.NONE,
    }
    yield "mcap-no-summary", partial(with_mcap, **bare)
    yield "mcap-no-summary-no-chunks", partial(with_mcap, use_chunking=False, **bare)
    yield "mcap-no-schemas-in-summary", partial(with_mcap, repeat_schemas=False)
    yield "mcap-profile", partial(with_mcap, profile="ros2")
    yield "mcap-foreign", partial(with_mcap, foreign=("json", "protobuf", "flatbuffer", ""))


def _sqlite() -> Iterable[tuple[str, Form]]:
    for version in (1, 3, 4, 8):
        yield f"sqlite-{version}", partial(with_sqlite, version=version, metadata={})
        yield f"sqlite-{version}-alone", partial(alone, version=version)
        yield f"sqlite-{version}-split", partial(with_sqlite, version=version, files=3, metadata={})
    for mode in ("FILE", "MESSAGE"):
        yield f"sqlite-{mode}", partial(with_sqlite, mode=mode, metadata={})
        yield f"sqlite-{mode}-split", partial(with_sqlite, mode=mode, files=3, metadata={})
        yield f"sqlite-{mode}-no-metadata", partial(with_sqlite, mode=mode, files=2)
        yield f"sqlite-{mode}-alone", partial(alone, mode=mode)
    later = {"starting_time": {"nanoseconds_since_epoch": 10**18 + 66 * 10**7}}
    yield "sqlite-begins-later", partial(with_sqlite, files=2, metadata=later)


def _debian() -> Iterable[tuple[str, Form]]:
    for compression, threshold in product(("none", "bz2", "lz4"), (500, 768 * 1024)):
        name = f"debian-{compression}-{threshold}"
        yield name, partial(with_debian_rosbag, compression=compression, threshold=threshold)


DEBIAN: Mapping[str, Form] = dict(_debian())
FORMS: Mapping[str, Form] = {
    **dict(_rosbags()),
    **dict(_mcap()),
    **dict(_sqlite()),
    "ros1-old-headers": with_old_headers,
}


def version_of(name: str) -> int:
    """The ROS version of the messages in a form."""
    return 1 if "ros1" in name or name in DEBIAN else 2
