"""The facts that determine the result of a call; each has a kind, a name and its state at the first read.

    file        the SHA-256 of the content
    part        the size and time of a file that was read in part
    folder      the names in the folder
    code        the state of this package's own files
    program     the path, size and time of the file on the PATH

If no state changes, the result is unchanged. Every hit loads this module, so it imports as little as possible.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence

from fusesoc_firm.text.files import read_file
from fusesoc_firm.tools import own_code
from fusesoc_firm.tools.digests import digest, digest_of

# Python adds this folder beside each imported module.
_BYTE_CODE = "__pycache__"

Fact = tuple[str, str, str | None]
"""The kind, name and state of a fact; the state of a missing object is None."""

StateOf = Callable[[str, str], str | None]
"""A function that returns the current state of the fact with this kind and name."""


def facts(kind: str, names: Iterable[str]) -> list[Fact]:
    """Return the facts of one kind in their current states."""
    return [(kind, name, state(kind, name)) for name in names]


def hold(noted: Iterable[Sequence[str | None]], state_of: StateOf) -> bool:
    """Return whether all facts are in their noted states."""
    return all(state_of(str(kind), str(name)) == was for kind, name, was in noted)


def state(kind: str, name: str) -> str | None:
    """Return a fact's current state, or None if the object is missing. Raise `ValueError` for an impossible name."""
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
    # The kind is from another version of this module.
    return None


def _folder(path: str) -> str | None:
    try:
        with os.scandir(path) as entries:
            return digest_of(sorted([entry.name, entry.is_dir()] for entry in entries if entry.name != _BYTE_CODE))
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
