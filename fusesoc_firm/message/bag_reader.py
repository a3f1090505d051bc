"""Read recorded bags, message by message.

    with open_bag(path) as bag:
        for recorded in bag.messages(topics):
            ...

The formats are ROS 1 bags, and ROS 2 bags in sqlite3 or MCAP, with or without compression. Only a bag's index is held
in memory. Payloads are returned as recorded and are not decoded. `definitions_in` returns the definitions that a bag
contains.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Rosbag1Reader
from rosbags.rosbag2 import Reader as Rosbag2Reader
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.joint import separate_texts
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.text.diagnostics import InputError, fail
from fusesoc_firm.tools.reads import in_part

Reader = Rosbag1Reader | Rosbag2Reader

BAGS = "a bag is a ROS 1 .bag file, or a ROS 2 folder, .mcap file or .db3 file"
_SUFFIXES = (".bag", ".mcap", ".db3")
_METADATA = "metadata.yaml"
_ROS1_MAGIC = b"#ROSBAG"
_SQLITE_MAGIC = b"SQLite format 3\0"
_SQLITE_HEADER_BYTES = 100
# The errors that rosbags reports for a damaged bag, and the remedy for each.
_REMEDIES = {
    "not indexed": "the bag was not closed; run: rosbag reindex {path}",
    "index looks damaged": "the bag is cut off; run: rosbag reindex {path}",
    "are still in the journal": "the bag was not closed; run: sqlite3 FILE 'pragma wal_checkpoint(truncate)'",
    "the file is cut off": "copy the bag again, or recover the rest; run: sqlite3 FILE .recover",
    "end magic is invalid": "the bag was not closed or is cut off; run: mcap recover {path}",
}


class Form(Enum):
    """The format of a bag; the values are the formats' names in commands."""

    ROS1 = "ros1"
    SQLITE3 = "sqlite3"
    MCAP = "mcap"

    @property
    def ros(self) -> Middleware:
        """The middleware of the messages in this format."""
        return ROS1 if self is Form.ROS1 else ROS2


class Stream(NamedTuple):
    """The messages of one topic and one type, with the type's signature and definition from the bag.

    The signature and the definition are empty if the bag does not contain them. The definition is a joint text (see
    `message/joint.py`).
    """

    topic: str
    type: str
    signature: str
    definition: str


class Recorded(NamedTuple):
    """A recorded message; `number` counts the messages of a topic from 0, and `stamp` is in ns."""

    stream: Stream
    number: int
    stamp: int
    payload: bytes


@dataclass(frozen=True)
class Bag:
    """An open bag: its format, the number of messages in each stream, and the start time in ns."""

    path: Path
    form: Form
    streams: Mapping[Stream, int]
    start: int
    _readers: Sequence[Reader] = field(repr=False)

    def messages(self, topics: Collection[str], stop: int | None = None) -> Iterator[Recorded]:
        """Yield the messages of `topics` in the order of their times, up to but not including `stop` (in ns).

        Raise `InputError` if the bag is damaged.
        """
        numbers: dict[str, int] = {}
        for reader in self._readers:
            connections = [item for item in reader.connections if item.topic in topics]
            if not connections:
                continue  # rosbags reads all topics if the list is empty
            found = reader.messages(connections, stop=stop)
            while True:
                with _readable(self.path):
                    item = next(found, None)
                if item is None:
                    break
                connection, stamp, payload = item
                number = numbers[connection.topic] = numbers.get(connection.topic, -1) + 1
                yield Recorded(_stream(connection), number, stamp, bytes(payload))


@dataclass(frozen=True)
class BagDefinitions:
    """The definitions in a bag: the middleware, and the distinct definition texts of each message."""

    ros: Middleware
    texts: Mapping[MessageName, tuple[str, ...]]


def is_bag(path: Path) -> bool:
    """Return whether a path is a bag, according to the file's name or the folder's contents."""
    if path.is_dir():
        return (path / _METADATA).is_file() or any(file.suffix in _SUFFIXES[1:] for file in path.iterdir())
    return path.suffix in _SUFFIXES and path.is_file()


def bag_files(path: Path) -> list[Path]:
    """Return the files of a bag: all files in its folder (ROS 2), or the file itself."""
    return sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]


def definitions_in(path: Path) -> BagDefinitions:
    """Return the message definitions in a bag; only the bag's index is read. May raise `InputError`.

    Types without a definition in the `.msg` language are omitted.
    """
    files = bag_files(path)
    with in_part(files):
        return _definitions_in(path, tuple(map(_state, files)))


def _state(file: Path) -> tuple[str, int, int]:
    """Return a tuple that changes when the file changes."""
    status = file.stat()
    return str(file.absolute()), status.st_size, status.st_mtime_ns


@lru_cache(maxsize=4)
def _definitions_in(path: Path, _states: tuple[tuple[str, int, int], ...]) -> BagDefinitions:
    """Cache `definitions_in`, since every library of a process needs the result; `_states` invalidates the cache."""
    texts: dict[MessageName, dict[str, None]] = {}
    with open_bag(path) as bag:
        for stream in bag.streams:
            if stream.definition:
                with suppress(InputError):  # a type whose name is not allowed in a specification
                    for name, text in separate_texts(parse_name(stream.type), stream.definition).items():
                        texts.setdefault(name, {})[text] = None
        return BagDefinitions(bag.form.ros, {name: tuple(found) for name, found in texts.items()})


@contextmanager
def open_bag(path: Path, hint: str = BAGS) -> Iterator[Bag]:
    """Open a bag for reading within the context. Raise `InputError`, with `hint` for a path that is not a bag."""
    with ExitStack() as stack:
        with _readable(path, hint):
            _check_databases(path)
            readers = _readers(path)
            for reader in readers:
                stack.enter_context(reader)
            streams: dict[Stream, int] = {}
            for connection in (item for reader in readers for item in reader.connections):
                stream = _stream(connection)
                streams[stream] = streams.get(stream, 0) + connection.msgcount
            bag = Bag(path, _form(readers[0]), streams, min(reader.start_time for reader in readers), readers)
        yield bag


def _readers(path: Path) -> list[Reader]:
    if path.is_dir() and not (path / _METADATA).exists():
        # A recorder writes the metadata file last. Without it, the finished part of the bag is still readable.
        files = sorted((file for file in path.iterdir() if file.suffix in _SUFFIXES[1:]), key=_natural)
        if not files:
            raise FileNotFoundError("the folder contains neither metadata.yaml nor a .db3 or .mcap file")
        return [Rosbag2Reader(file) for file in files]
    return [Rosbag1Reader(path) if _is_ros1(path) else Rosbag2Reader(path)]


def _check_databases(path: Path) -> None:
    """Raise `ValueError` if messages are missing from an SQLite file: still in the journal, or cut off.

    rosbags would miss messages in the journal, and would read zeros in place of a missing end.
    """
    for file in path.glob("*.db3") if path.is_dir() else [path]:
        journal = file.with_name(f"{file.name}-wal")
        if journal.exists() and journal.stat().st_size:
            raise ValueError(f"messages of {file.name} are still in the journal {journal.name}")
        size, expected = file.stat().st_size, _database_size(file)
        if size < expected:
            raise ValueError(f"the file is cut off: {file.name} has {size} of {expected} bytes")


def _database_size(file: Path) -> int:
    """Return the size in bytes according to a file's header (SQLite's file format, 1.3), or 0 if it is unknown."""
    with file.open("rb") as opened:
        header = opened.read(_SQLITE_HEADER_BYTES)
    is_known = len(header) == _SQLITE_HEADER_BYTES and header.startswith(_SQLITE_MAGIC)
    # If these numbers differ, an old writer has not updated the number of pages.
    if not is_known or header[24:28] != header[92:96]:
        return 0
    # 65,536 does not fit and is encoded as 1.
    page_bytes = int.from_bytes(header[16:18], "big")
    return int.from_bytes(header[28:32], "big") * (65536 if page_bytes == 1 else page_bytes)


def _is_ros1(path: Path) -> bool:
    if path.is_dir() or path.suffix == ".bag":
        return path.suffix == ".bag"
    with path.open("rb") as file:
        return file.read(len(_ROS1_MAGIC)) == _ROS1_MAGIC


def _natural(path: Path) -> list[tuple[int, str]]:
    """Return a sort key that orders `bag_10` after `bag_9`."""
    return [(int(digits or 0), text) for text, digits in re.findall(r"(\D*)(\d*)", path.name)]


def _form(reader: Reader) -> Form:
    if isinstance(reader, Rosbag1Reader):
        return Form.ROS1
    storage = reader.storage
    if isinstance(storage, DirectoryReader) and storage.storages:
        storage = storage.storages[0]
    return Form.MCAP if isinstance(storage, McapReader) else Form.SQLITE3


def _stream(connection: Connection) -> Stream:
    is_text = connection.msgdef.format is MessageDefinitionFormat.MSG
    definition = connection.msgdef.data if is_text else ""
    return Stream(connection.topic, connection.msgtype, connection.digest, definition)


@contextmanager
def _readable(path: Path, hint: str = "") -> Iterator[None]:
    """Convert any exception that a damaged file causes in rosbags to `InputError`."""
    try:
        yield
    except Exception as error:  # noqa: BLE001 - rosbags and its dependencies raise anything
        said = str(error) or type(error).__name__
        remedies = (text.format(path=path) for words, text in _REMEDIES.items() if words in said)
        fail(f"{path} is not a readable bag: {said}", hint=next(remedies, hint))
