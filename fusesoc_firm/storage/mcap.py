"""Read MCAP files (https://mcap.dev/spec), with or without chunks, indexes, statistics, checksums and a profile.

The package `mcap` takes the beginning of a record that is cut off at the end of a chunk as the whole record, so it
cannot tell a loss.
"""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from fusesoc_firm.storage.compression import decompressed
from fusesoc_firm.storage.contents import Channel, Contents, DamageError

_MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQI")
_INDEX = struct.Struct("<QQ")
_FOOTER = struct.Struct("<QQI")
_STATISTICS = struct.Struct("<QHIIIIQQ")
# The size of the end of a file: the footer's record and the magic.
_END_BYTES = _RECORD.size + _FOOTER.size + len(_MAGIC)
(_HEADER, _FOOT, _SCHEMA, _CHANNEL, _MESSAGE_DATA, _CHUNK_DATA, _MESSAGE_INDEX, _CHUNK_INDEX) = range(1, 9)
_COUNTS, _DATA_END = 11, 15
_LAST_KNOWN = 15
_CHUNKS_IN_MEMORY = 4
_BLOCK_BYTES = 2**20
_RECOVER = "copy the file again, or keep the rest; run: mcap recover {}"


class _Place(NamedTuple):
    """A record: its kind, and the first byte and the size of its content."""

    kind: int
    start: int
    size: int


class McapFile:
    """An MCAP file, open for reading."""

    def __init__(self, file: Path) -> None:
        """Open a file."""
        self.remedy = _RECOVER.format(file)
        self._file = file.open("rb")
        self._bytes = file.stat().st_size
        self.chunk = lru_cache(_CHUNKS_IN_MEMORY)(self._chunk)

    def check(self) -> None:
        """Raise `DamageError` if the beginning or the end of the file is missing."""
        if self.read(0, min(len(_MAGIC), self._bytes)) != _MAGIC:
            raise DamageError("the file does not begin like an MCAP file")
        if self._bytes < _END_BYTES or self.read(self._bytes - len(_MAGIC), len(_MAGIC)) != _MAGIC:
            raise DamageError("the end of the file is missing: it was not closed or is cut off", self.remedy)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def channels(self) -> dict[int, Channel]:
        """Return the channels, from the summary if the file has one."""
        start = self._summary_start()
        if not start:
            return self.scan().channels
        scan = _Scan(self)
        try:
            for place in self._records(start):
                if place.kind in (_SCHEMA, _CHANNEL):
                    scan.take(place)
        except DamageError:  # a summary may repeat channels without their schemas
            scan.contents.channels.clear()
        return scan.contents.channels or self.scan().channels

    def scan(self) -> Contents:
        """Return the contents of the whole file."""
        scan = _Scan(self)
        for place in self._records(len(_MAGIC)):
            scan.take(place)
        self._check_summary()
        return scan.finished()

    def payload(self, chunk: int, start: int, size: int) -> bytes:
        """Return a message."""
        return self.chunk(chunk)[start : start + size] if chunk else self.read(start, size)

    def read(self, start: int, size: int) -> bytes:
        """Return bytes of the file."""
        self._file.seek(start)
        data = self._file.read(size)
        if len(data) != size:
            raise DamageError(f"byte {start + len(data)} is missing")
        return data

    def sum(self, first: int, stop: int, start: int = 0) -> int:
        """Return the checksum of bytes of the file, continued from another checksum."""
        for at in range(first, stop, _BLOCK_BYTES):
            start = zlib.crc32(self.read(at, min(_BLOCK_BYTES, stop - at)), start)
        return start

    def _records(self, start: int) -> Iterator[_Place]:
        """Yield the records from a byte of the file up to the footer."""
        end = self._bytes - len(_MAGIC)
        while True:
            if start + _RECORD.size > end:
                raise DamageError(f"the file has no footer before byte {end}")
            place = _place(self.read(start, _RECORD.size), start, end)
            yield place
            start = place.start + place.size
            if place.kind == _FOOT:
                if start != end:
                    raise DamageError(f"data follows the footer at byte {start}")
                return

    def _chunk(self, start: int) -> bytes:
        """Return the content of the chunk whose record has its content at a byte."""
        _, size = _RECORD.unpack(self.read(start - _RECORD.size, _RECORD.size))
        data = self.read(start, size)
        _, _, expanded, crc = _CHUNK.unpack_from(data)
        at = _CHUNK.size
        form, at = _text(data, at)
        (size,) = struct.unpack_from("<Q", data, at)
        content = decompressed(_part(data, at + 8, size), form, expanded)
        if crc and zlib.crc32(content) != crc:
            raise DamageError(f"the checksum of the chunk at byte {start} is wrong")
        return content

    def _summary_start(self) -> int:
        kind, size = _RECORD.unpack(self.read(self._bytes - _END_BYTES, _RECORD.size))
        if (kind, size) != (_FOOT, _FOOTER.size):
            return 0
        summary: int = _FOOTER.unpack(self.read(self._bytes - _END_BYTES + _RECORD.size, _FOOTER.size))[0]
        return summary

    def _check_summary(self) -> None:
        stop = self._bytes - len(_MAGIC) - 4
        (crc,) = struct.unpack("<I", self.read(stop, 4))
        if crc and (start := self._summary_start()) and self.sum(start, stop) != crc:
            raise DamageError("the checksum of the summary is wrong")


@dataclass
class _Scan:
    """The records of a file read so far; later copies of a record must be equal."""

    file: McapFile
    contents: Contents = field(default_factory=Contents)
    schemas: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    records: dict[int, tuple[int, Channel]] = field(default_factory=dict)
    # The messages of the last chunk by channel: stamp and place of each record.
    last: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    chunks: list[int] = field(default_factory=list)
    indexed: list[int] = field(default_factory=list)
    counts: dict[int, int] | None = None
    total: int | None = None
    unknown: _Place | None = None

    def __post_init__(self) -> None:
        """Prepare a reader for each kind of record that counts."""
        self.readers: dict[int, Callable[[_Place, bytes], None]] = {
            _HEADER: self._pass,
            _FOOT: self._pass,
            _SCHEMA: self._schema,
            _CHANNEL: self._channel,
            _MESSAGE_DATA: self._message,
            _CHUNK_DATA: self._chunk,
            _MESSAGE_INDEX: self._message_index,
            _CHUNK_INDEX: self._chunk_index,
            _COUNTS: self._statistics,
            _DATA_END: self._data_end,
        }

    def take(self, place: _Place) -> None:
        """Read a record outside of chunks."""
        if place.kind not in self.readers:
            # Attachments and metadata are known, but do not count.
            if not 0 < place.kind <= _LAST_KNOWN:
                self.unknown = self.unknown or place
            return
        try:
            # A chunk is read where it is decompressed.
            data = b"" if place.kind == _CHUNK_DATA else self.file.read(place.start, place.size)
            self.readers[place.kind](place, data)
        except (struct.error, UnicodeDecodeError) as error:
            reason = f"the record at byte {place.start - _RECORD.size} is damaged: {error}"
            raise DamageError(reason) from error

    def finished(self) -> Contents:
        """Return the contents after the last record, compared with the statistics and the index of chunks."""
        self.contents.check_channels()
        if self.counts:
            self.contents.check_counts(self.counts, "the file's statistics")
        if self.total is not None and self.total != len(self.contents.index):
            reason = f"the file has {len(self.contents.index)} messages, but its statistics state {self.total}"
            raise DamageError(reason)
        if self.total is None and self.unknown:
            at = self.unknown.start - _RECORD.size
            reason = f"the record at byte {at} is of the unknown kind {self.unknown.kind}, and the file has no"
            raise DamageError(f"{reason} statistics that show whether it is a message")
        if self.indexed and sorted(self.indexed) != self.chunks:
            reason = f"the file has {len(self.chunks)} chunks, and an index of {len(self.indexed)} others"
            raise DamageError(reason)
        return self.contents

    def _pass(self, _place: _Place, _data: bytes) -> None:
        pass

    def _schema(self, _place: _Place, data: bytes) -> None:
        (number,) = struct.unpack_from("<H", data)
        name, at = _text(data, 2)
        language, at = _text(data, at)
        (size,) = struct.unpack_from("<I", data, at)
        content = _part(data, at + 4, size)
        # Schemas in other languages may be binary.
        schema = name, language, content.decode(errors="strict" if language.startswith("ros") else "replace")
        self._check_copy(f"schema {number}", self.schemas.setdefault(number, schema), schema)

    def _channel(self, _place: _Place, data: bytes) -> None:
        number, schema = struct.unpack_from("<HH", data)
        topic, at = _text(data, 4)
        encoding, at = _text(data, at)
        (size,) = struct.unpack_from("<I", data, at)
        end, notes = at + 4 + size, {}
        at += 4
        while at < end:
            key, at = _text(data, at)
            notes[key], at = _text(data, at)
        if schema and schema not in self.schemas:
            raise DamageError(f"the schema {schema} of topic {topic} is missing")
        type_, language, definition = self.schemas.get(schema, ("", "", ""))
        channel = Channel(topic, type_, encoding, language, definition, notes.get("topic_type_hash", ""))
        self._check_copy(f"channel {number}", self.contents.channels.setdefault(number, channel), channel)

    def _check_copy(self, name: str, first: object, other: object) -> None:
        if first != other:
            raise DamageError(f"the copies of {name} differ")

    def _message(self, place: _Place, data: bytes) -> None:
        channel, _, stamp, _ = _MESSAGE.unpack_from(data)
        self.contents.index.add(channel, stamp, 0, place.start + _MESSAGE.size, place.size - _MESSAGE.size)

    def _chunk(self, place: _Place, _data: bytes) -> None:
        """Read the records of a chunk."""
        content = self.file.chunk(place.start)
        self.chunks.append(place.start - _RECORD.size)
        self.last = defaultdict(list)
        start, end, within = 0, len(content), f" of the chunk at byte {place.start}"
        while start < end:
            inner = _place(content[start : start + _RECORD.size], start, end, within)
            if inner.kind == _MESSAGE_DATA:
                channel, _, stamp, _ = _MESSAGE.unpack_from(content, inner.start)
                if inner.size < _MESSAGE.size:
                    raise DamageError(f"a message in the chunk at byte {place.start} is cut off")
                self.last[channel].append((stamp, start))
                first, size = inner.start + _MESSAGE.size, inner.size - _MESSAGE.size
                self.contents.index.add(channel, stamp, place.start, first, size)
            elif inner.kind in (_SCHEMA, _CHANNEL):
                self.readers[inner.kind](inner, content[inner.start : inner.start + inner.size])
            else:
                self.unknown = self.unknown or place
            start = inner.start + inner.size

    def _message_index(self, place: _Place, data: bytes) -> None:
        channel, size = struct.unpack_from("<HI", data)
        found = sorted(_INDEX.iter_unpack(_part(data, 6, size)))
        if found != sorted(self.last.get(channel, [])):
            name = self.contents.channels[channel].topic if channel in self.contents.channels else str(channel)
            reason = f"the index at byte {place.start - _RECORD.size} and the chunk before it differ in {name}"
            raise DamageError(reason)

    def _chunk_index(self, _place: _Place, data: bytes) -> None:
        self.indexed.append(struct.unpack_from("<QQQ", data)[2])

    def _statistics(self, _place: _Place, data: bytes) -> None:
        self.total = _STATISTICS.unpack_from(data)[0]
        (size,) = struct.unpack_from("<I", data, _STATISTICS.size)
        self.counts = dict(struct.iter_unpack("<HQ", _part(data, _STATISTICS.size + 4, size)))

    def _data_end(self, place: _Place, data: bytes) -> None:
        """Compare the checksum of the data; writers differ in whether it includes the magic."""
        (crc,) = struct.unpack_from("<I", data)
        if crc:
            end = place.start - _RECORD.size
            sums = [self.file.sum(len(_MAGIC), end, start) for start in (zlib.crc32(_MAGIC), 0)]
            if crc not in sums:
                raise DamageError("the checksum of the data is wrong")


def _place(head: bytes, at: int, end: int, within: str = "") -> _Place:
    """Return the record with a head at byte `at` of a file, or of its part `within`, which ends at `end`."""
    if len(head) < _RECORD.size:
        raise DamageError(f"the record at byte {at}{within} is cut off")
    kind, size = _RECORD.unpack(head)
    start = at + _RECORD.size
    if size > end - start:
        raise DamageError(f"the record at byte {at}{within} states {size} bytes, but {end - start} follow")
    return _Place(kind, start, size)


def _part(data: bytes, start: int, size: int) -> bytes:
    """Return a part of a record. Raise `struct.error` if it is cut off."""
    if start + size > len(data):
        raise struct.error(f"{size} bytes are stated, but {max(0, len(data) - start)} follow")
    return data[start : start + size]


def _text(data: bytes, start: int) -> tuple[str, int]:
    """Return a text with its size before it, and the byte after it."""
    (size,) = struct.unpack_from("<I", data, start)
    return _part(data, start + 4, size).decode(), start + 4 + size
