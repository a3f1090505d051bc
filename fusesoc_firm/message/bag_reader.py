"""Read recorded bags, message by message.

    with open_bag(path) as bag:
        for recorded in bag.messages(topics):
            ...

The formats are ROS 1 bags, and ROS 2 bags in sqlite3 or MCAP, with or without compression. A bag is read once when it
is opened, and compared with what it says about itself; only the index of its messages is held in memory. Payloads are
returned as recorded and are not decoded. `definitions_in` returns the definitions that a bag contains.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.joint import Heading, Language, header, separate_texts
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.storage.bag_files import Metadata, check_own_metadata, is_bag, opened, parts_of
from fusesoc_firm.storage.compression import ZSTD_MAGIC, message
from fusesoc_firm.storage.contents import BagFile, Channel, Contents, DamageError
from fusesoc_firm.storage.mcap import McapFile
from fusesoc_firm.storage.ros1 import Ros1File
from fusesoc_firm.text.diagnostics import InputError, fail
from fusesoc_firm.tools.reads import in_part

__all__ = ["BAGS", "Bag", "BagDefinitions", "Foreign", "Form", "Recorded", "Stream", "bag_files", "is_bag"]

BAGS = "a bag is a ROS 1 .bag file, or a ROS 2 folder, .mcap file or .db3 file, which may be compressed (.zstd)"
_ENCODINGS = {"cdr": ROS2, "ros1": ROS1}
_LANGUAGES = {"ros1msg": ROS1, "ros2msg": ROS2, "ros2idl": ROS2, "omgidl": ROS2}
_IDL = ("ros2idl", "omgidl")


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


@dataclass(frozen=True)
class Foreign:
    """A channel whose messages are not those of the bag's ROS version: its number of messages, and the reason."""

    topic: str
    type: str
    count: int
    reason: str

    def __str__(self) -> str:
        """Return a line for users."""
        return f"{self.topic}: {self.reason}"


class Recorded(NamedTuple):
    """A recorded message; `number` counts the messages of a topic from 0, and `stamp` is in ns."""

    stream: Stream
    number: int
    stamp: int
    payload: bytes


class _Part(NamedTuple):
    """A file of a bag: its name, its contents, and the streams of its channels by their ids."""

    path: Path
    file: BagFile
    contents: Contents
    streams: Mapping[int, Stream]


@dataclass(frozen=True)
class Bag:
    """An open bag: its format, the number of messages in each stream, the start time in ns, and foreign channels.

    A bag of ROS 1 messages in MCAP has the format ROS 1.
    """

    path: Path
    form: Form
    streams: Mapping[Stream, int]
    start: int
    foreign: Sequence[Foreign]
    _parts: Sequence[_Part] = field(repr=False)

    def messages(self, topics: Collection[str], stop: int | None = None) -> Iterator[Recorded]:
        """Yield the messages of `topics` in the order of their times, up to but not including `stop` (in ns).

        Raise `InputError` if the bag is damaged.
        """
        numbers: dict[str, int] = {}
        for part, row in self._ordered(topics, stop):
            index = part.contents.index
            stream = part.streams[index.channels[row]]
            with _readable(self.path, part.path, part.file.remedy):
                payload = part.file.payload(index.chunks[row], index.starts[row], index.sizes[row])
                if self.form.ros is ROS2 and payload.startswith(ZSTD_MAGIC):
                    # The recorder compresses single messages on request. Others begin with a zero.
                    payload = message(payload)
            number = numbers[stream.topic] = numbers.get(stream.topic, -1) + 1
            yield Recorded(stream, number, index.stamps[row], payload)

    def _ordered(self, topics: Collection[str], stop: int | None) -> Iterator[tuple[_Part, int]]:
        """Yield the parts and the rows in their indexes of the messages of `topics`, by time."""
        rows, stamps, parts = [], [], []
        for number, part in enumerate(self._parts):
            wanted = [channel for channel, stream in part.streams.items() if stream.topic in topics]
            times = np.array(part.contents.index.stamps, dtype=np.uint64)
            is_wanted = np.isin(np.array(part.contents.index.channels, dtype=np.int64), wanted)
            if stop is not None:
                is_wanted &= times < np.uint64(max(0, stop))
            rows.append(np.flatnonzero(is_wanted))
            stamps.append(times[is_wanted])
            parts.append(np.full(len(rows[-1]), number))
        row, part_of = np.concatenate(rows), np.concatenate(parts)
        for position in np.argsort(np.concatenate(stamps), kind="stable"):
            yield self._parts[part_of[position]], int(row[position])


@dataclass(frozen=True)
class BagDefinitions:
    """The definitions in a bag: the middleware, and the distinct texts of each definition.

    `empty` are the messages whose definition is an empty text: those without fields, and, in bags of old recorders,
    those whose definition was not found.
    """

    ros: Middleware
    texts: Mapping[Heading, tuple[str, ...]]
    empty: frozenset[MessageName]


def bag_files(path: Path) -> list[Path]:
    """Return the files of a bag: all files in its folder (ROS 2), or the file itself."""
    return sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]


def definitions_in(path: Path) -> BagDefinitions:
    """Return the message definitions in a bag; only the bag's index is read. May raise `InputError`.

    Types without a definition in a language of ROS are omitted.
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
    channels: list[Channel] = []
    with _readable(path):
        parts = parts_of(path)
    for part in parts:
        with _readable(path, part), opened(part) as file, _readable(path, part, file.remedy):
            channels += file.channels().values()
    ros = _spoken(channels)
    texts: dict[Heading, dict[str, None]] = {}
    empty: set[MessageName] = set()
    for channel in (channel for channel in channels if _ENCODINGS.get(channel.encoding) is ros):
        stream = _stream(channel)
        with suppress(InputError):  # a type whose name is not allowed in a specification
            if stream.definition:
                for heading, text in separate_texts(parse_name(stream.type), stream.definition).items():
                    texts.setdefault(heading, {})[text] = None
            elif _LANGUAGES.get(channel.language) is ros and not channel.definition.strip():
                empty.add(parse_name(stream.type))
    return BagDefinitions(ros, {heading: tuple(found) for heading, found in texts.items()}, frozenset(empty))


@contextmanager
def open_bag(path: Path, hint: str = BAGS) -> Iterator[Bag]:
    """Open a bag for reading within the context.

    Raise `InputError` if the bag is damaged or lacks messages that it says it has, and, with `hint`, for a path that is
    not a bag.
    """
    with ExitStack() as stack:
        with _readable(path, hint=hint):
            if not path.exists():
                raise DamageError(f"{path} does not exist")
            names = parts_of(path)
            metadata = Metadata.beside(path) if path.is_dir() else None
        found = []
        for name in names:
            with _readable(path, name, hint):
                file = stack.enter_context(opened(name))
            with _readable(path, name, file.remedy):
                contents = file.scan()
                if len(names) == 1 and metadata is None:
                    check_own_metadata(file, contents)
                found.append((name, file, contents))
        with _readable(path):
            if metadata:
                metadata.check([contents for _, _, contents in found])
        yield _bag(path, found, metadata.digests if metadata else {})


def _bag(path: Path, found: Sequence[tuple[Path, BagFile, Contents]], digests: Mapping[tuple[str, str], str]) -> Bag:
    ros = _spoken(channel for _, _, contents in found for channel in contents.channels.values())
    parts, streams, foreign = [], Counter[Stream](), Counter[tuple[str, str, str]]()
    for name, file, contents in found:
        counts, own = Counter(contents.index.channels), {}
        for key, channel in contents.channels.items():
            if reason := _foreign(channel, ros):
                foreign[channel.topic, channel.type, reason] += counts[key]
            else:
                digest = channel.digest or digests.get((channel.topic, channel.type), "")
                own[key] = _stream(channel._replace(digest=digest))
                streams[own[key]] += counts[key]
        parts.append(_Part(name, file, contents, own))
    start = min((stamp for part in parts for stamp in part.contents.index.stamps), default=0)
    others = [Foreign(topic, type_, count, reason) for (topic, type_, reason), count in foreign.items()]
    return Bag(path, _form(ros, parts[0].file), streams, start, others, parts)


def _spoken(channels: Iterable[Channel]) -> Middleware:
    """Return the ROS version of a bag: ROS 1 if it has channels of ROS 1 alone."""
    return ROS1 if {_ENCODINGS[item.encoding] for item in channels if item.encoding in _ENCODINGS} == {ROS1} else ROS2


def _foreign(channel: Channel, ros: Middleware) -> str:
    """Return the reason why a channel is foreign to a bag, or an empty text."""
    if channel.encoding not in _ENCODINGS:
        return f"its messages are in '{channel.encoding}', not in {' or '.join(_ENCODINGS)}"
    if _ENCODINGS[channel.encoding] is not ros:
        return f"its messages are those of {_ENCODINGS[channel.encoding].title}, in a bag of {ros.title}"
    return "" if channel.type else "it has no schema that names the type of its messages"


def _form(ros: Middleware, file: BagFile) -> Form:
    if ros is ROS1 or isinstance(file, Ros1File):
        return Form.ROS1
    return Form.MCAP if isinstance(file, McapFile) else Form.SQLITE3


def _stream(channel: Channel) -> Stream:
    text = channel.definition.strip()
    # Some recorders write the type's name where they do not know the definition.
    is_name = text in (channel.type, channel.type.replace("/msg/", "/"))
    is_text = _LANGUAGES.get(channel.language) is _ENCODINGS[channel.encoding] and text and not is_name
    definition = channel.definition if is_text else ""
    if is_text and channel.language in _IDL and not text.startswith("="):
        definition = header(Language.IDL, channel.type) + definition
    return Stream(channel.topic, channel.type, channel.digest, definition)


@contextmanager
def _readable(path: Path, part: Path | None = None, hint: str = "") -> Iterator[None]:
    """Convert the exceptions that a damaged file causes to `InputError`, which names the bag and its part."""
    name = f"{part.name}: " if part and part != path else ""
    try:
        yield
    except DamageError as error:
        fail(f"{path} is not a readable bag: {name}{error}", hint=error.remedy or hint)
    except OSError as error:
        fail(f"{path} is not a readable bag: {name}{error.strerror or error}", hint=hint)
    except (struct.error, ValueError, OverflowError, MemoryError) as error:
        fail(f"{path} is not a readable bag: {name}its data are damaged: {error}", hint=hint)
