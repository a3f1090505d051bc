"""What lies in the store, and how: `store` says what is kept there, `recall` answers from it in a hurry.

    <root>/v3/<first two digits>/<key>.entry                     generated files
    <root>/v3/<first two digits>/<digest of a request>.uses      names of our own files that made it
    <root>/v3/<first two digits>/<digest of a call>.call         what decided the answer to a call, and its key
    <root>/v3/<first two digits>/<digest of a request>.lock      held while an entry is made

Each but the lock is a line with the SHA-256 of the rest, and appears by one rename: it is whole, or not there. An entry
goes on with a line of JSON (what was asked for, names, lengths) and the contents; the others are JSON.

Of Python's library no more is imported than that needs.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping

from fusesoc_firm.files import read_file, write_whole

LAYOUT = "v3"
ENTRY, USES, CALL, LOCK = ".entry", ".uses", ".call", ".lock"
KEPT = (ENTRY, USES, CALL)
"""The endings of what is kept; what is used less goes first."""


def default_root(environment: Mapping[str, str] = os.environ) -> str:
    """FUSESOC_FIRM_CACHE, else `fusesoc_firm` in XDG_CACHE_HOME, else in ~/.cache; absolute."""
    if chosen := environment.get("FUSESOC_FIRM_CACHE"):
        return os.path.abspath(os.path.expanduser(chosen))
    base = environment.get("XDG_CACHE_HOME") or "~/.cache"
    return os.path.join(os.path.abspath(os.path.expanduser(base)), "fusesoc_firm")


def place(root: str | os.PathLike[str], digest: str, suffix: str) -> str:
    """Where something of the store in `root` lies."""
    return os.path.join(root, LAYOUT, digest[:2], digest + suffix)


def write(path: str | os.PathLike[str], data: bytes) -> None:
    """Keep data under its digest. Raises `OSError`."""
    write_whole(path, digest(data).encode() + b"\n" + data)


def read(path: str | os.PathLike[str]) -> bytes | None:
    """What was kept; None if it is not there or not whole."""
    found = read_file(path)
    if found is None:
        return None
    said, _, data = found.partition(b"\n")
    return data if digest(data).encode() == said else None


def write_json(path: str | os.PathLike[str], data: object) -> None:
    """Keep plain data. Raises `OSError`."""
    write(path, json.dumps(data).encode())


def read_json(path: str | os.PathLike[str]) -> object:
    """Plain data that was kept; None if it is not there or not whole."""
    data = read(path)
    return None if data is None else json.loads(data)


def write_entry(path: str | os.PathLike[str], about: Mapping[str, str], files: Mapping[str, bytes]) -> None:
    """Keep generated files, and what was asked for. Raises `OSError`."""
    header = {"about": dict(about), "files": [[name, len(content)] for name, content in files.items()]}
    write(path, b"".join([json.dumps(header).encode(), b"\n", *files.values()]))


def read_entry(path: str | os.PathLike[str]) -> tuple[dict[str, str], dict[str, bytes]] | None:
    """What was asked for, and the files in the order they were made; None if the entry is not there or not whole."""
    data = read(path)
    if data is None:
        return None
    line, _, contents = data.partition(b"\n")
    header = json.loads(line)
    files, start = {}, 0
    for name, length in header["files"]:
        files[name] = contents[start : start + length]
        start += length
    return header["about"], files


def mark_used(*paths: str | os.PathLike[str]) -> None:
    """Note that these were used now, as far as the store can be written."""
    for path in paths:
        try:
            os.utime(path)
        except OSError:
            # What can only be read is used all the same.
            return


def digest_of(data: object) -> str:
    """The SHA-256 of plain data."""
    return digest(json.dumps(data, sort_keys=True).encode())


def digest(data: bytes) -> str:
    """The SHA-256 of bytes."""
    return hashlib.sha256(data).hexdigest()
