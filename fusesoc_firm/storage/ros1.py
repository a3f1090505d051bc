"""Read ROS 1 bags of version 2.0 (http://wiki.ros.org/Bags/Format/2.0), with the fields of headers in any order."""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple

from fusesoc_firm.storage.compression import decompressed
from fusesoc_firm.storage.contents import Channel, Contents, DamageError

MAGIC = b"#ROSBAG V"
_VERSION = b"2.0"
_WORD = struct.Struct("<I")
_COUNT = struct.Struct("<II")
_INDEX = struct.Struct("<III")
(_MESSAGE_DATA, _BAG_HEADER, _INDEX_DATA, _CHUNK, _CHUNK_INFO, _CONNECTION) = range(2, 8)
# A header has a few fields with numbers and names.
_MOST_HEADER_BYTES = 2**20
_CHUNKS_IN_MEMORY = 4
# The MD5 sum of a message with neither fields nor constants, whose definition is an empty text.
_EMPTY_SUM = "d41d8cd98f00b204e9800998ecf8427e"
_REINDEX = "run: rosbag reindex {}"


class _Record(NamedTuple):
    """A record: the fields of its header, and the first byte and the size of its data."""

    fields: dict[str, bytes]
    start: int
    size: int

    @property
    def kind(self) -> int:
        """The record's operation code."""
        return self.value("op", "<B")

    def value(self, name: str, form: str = "<I") -> int:
        """Return a field that is a number."""
        number: int = struct.unpack(form, self._field(name))[0]
        return number

    def stamp(self, name: str) -> int:
        """Return a field that is a time, in ns."""
        return _nanoseconds(*struct.unpack("<II", self._field(name)))

    def text(self, name: str, default: str = "") -> str:
        """Return a field that is a text."""
        return self.fields.get(name, default.encode()).decode()

    def _field(self, name: str) -> bytes:
        if name not in self.fields:
            raise DamageError(f"the header of the record before byte {self.start} has no field '{name}'")
        return self.fields[name]


class Ros1File:
    """A ROS 1 bag, open for reading."""

    def __init__(self, file: Path) -> None:
        """Open a bag."""
        self.remedy = _REINDEX.format(file)
        self._file = file.open("rb")
        self._bytes = file.stat().st_size
        # The first byte after the version.
        self._first = 0
        self.chunk = lru_cache(_CHUNKS_IN_MEMORY)(self._chunk)

    def check(self) -> None:
        """Raise `DamageError` if the bag has another version, is encrypted or was not closed."""
        file = self._file.name
        first = self._file.readline(64)
        version = first.removeprefix(MAGIC).strip()
        if not first.startswith(MAGIC):
            raise DamageError("the file does not begin like a ROS 1 bag")
        if version != _VERSION:
            found = version.decode(errors="replace")
            remedy = f"write a newer one; run: rosbag filter {file} NEW.bag True"
            raise DamageError(f"it is a ROS 1 bag of version {found}; version 2.0 is read", remedy)
        self._first = len(first)
        if self.header.kind != _BAG_HEADER:
            raise DamageError("the bag does not begin with its header", self.remedy)
        if encryptor := self.header.text("encryptor"):
            remedy = f"decrypt it; run: rosbag decrypt {file}"
            raise DamageError(f"the bag is encrypted with {encryptor}", remedy)
        if not self._index_start:
            raise DamageError("the bag is not indexed", f"the bag was not closed; {self.remedy}")

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    @cached_property
    def header(self) -> _Record:
        """The bag's header."""
        return self.record(self._first)

    @property
    def _index_start(self) -> int:
        return self.header.value("index_pos", "<Q")

    def channels(self) -> dict[int, Channel]:
        """Return the channels, from the index at the end of the bag."""
        scan = _Scan(self)
        for record in self._records(self._index_start):
            if record.kind == _CONNECTION:
                scan.take(record)
        return scan.contents.channels

    def scan(self) -> Contents:
        """Return the contents of the whole bag."""
        scan = _Scan(self)
        for record in self._records(self._first):
            scan.take(record)
        return scan.finished()

    def payload(self, chunk: int, start: int, size: int) -> bytes:
        """Return a message."""
        return self.chunk(chunk)[start : start + size]

    def read(self, start: int, size: int) -> bytes:
        """Return bytes of the file."""
        self._file.seek(start)
        data = self._file.read(size)
        if len(data) != size:
            reason = f"the bag is cut off: byte {start + len(data)} is missing"
            raise DamageError(reason, f"copy the bag again, or keep the rest; {self.remedy}")
        return data

    def record(self, start: int) -> _Record:
        """Return the record at a byte of the file, without its data."""
        (size,) = _WORD.unpack(self.read(start, _WORD.size))
        if size > _MOST_HEADER_BYTES:
            raise DamageError(f"the record at byte {start} has a header of {size} bytes")
        data = self.read(start + _WORD.size, size + _WORD.size)
        return _Record(_fields(data[:size]), start + _COUNT.size + size, *_WORD.unpack(data[size:]))

    def _records(self, start: int) -> Iterator[_Record]:
        while start < self._bytes:
            record = self.record(start)
            start = record.start + record.size
            if start > self._bytes:
                self.read(record.start, record.size)
            yield record

    def _chunk(self, start: int) -> bytes:
        """Return the content of the chunk whose record begins at a byte."""
        record = self.record(start)
        data = self.read(record.start, record.size)
        return decompressed(data, record.text("compression", "none"), record.value("size"))


@dataclass
class _Scan:
    """The records of a bag read so far; later copies of a connection must be equal."""

    file: Ros1File
    contents: Contents = field(default_factory=Contents)
    # The messages of the last chunk by connection: stamp and place of each record.
    last: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    # The numbers of messages in each chunk by connection, found and stated.
    found: dict[int, Counter[int]] = field(default_factory=dict)
    stated: dict[int, Counter[int]] = field(default_factory=dict)

    def take(self, record: _Record) -> None:
        """Read a record outside of chunks."""
        try:
            match record.kind:
                case 3:
                    pass
                case 4:
                    self._index(record)
                case 5:
                    self._chunk(record)
                case 6:
                    self._chunk_info(record)
                case 7:
                    self._connection(record, self.file.read(record.start, record.size))
                case kind:
                    raise DamageError(f"the record at byte {record.start} has the unknown kind {kind}")
        except (struct.error, UnicodeDecodeError) as error:
            raise DamageError(f"the record before byte {record.start} is damaged: {error}") from error

    def finished(self) -> Contents:
        """Return the contents after the last record, compared with the index of chunks and the bag's header."""
        self.contents.check_channels()
        expected = sum(self.stated.values(), Counter[int]())
        self.contents.check_counts(expected, "the bag's index")
        header = self.file.header
        for name, stated, found in (
            ("chunks", header.value("chunk_count"), len(self.found)),
            ("connections", header.value("conn_count"), len(self.contents.channels)),
        ):
            if stated != found:
                raise DamageError(f"the bag has {found} {name}, but its header states {stated}")
        if wrong := [at for at in {*self.found, *self.stated} if self.found.get(at) != self.stated.get(at)]:
            reason = f"the chunk at byte {min(wrong)} and the bag's index have different numbers of messages"
            raise DamageError(reason)
        return self.contents

    def _connection(self, record: _Record, data: bytes) -> None:
        number, topic = record.value("conn"), _normal(record.text("topic"))
        own = _Record(_fields(data), record.start, record.size)
        definition, sum_ = own.text("message_definition"), own.text("md5sum")
        language = "ros1msg" if definition or sum_ == _EMPTY_SUM else ""
        channel = Channel(topic, _normal_type(own.text("type")), "ros1", language, definition, sum_)
        if self.contents.channels.setdefault(number, channel) != channel:
            raise DamageError(f"the copies of the connection {number} of topic {topic} differ")

    def _chunk(self, record: _Record) -> None:
        start = record.start - _WORD.size - _header_bytes(record)
        content = self.file.chunk(start)
        self.last = defaultdict(list)
        at = 0
        while at < len(content):
            inner = _record_in(content, at, start)
            if inner.kind == _MESSAGE_DATA:
                connection, stamp = inner.value("conn"), inner.stamp("time")
                self.last[connection].append((stamp, at))
                self.contents.index.add(connection, stamp, start, inner.start, inner.size)
            elif inner.kind == _CONNECTION:
                self._connection(inner, content[inner.start : inner.start + inner.size])
            else:
                raise DamageError(f"the chunk at byte {start} contains the unknown kind {inner.kind}")
            at = inner.start + inner.size
        self.found[start] = Counter({connection: len(items) for connection, items in self.last.items()})

    def _index(self, record: _Record) -> None:
        connection, data = record.value("conn"), self.file.read(record.start, record.size)
        found = sorted((_nanoseconds(seconds, rest), at) for seconds, rest, at in _INDEX.iter_unpack(data))
        if [stamp for stamp, _ in found] != sorted(stamp for stamp, _ in self.last.get(connection, [])):
            name = self.contents.channels[connection].topic if connection in self.contents.channels else connection
            reason = f"the index before byte {record.start} and its chunk differ in topic {name}"
            raise DamageError(reason)

    def _chunk_info(self, record: _Record) -> None:
        counts = _COUNT.iter_unpack(self.file.read(record.start, record.size))
        self.stated[record.value("chunk_pos", "<Q")] = +Counter(dict(counts))


def _record_in(content: bytes, start: int, chunk: int) -> _Record:
    """Return a record in the content of the chunk at a byte of the file."""
    (header,) = _WORD.unpack_from(content, start)
    middle = start + _WORD.size + header
    (size,) = _WORD.unpack_from(content, middle)
    first = middle + _WORD.size
    if first + size > len(content):
        raise DamageError(f"byte {start} of the chunk at byte {chunk} begins a record that is cut off")
    return _Record(_fields(content[start + _WORD.size : middle]), first, size)


def _fields(data: bytes) -> dict[str, bytes]:
    """Return the fields of a header. Raise `struct.error` or `DamageError` if it is damaged."""
    found, at = {}, 0
    while at < len(data):
        (size,) = _WORD.unpack_from(data, at)
        name, equals, value = data[at + _WORD.size : at + _WORD.size + size].partition(b"=")
        at += _WORD.size + size
        if not equals or at > len(data):
            raise struct.error("a field of the header is cut off")
        found[name.decode()] = value
    return found


def _header_bytes(record: _Record) -> int:
    """Return the size of a record's header with the word before it."""
    return _WORD.size + sum(_WORD.size + len(name.encode()) + 1 + len(value) for name, value in record.fields.items())


def _nanoseconds(seconds: int, rest: int) -> int:
    return seconds * 10**9 + rest


def _normal(topic: str) -> str:
    """Return a topic without empty parts."""
    parts = "/".join(part for part in topic.split("/") if part)
    return f"/{parts}" if topic.startswith("/") else parts


def _normal_type(name: str) -> str:
    """Return the type in the form of ROS 2: geometry_msgs/msg/Point."""
    package, slash, rest = name.partition("/")
    return name if not slash or "/" in rest else f"{package}/msg/{rest}"
