"""Write bags: each bag appears only when it is complete, and equal messages result in equal bytes."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from fusesoc_firm.message.bag_reader import Form
from fusesoc_firm.message.joint import joint_text
from fusesoc_firm.message.middleware import Definitions
from fusesoc_firm.message.signature import signature
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import check_parent

_FILES = {".bag": Form.ROS1, ".mcap": Form.MCAP, ".db3": Form.SQLITE3}
_PLUGINS = {Form.SQLITE3: StoragePlugin.SQLITE3, Form.MCAP: StoragePlugin.MCAP}
# A folder that contains only these files counts as a bag and may be replaced.
_IN_A_BAG = ("metadata.yaml", "*.db3", "*.mcap", "*.db3.zstd", "*.mcap.zstd")


@dataclass(frozen=True)
class RecordedTopic:
    """A topic with its type, such as geometry_msgs/msg/Point, and the type's definition and signature."""

    name: str
    type: str
    definition: str
    signature: str

    @classmethod
    def of(cls, name: str, definitions: Definitions) -> RecordedTopic:
        """Return the topic of the last message in `definitions`, which contains all nested messages."""
        message = list(definitions)[-1]
        type_ = definitions[message].full_name
        return cls(name, type_, joint_text(message, definitions), signature(message, definitions))


@dataclass
class BagWriter:
    """A bag that is being written; it contains all topics, even topics without messages."""

    _writer: Rosbag1Writer | Rosbag2Writer
    _connections: dict[RecordedTopic, Connection] = field(default_factory=dict)

    def add(self, topic: RecordedTopic) -> None:
        """Add a topic; adding the same topic again has no effect."""
        if topic in self._connections:
            return
        if isinstance(self._writer, Rosbag1Writer):
            # ROS 1 has no kinds of interfaces, and the writer in rosbags expects this kind.
            type_ = "/msg/".join(topic.type.split("/")[::2])
            made = self._writer.add_connection(topic.name, type_, msgdef=topic.definition, md5sum=topic.signature)
        else:
            made = self._writer.add_connection(topic.name, topic.type, msgdef=topic.definition, rihs01=topic.signature)
        self._connections[topic] = made

    def write(self, topic: RecordedTopic, stamp: int, payload: bytes) -> None:
        """Add a message on one of the topics, recorded at `stamp` (in ns)."""
        self._writer.write(self._connections[topic], stamp, payload)


def form_of(path: Path) -> Form | None:
    """Return the format that the ending of a bag's name implies, or None."""
    return _FILES.get(path.suffix)


def check_writable(path: Path, *, force: bool) -> None:
    """Raise `InputError` if `path` is not a bag and must not be replaced, or if it is a bag and `force` is not set."""
    check_parent(path)
    if path.is_dir() and (other := next((file for file in path.iterdir() if not _is_of_bag(file)), None)):
        fail(f"the folder {path} is not a bag: it contains {other.name}")
    if path.exists() and not force:
        fail(f"{path} already exists", hint="use --force to replace it")


def _is_of_bag(file: Path) -> bool:
    return file.is_file() and any(file.match(pattern) for pattern in _IN_A_BAG)


@contextmanager
def write_bag(path: Path, form: Form, topics: Sequence[RecordedTopic]) -> Iterator[BagWriter]:
    """Write a bag with these topics; if the context ends without an error, move the bag to `path`.

    An existing bag is replaced. Raise `InputError` if the bag cannot be written.
    """
    try:
        with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
            made = Path(folder, path.name)
            with _writer(made, form) as writer:
                bag = BagWriter(writer)
                for topic in topics:
                    bag.add(topic)
                yield bag
            _put(made, path)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror or error}")
    except sqlite3.Error as error:
        fail(f"cannot write {path}: {error}")


def _put(made: Path, path: Path) -> None:
    """Move a finished bag to its destination."""
    if path.suffix in _FILES and made.is_dir():
        # In a ROS 2 bag that is a single file, this file also contains the folder's metadata.
        made = made / f"{path.name}{path.suffix}"
    if path.is_dir():
        shutil.rmtree(path)
    made.replace(path)


def _writer(path: Path, form: Form) -> Rosbag1Writer | Rosbag2Writer:
    if form is Form.ROS1:
        return Rosbag1Writer(path)
    return Rosbag2Writer(path, version=Rosbag2Writer.VERSION_LATEST, storage_plugin=_PLUGINS[form])
