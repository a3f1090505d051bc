"""Record the files and folders that this process reads, with their states, by Python's audit hooks (PEP 578).

The key must cover everything that a generator reads; otherwise an edit would go unnoticed. Five groups are not
recorded: Python and its installed packages, whose versions are part of the key; this package, whose files have a
separate digest; texts that are kept of installed packages (`texts_folder`); the machine's `/dev`, `/etc`, `/proc` and
`/sys`; and files that other programs read.

If a file, such as a bag, is too large to be a whole input, its reader reads parts and declares this with `in_part`.
Each `Part` is then an input; a repeated call is a hit while the file's size and time are unchanged.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.util import source_from_cache
from pathlib import Path

from fusesoc_firm.tools.digests import texts_folder
from fusesoc_firm.tools.facts import Fact, state
from fusesoc_firm.tools.own_code import PACKAGE

# The audit events whose first argument is a path.
_OF_FILES = ("open", "sqlite3.connect")
_OF_FOLDERS = ("os.listdir", "os.scandir")
_OF_TEMPORARY = ("tempfile.mkdtemp", "tempfile.mkstemp")
_MACHINE = ("/dev", "/etc", "/proc", "/sys")
_PATHS_OF_PYTHON = ("stdlib", "platstdlib", "purelib", "platlib")
# The names of folders with installed packages, including Debian's and each user's.
_PACKAGE_FOLDERS = ("site-packages", "dist-packages")


@cache
def _apart() -> tuple[str, ...]:
    """Return the folders that are not recorded; call this before the hook needs it, since `sysconfig` reads files."""
    paths = sysconfig.get_paths()
    return (*_MACHINE, str(PACKAGE), *(paths[name] for name in _PATHS_OF_PYTHON), sys.executable)


@dataclass(frozen=True)
class Part:
    """One part that was read from the file or folder at `path`; each part has a distinct name."""

    path: Path
    name: str
    content: bytes


Input = Path | Part
"""An input of a generator: a whole file, or part of a file."""


@dataclass
class Reads:
    """The absolute paths that were read, in order, each with its state before the first read.

    `parts` are files that were read in part. Files in `apart` and in new temporary folders are not recorded, unless
    they are in `kept`. `python_path` lists the folders in which Python finds packages.
    """

    files: dict[str, str | None] = field(default_factory=dict)
    parts: dict[str, str | None] = field(default_factory=dict)
    folders: dict[str, str | None] = field(default_factory=dict)
    apart: list[str] = field(default_factory=lambda: [*_apart(), texts_folder(os.environ)])
    kept: tuple[str, ...] = ()
    python_path: tuple[str, ...] = field(default_factory=lambda: tuple(filter(None, sys.path)))

    def note_file(self, path: str) -> None:
        """Record a file that is about to be read."""
        _note_state(self.files, "file", path)

    def facts(self) -> list[Fact]:
        """Return the facts for all recorded files, parts and folders."""
        kinds = {"file": self.files, "part": self.parts, "folder": self.folders}
        return [(kind, path, was) for kind, found in kinds.items() for path, was in found.items()]


# The active records; the innermost record is last.
_current: list[Reads] = []
# Absolute paths of the files that are being read in part.
_partly: list[set[str]] = []


@contextmanager
def noted(reads: Reads) -> Iterator[None]:
    """Add everything that is read within this context to `reads`."""
    _install_hook()
    _current.append(reads)
    try:
        yield
    finally:
        _current.remove(reads)


@contextmanager
def in_part(files: Iterable[Path]) -> Iterator[None]:
    """Treat these files as read in part within this context."""
    paths = {_absolute(str(file)) for file in files}
    if _current:
        for path in sorted(paths):
            _note_state(_current[-1].parts, "part", path)
    _partly.append(paths)
    try:
        yield
    finally:
        _partly.remove(paths)


@cache
def _install_hook() -> None:
    """Install the hook once; it remains installed until the process ends."""
    sys.addaudithook(_hook)


def _hook(event: str, arguments: tuple[object, ...]) -> None:
    if not _current:
        return
    if event in _OF_FILES:
        if event == "sqlite3.connect":
            _note(_of_uri(arguments[0]), is_file=True)
        elif _is_read(*arguments[1:]):
            _note(arguments[0], is_file=True)
    elif event in _OF_FOLDERS:
        # Imports list the folders on Python's path, but never scan them.
        if event != "os.listdir" or arguments[0] not in _current[-1].python_path:
            _note(arguments[0], is_file=False)
    elif event in _OF_TEMPORARY:
        _current[-1].apart.append(_absolute(str(arguments[0])))


def _is_read(mode: object, flags: object) -> bool:
    if isinstance(mode, str):
        return "r" in mode
    return isinstance(flags, int) and flags & os.O_ACCMODE != os.O_WRONLY


def _of_uri(name: object) -> object:
    """Return the path in a database's name, which may be a URI."""
    text = os.fsdecode(name) if isinstance(name, str | bytes) else ""
    return text.removeprefix("file:").partition("?")[0] if text.startswith("file:") else name


def _note(path: object, *, is_file: bool) -> None:
    # A number denotes a file that is already open, and None denotes the current folder.
    if not isinstance(path, str | bytes) or (text := os.fsdecode(path)) == ":memory:":
        return
    absolute, reads = _source(_absolute(text)), _current[-1]
    if any(absolute in paths for paths in _partly):
        return
    # An archive may also be on Python's path.
    is_apart = (is_file and absolute in reads.python_path) or _is_below(absolute, reads.apart)
    if _is_below(absolute, reads.kept) or not (is_apart or _is_of_package(absolute, reads)):
        _note_state(reads.files if is_file else reads.folders, "file" if is_file else "folder", absolute)


def _note_state(found: dict[str, str | None], kind: str, path: str) -> None:
    if path not in found:
        # Computing the state reads the file, which must not be recorded again.
        found[path] = None
        found[path] = state(kind, path)


def _source(path: str) -> str:
    """Return the source of a byte-code file, which Python reads instead of a source compiled in another run."""
    if path.endswith(".pyc"):
        with suppress(ValueError):
            return source_from_cache(path)
    return path


def _absolute(path: str) -> str:
    return os.path.abspath(path)


def _is_below(path: str, folders: Iterable[str]) -> bool:
    return any(path == folder or path.startswith(f"{folder}{os.sep}") for folder in folders)


def _is_of_package(path: str, reads: Reads) -> bool:
    """Return whether a file belongs to a package that Python finds in another folder."""
    for folder in reads.python_path:
        if path.startswith(f"{folder}{os.sep}"):
            if os.path.basename(folder) in _PACKAGE_FOLDERS:
                return True
            first = os.path.join(folder, path[len(folder) + 1 :].partition(os.sep)[0])
            if os.path.isfile(os.path.join(first, "__init__.py")) or first.endswith("-info"):
                return True
    return False
