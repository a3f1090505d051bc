"""Read the SQLite files of ROS 2 bags, of all versions of their tables."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from fusesoc_firm.storage.contents import Channel, Contents, DamageError

_MAGIC = b"SQLite format 3\0"
_HEADER_BYTES = 100
_TABLES = ("topics", "messages")
_RECOVER = "copy the bag again, or recover the rest; run: sqlite3 {} .recover"
# The files in which SQLite holds changes that are not in the database yet, with the command that ends them.
_JOURNALS = {"-wal": "pragma wal_checkpoint(truncate)", "-journal": "pragma integrity_check"}


class SqliteFile:
    """An SQLite file, open for reading."""

    def __init__(self, file: Path) -> None:
        """Open a file."""
        self._file = file
        self.remedy = _RECOVER.format(file)
        self._database = sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro&immutable=1", uri=True)

    def check(self) -> None:
        """Raise `DamageError` if messages are missing from the file, or if its tables are not those of a bag."""
        file = self._file
        for suffix, command in _JOURNALS.items():
            journal = file.with_name(f"{file.name}{suffix}")
            if journal.exists() and journal.stat().st_size:
                reason = f"messages are still in the journal {journal.name}"
                raise DamageError(reason, f"the bag was not closed; run: sqlite3 FILE '{command}'")
        size, expected = file.stat().st_size, _stated_size(file)
        if size < expected:
            # SQLite would read zeros in place of a missing end.
            raise DamageError(f"the file is cut off: it has {size} of {expected} bytes", self.remedy)
        if missing := [name for name in _TABLES if name not in self._tables]:
            raise DamageError(f"the database has no table '{missing[0]}', so it is not a bag")

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def channels(self) -> dict[int, Channel]:
        """Return the channels."""
        definitions = {}
        if "message_definitions" in self._tables:
            for row in self._named_rows("message_definitions"):
                language, text = _text(row, "encoding"), _text(row, "encoded_message_definition")
                # rosbag2 writes an unknown definition as an empty text in an empty language.
                definitions[_text(row, "topic_type")] = (language, text) if language else ("", "")
        channels = {}
        for row in self._named_rows("topics"):
            type_, encoding = _text(row, "type"), _text(row, "serialization_format")
            found = definitions.get(type_, ("", ""))
            digest = _text(row, "type_description_hash") if "type_description_hash" in row else ""
            channels[_number(row["id"])] = Channel(_text(row, "name"), type_, encoding, *found, digest)
        return channels

    def scan(self) -> Contents:
        """Return the contents of the whole file."""
        self._check_integrity()
        contents = Contents(self.channels())
        for key, topic, stamp, size in self._rows(
            "select rowid, topic_id, timestamp, length(data) from messages order by rowid"
        ):
            contents.index.add(_number(topic), _number(stamp), 0, _number(key), _number(size))
        contents.check_channels()
        return contents

    def payload(self, _chunk: int, start: int, _size: int) -> bytes:
        """Return a message."""
        for (data,) in self._rows("select data from messages where rowid = ?", start):
            if isinstance(data, bytes):
                return data
        raise DamageError(f"the message in row {start} is missing")

    def metadata(self) -> str:
        """Return the text of the newest metadata in the file, or an empty text."""
        if "metadata" not in self._tables:
            return ""
        newest = "select metadata from metadata order by rowid desc limit 1"
        return next((row[0] for row in self._rows(newest) if isinstance(row[0], str)), "")

    @cached_property
    def _tables(self) -> set[str]:
        # A name for a view or a virtual table could stand for anything.
        rows = self._rows("select name from sqlite_master where type = 'table' and rootpage > 0")
        return {str(row[0]) for row in rows}

    def _check_integrity(self) -> None:
        """Raise `DamageError` if the tables are damaged, or differ from their indexes."""
        for (found,) in self._rows("pragma integrity_check(1)"):
            if found != "ok":
                reason = " ".join(str(found).removeprefix("*** in database main ***").split())
                raise DamageError(f"the database is damaged: {reason}")

    def _named_rows(self, table: str) -> Iterator[dict[str, Any]]:
        names = [row[1] for row in self._rows(f"pragma table_info({table})")]
        for row in self._rows(f"select * from {table}"):
            yield dict(zip(names, row, strict=True))

    def _rows(self, query: str, *values: int) -> Iterator[tuple[Any, ...]]:
        try:
            yield from self._database.execute(query, values)
        except (sqlite3.Error, OverflowError) as error:
            raise DamageError(f"the database cannot be read: {error}") from error


def _stated_size(file: Path) -> int:
    """Return the size in bytes according to a file's header (SQLite's file format, 1.3), or 0 if it is unknown."""
    with file.open("rb") as opened:
        header = opened.read(_HEADER_BYTES)
    if not header.startswith(_MAGIC):
        raise DamageError("the file does not begin like an SQLite file")
    # If these numbers differ, an old writer has not updated the number of pages.
    if len(header) < _HEADER_BYTES or header[24:28] != header[92:96]:
        return 0
    # 65,536 does not fit and is encoded as 1.
    page_bytes = int.from_bytes(header[16:18], "big")
    return int.from_bytes(header[28:32], "big") * (65536 if page_bytes == 1 else page_bytes)


def _text(row: dict[str, Any], name: str) -> str:
    if not isinstance(row.get(name), str):
        raise DamageError(f"a row has {row.get(name)!r} as its {name}, which must be a text")
    return str(row[name])


def _number(value: object) -> int:
    if not isinstance(value, int) or value < 0:
        raise DamageError(f"a row has {value!r} as a number of a message")
    return value
