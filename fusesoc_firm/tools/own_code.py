"""The state of this package's files and imported packages, on which all generated output depends.

Every hit loads this module, so it imports as little as possible.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from functools import lru_cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
IMPORTED = ("chevron", "numpy", "pyyaml", "rosbags")
"""The packages that, besides our own code, affect generated text."""

# Modules, templates and data. The other folders contain cores and pages, as files or links.
_COUNTED = (".py", ".mustache", ".yaml", ".csv")
_LEFT_OUT = ("__pycache__", "demos", "docs", "library")
# File times are too coarse to distinguish two edits within this period.
_NEW_NANOSECONDS = 2 * 10**9
_STARTED = time.time_ns()
# The state from `keep_state`, empty before that call.
_kept: list[str] = []
_BELOW = f"{PACKAGE}{os.sep}"


class _Watch:
    """The state of our files after `watch`; empty if unknown, such as after this process has opened one of them."""

    is_on = False
    state = ""


_watch = _Watch()


def digest(package: Path = PACKAGE, current: str | None = None) -> str:
    """Return the SHA-256 of our files' names and contents, which is equal for all copies of the package.

    `current` is a `state` that the caller checks again after it has used the digest.
    """
    return _digest(package, current or state(package))


def state(package: Path = PACKAGE) -> str:
    """Return a value that changes when one of our files is edited, added or removed.

    The value is computed from names, sizes and times, which is much faster than `digest`. If a file is too new at the
    start of this process for a reliable time, its content is also used.
    """
    if package == PACKAGE and (known := _kept or [_watch.state])[0]:
        return known[0]
    found = []
    for name, entry in _files(str(package)):
        status = entry.stat()
        times = [status.st_mtime_ns, status.st_ctime_ns]
        content = _content(entry.path) if max(times) > _STARTED - _NEW_NANOSECONDS else ""
        found.append([name, status.st_size, *times, content])
    current = hashlib.sha256(json.dumps(sorted(found)).encode()).hexdigest()
    if package == PACKAGE and _watch.is_on:
        _watch.state = current
    return current


def watch() -> None:
    """From now on, check our files again only after this process has opened one of them.

    The output of a process depends on our files as it has read them, so later edits do not matter. Unlike
    `keep_state`, a process that generates may call this.
    """
    if not _watch.is_on:
        sys.addaudithook(_forget)
        _watch.is_on = True


def _forget(event: str, arguments: tuple[object, ...]) -> None:
    """Forget the watched state if one of our files is opened."""
    if event == "open" and _watch.state and str(arguments[0]).startswith(_BELOW):
        _watch.state = ""


def keep_state() -> None:
    """Use the current state for the rest of this process and for its copies.

    Builds then use stored results for this state even if a file is edited meanwhile. A process that generates must not
    call this.
    """
    _kept[:] = [state()]


def names(package: Path = PACKAGE) -> list[str]:
    """Return the names of our files relative to the package, sorted."""
    return sorted(name for name, _ in _files(str(package)))


@lru_cache(maxsize=1)
def _digest(package: Path, _state: str) -> str:
    """Return the digest of our files; `_state` invalidates the cache."""
    found = {name: _content(entry.path) for name, entry in _files(str(package))}
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()


def _content(path: str) -> str:
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def _files(folder: str, above: str = "") -> list[tuple[str, os.DirEntry[str]]]:
    found: list[tuple[str, os.DirEntry[str]]] = []
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(_COUNTED) and entry.is_file():
                found.append((above + entry.name, entry))
            elif entry.name not in _LEFT_OUT and entry.is_dir(follow_symlinks=False):
                found += _files(entry.path, f"{above}{entry.name}/")
    return found
