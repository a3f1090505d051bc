"""Bags, specifications and simulators for the tests of this folder."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Reader as Rosbag1Reader
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import Reader as Rosbag2Reader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from fusesoc_firm.message.library import libraries
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.runs.replay.command import replay
from fusesoc_firm.runs.replay.options import Settings, Source, Target
from fusesoc_firm.system.system_core import LoadedSystem, load_system

MODEL = Path(__file__).with_name("model_simulator.py")
FORMS = ("ros1", "sqlite3", "mcap")
STORES = {"ros1": Stores.ROS1_NOETIC, "sqlite3": Stores.ROS2_JAZZY, "mcap": Stores.ROS2_JAZZY}
POINT, STRING = "geometry_msgs/msg/Point", "std_msgs/msg/String"

# Topic, type, time of recording (ns), and payload.
Item = tuple[str, str, int, bytes]


def store_of(form: str) -> Typestore:
    return get_typestore(STORES[form])


def payload(form: str, type_: str, *values: Any) -> bytes:
    """The payload of a message as rosbags writes it."""
    store = store_of(form)
    serialise = store.serialize_ros1 if form == "ros1" else store.serialize_cdr
    return bytes(serialise(store.types[type_](*values), type_))


def open_writer(path: Path, form: str) -> Rosbag1Writer | Rosbag2Writer:
    if form == "ros1":
        return Rosbag1Writer(path)
    plugin = StoragePlugin.MCAP if form == "mcap" else StoragePlugin.SQLITE3
    return Rosbag2Writer(path, version=9, storage_plugin=plugin)


def write(path: Path, form: str, items: Iterable[Item], store: Typestore | None = None) -> Path:
    """Write a bag with rosbags."""
    with open_writer(path, form) as writer:
        connections: dict[tuple[str, str], Any] = {}
        for topic, type_, stamp, data in items:
            if (topic, type_) not in connections:
                made = writer.add_connection(topic, type_, typestore=store or store_of(form))
                connections[topic, type_] = made
            writer.write(connections[topic, type_], stamp, data)
    return path


def points(form: str, count: int, topic: str = "/p", step: int = 10**7) -> list[Item]:
    """`count` points with x counting up, `step` ns apart."""
    return [
        (topic, POINT, 10**18 + step * number, payload(form, POINT, float(number), 0.0, 0.0)) for number in range(count)
    ]


def read(path: Path) -> list[Item]:
    """All messages of a bag in order of time, read with rosbags."""
    is_ros1 = path.is_file() and path.suffix not in (".mcap", ".db3")
    with Rosbag1Reader(path) if is_ros1 else Rosbag2Reader(path) as reader:
        return [(item.topic, item.msgtype, stamp, bytes(data)) for item, stamp, data in reader.messages()]


def specification(folder: Path, blocks: Sequence[str], more: str = "", project: str = "width: 64") -> Path:
    path = folder / "spec.yaml"
    lines = "\n".join(f"  - {{{block}}}" for block in blocks)
    path.write_text(f"project: {{name: robot, {project}}}\n{more}blocks:\n{lines}\n", encoding="utf-8")
    return path


def passing(name: str, message: str, ros: int = 1, more: str = "") -> list[str]:
    """A subscriber, and a publisher `<name>_out` to which its messages go."""
    kind = f"middleware: ROS{ros}, message: {message}"
    return [
        f"name: {name}, mode: subscriber, {kind}, outgoing: [{{name: {name}_out}}]{more}",
        f"name: {name}_out, mode: publisher, {kind}",
    ]


def load(path: Path, *folders: Path) -> LoadedSystem:
    return load_system(path, libraries(folders, None, None))


def model(*kinds: str, width: int = 64) -> Simulator:
    return Simulator([sys.executable, str(MODEL), str(width), *kinds])


def run(
    loaded: LoadedSystem, source: Source | Path, target: Target | Path, *kinds: str, quiet: int = 1000, **settings: Any
) -> None:
    """Replay with a model of the system's hardware."""
    replay(
        loaded,
        source if isinstance(source, Source) else Source(source),
        target if isinstance(target, Target) else Target(target),
        Settings(settings.pop("names", {}), quiet, **settings),
        lambda: model(*kinds, width=loaded.system.width),
    )
