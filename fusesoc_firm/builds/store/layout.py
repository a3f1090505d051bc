"""The files in the store and their formats.

`store` decides which files to keep, and `plugin.recall` reads hits quickly.

    <root>/v4/<first two digits>/<key>.entry                 generated files
    <root>/v4/<first two digits>/<digest of a call>.call     the facts that determine a call's key, and the key
    <root>/v4/<first two digits>/<key>.lock                  held while an entry is built
    <root>/v4/<first two digits>/<key>.ac                    what `firm cache serve` serves under /ac/
    <root>/v4/<first two digits>/<SHA-256>.cas               what it serves under /cas/
    <root>/v4/<first two digits>/<digest>.remark             the last failure of a remote store

Each file except the lock begins with a line that contains the SHA-256 of the rest. A single rename creates the file, so
it is either complete or missing. In an entry, a line of JSON (the request, names and lengths) and the contents follow;
in a `.call`, JSON follows, and in other files any data.

Anyone who can write to the store can write files with correct digests. A file with unexpected content therefore counts
as damaged, like a file with a wrong digest. Examples are data of other types, and names that lead out of the output
folder.

This module imports as little of Python's standard library as possible.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from errno import EFBIG, EINVAL

from fusesoc_firm.builds.store import shared_files
from fusesoc_firm.tools.digests import digest, is_digest

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any, BinaryIO

LAYOUT = "v4"
ENTRY, CALL, LOCK, REMARK = ".entry", ".call", ".lock", ".remark"
ACTION, CONTENT = ".ac", ".cas"
KEPT = (ENTRY, CALL, ACTION, CONTENT)
"""The endings of the files that are kept; the least recently used files are removed first."""

MOST_PLAIN_BYTES = 2**24
MOST_BYTES = 2**30
"""The size limits for plain data and for all other files, since each file is read in one piece."""

_DIGEST_BYTES = 64
_PART_BYTES = 2**16
# The limits that file systems impose.
_LONGEST_NAME_BYTES, _LONGEST_PATH_BYTES = 255, 4000
_FACT_PARTS, _FILE_PARTS = 3, 2
# The keys in a call's note.
_WORDS = ("name", "core", "marks")


def place(digest: str, suffix: str) -> str:
    """Return the path, relative to the store's root, of the file for a digest."""
    return f"{LAYOUT}/{digest[:2]}/{digest}{suffix}"


def write(root: str, name: str, data: bytes, most: int = 0) -> None:
    """Write data with its digest to the store; `most` replaces the size limit of such files. May raise `OSError`."""
    whole = digest(data).encode() + b"\n" + data
    if len(whole) > (most or _most(name)):
        raise OSError(EFBIG, os.strerror(EFBIG))
    shared_files.write_whole(root, name, whole)


def write_json(root: str, name: str, data: object) -> None:
    """Write plain data as JSON to the store. May raise `OSError`."""
    write(root, name, json.dumps(data).encode())


def entry_data(about: Mapping[str, str], files: Mapping[str, bytes]) -> bytes:
    """Return the data of an entry: a description of the request, and generated files."""
    header = {"about": dict(about), "files": [[path, len(content)] for path, content in files.items()]}
    return b"".join([json.dumps(header).encode(), b"\n", *files.values()])


def read(root: str, name: str, most: int = 0) -> bytes | None:
    """Return the data in a file after the digest, or None if the file is missing or damaged; `most` as for `write`."""
    found = shared_files.read(root, name, most or _most(name))
    if found is None:
        return None
    said, _, data = found.partition(b"\n")
    return data if digest(data).encode() == said else None


@contextmanager
def opened(root: str, name: str) -> Iterator[tuple[BinaryIO, int]]:
    """Provide an undamaged file, at the beginning of its data, and the number of bytes of the data.

    Raise `OSError` if the file is missing or damaged. The file is read in parts, unlike by `read`.
    """
    with shared_files.opened(root, name) as file:
        said = file.read(_DIGEST_BYTES + 1)
        found = hashlib.sha256()
        while part := file.read(_PART_BYTES):
            found.update(part)
        size = file.tell() - len(said)
        is_named = not name.endswith(CONTENT) or name == place(found.hexdigest(), CONTENT)
        if said != f"{found.hexdigest()}\n".encode() or size > _most(name) or not is_named:
            raise OSError(EINVAL, "the file is damaged")
        file.seek(len(said))
        yield file, size


def receive(root: str, name: str, parts: Iterable[bytes]) -> None:
    """Write data that come in parts with their digest to the store.

    Raise `ValueError` if a content has another name, and `OSError`.
    """
    with shared_files.writing(root, name) as file:
        file.write(b"0" * _DIGEST_BYTES + b"\n")
        found = hashlib.sha256()
        for part in parts:
            found.update(part)
            file.write(part)
        if file.tell() > _most(name):
            raise OSError(EFBIG, os.strerror(EFBIG))
        if name.endswith(CONTENT) and name != place(found.hexdigest(), CONTENT):
            raise ValueError("the content has another SHA-256")
        file.seek(0)
        file.write(found.hexdigest().encode())


def read_content(root: str, name: str) -> bytes | None:
    """Return the data in a file that is named after the data's digest, or None if it is missing or damaged."""
    data = read(root, name)
    return data if data is not None and name == place(digest(data), CONTENT) else None


def read_note(root: str, name: str) -> dict[str, Any] | None:
    """Return a call's note: `key`, `facts`, `name`, `core` and `marks`, or None if the note is missing or damaged."""
    note = _plain(read(root, name))
    if not isinstance(note, dict) or not {"key", "facts", *_WORDS} <= note.keys():
        return None
    is_good = is_digest(note["key"]) and _are_printable([note[word] for word in _WORDS]) and are_facts(note["facts"])
    return note if is_good else None


def read_entry(root: str, name: str) -> tuple[dict[str, str], dict[str, bytes]] | None:
    """Return an entry's request description and files, in order of generation, or None if it is missing or damaged."""
    data = read(root, name)
    return None if data is None else entry_in(data)


def entry_in(data: bytes) -> tuple[dict[str, str], dict[str, bytes]] | None:
    """Return the description and files in an entry's data, in order of generation, or None if the data are illegal."""
    line, _, contents = data.partition(b"\n")
    header = _plain(line)
    about = header.get("about") if isinstance(header, dict) else None
    if not isinstance(header, dict) or not isinstance(about, dict) or not _are_printable([*about.values()]):
        return None
    lengths = _lengths(header.get("files"))
    if lengths is None or sum(lengths.values()) != len(contents):
        return None
    files, start = {}, 0
    for path, length in lengths.items():
        files[path] = contents[start : start + length]
        start += length
    return about, files


def is_whole(root: str, name: str) -> bool:
    """Return whether a stored file is undamaged."""
    kind = name[name.rindex(".") :]
    reads: dict[str, Callable[[str, str], object]] = {ENTRY: read_entry, CALL: read_note, CONTENT: read_content}
    return reads.get(kind, read)(root, name) is not None


def mark_used(root: str, *names: str) -> None:
    """Set the time of last use of these files to the current time, if the store is writable."""
    for name in names:
        try:
            shared_files.mark_used(root, name)
        except OSError:
            # In a read-only store, times of use are not recorded.
            return


def _most(name: str) -> int:
    return MOST_BYTES if name.endswith((ENTRY, CONTENT)) else MOST_PLAIN_BYTES


def _plain(data: bytes | None) -> object:
    """Return the data in a JSON text, or None if the text is missing, invalid, too long or nested too deeply."""
    return parsed(data) if data and len(data) <= MOST_PLAIN_BYTES else None


def parsed(data: bytes) -> object:
    """Return the data in a JSON text, or None if the text is invalid or nested too deeply."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        return None


def _are_texts(values: list[object]) -> bool:
    return all(isinstance(value, str) for value in values)


def _are_printable(values: list[object]) -> bool:
    return all(isinstance(value, str) and value.isprintable() for value in values)


def are_facts(facts: object) -> bool:
    """Return whether a value is a list of facts, each with a kind, a name and a state."""
    return isinstance(facts, list) and all(
        isinstance(fact, list) and len(fact) == _FACT_PARTS and _are_texts(fact[:2]) for fact in facts
    )


def _lengths(listed: object) -> dict[str, int] | None:
    """Return the length of each file by path, or None if a length or a path is illegal."""
    lengths: dict[str, int] = {}
    for item in listed if isinstance(listed, list) else [None]:
        if not isinstance(item, list) or len(item) != _FILE_PARTS or type(item[1]) is not int or item[1] < 0:
            return None
        if not is_path(item[0]) or item[0] in lengths:
            return None
        lengths[item[0]] = item[1]
    return lengths if lengths.keys().isdisjoint(_folders(lengths)) else None


def is_path(path: object) -> bool:
    """Return whether a value is a relative path that leads directly to a file below its base folder."""
    if not isinstance(path, str):
        return False
    try:
        parts = [os.fsencode(part) for part in path.split("/")]
    except UnicodeEncodeError:
        return False
    return sum(map(len, parts)) <= _LONGEST_PATH_BYTES and not any(
        part in (b"", b".", b"..") or b"\0" in part or len(part) > _LONGEST_NAME_BYTES for part in parts
    )


def _folders(paths: Iterable[str]) -> set[str]:
    """Return all parent folders of these paths."""
    return {path[:place] for path in paths for place, letter in enumerate(path) if letter == "/"}
