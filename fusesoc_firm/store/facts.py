"""Facts that an answer follows from: each a kind, a name and the state that was found when it was first looked at.

    file        the SHA-256 of its content
    part        of a file of which a part was read: its size and time
    folder      which names are in it
    code        of our own files
    program     the file that the PATH leads to, its size and time

As long as all facts have these states, whatever follows from them is the same. An answer from the store waits for this
module, so it imports only what that takes.
"""

from __future__ import annotations

import os
from collections.abc import Iterable

from fusesoc_firm.store import own_code
from fusesoc_firm.store.layout import digest, digest_of
from fusesoc_firm.text.files import read_file

Fact = tuple[str, str, str | None]
"""Kind, name and state; None as the state of what is not there."""


def facts(kind: str, names: Iterable[str]) -> list[Fact]:
    """These facts in their present state."""
    return [(kind, name, state(kind, name)) for name in names]


def state(kind: str, name: str) -> str | None:
    """The present state of a fact; None if what it is of is not there. Raises `ValueError` for an impossible name."""
    if kind == "file":
        content = read_file(name)
        return None if content is None else digest(content)
    if kind == "part":
        return _part(name)
    if kind == "folder":
        return _folder(name)
    if kind == "code":
        return own_code.state()
    if kind == "program":
        return _program(name)
    # That of another version of this module.
    return None


def _folder(path: str) -> str | None:
    try:
        with os.scandir(path) as entries:
            return digest_of(sorted([entry.name, entry.is_dir()] for entry in entries))
    except OSError:
        return None


def _part(path: str) -> str | None:
    try:
        status = os.stat(path)
    except OSError:
        return None
    return f"{status.st_size} {status.st_mtime_ns}"


def _program(name: str) -> str | None:
    for folder in os.environ.get("PATH", os.defpath).split(os.pathsep):
        path = os.path.join(folder, name)
        if os.path.isfile(path) and os.access(path, os.X_OK):
            status = os.stat(path)
            return f"{os.path.realpath(path)} {status.st_size} {status.st_mtime_ns}"
    return None
