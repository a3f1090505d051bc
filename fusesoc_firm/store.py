"""A content-addressed store of generated files, so that nothing is generated twice.

FuseSoC's own generator cache cannot be used: it sees neither the code nor the templates that a core is made with,
keeps partial output after an interrupt, and is not locked. Here an entry's key covers all that decides its content.

Which of this package's own files do so is known only when they have been used. So there are two steps: what was asked
for leads to the names of the files that it used when it was last made, and these with their present digests to the
entry. An entry is right whichever names led to it: what used just these files, in this state, for this request, will do
so again.

    <root>/v2/<first two digits>/<digest of the request>.uses    names of our own files, as JSON
    <root>/v2/<first two digits>/<key>.entry                     a line with the SHA-256 of the rest; a line of JSON:
                                                                 what was asked for, names, lengths; the contents
    <root>/v2/<first two digits>/<digest of the request>.lock    held while an entry is made

A file is written beside its place and appears there by one rename; it is read whole and checked before it is used. So
no reader, on this machine or on another that shares the folder, sees half of it or is disturbed by its removal. Locks
only save work.
"""

from __future__ import annotations

import fcntl
import hashlib
import io
import json
import os
import platform
import re
import secrets
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import IO

from fusesoc_firm.diagnostics import fail

Files = Mapping[str, bytes]
"""Contents by file name; a name may hold `/`."""

# What generated text can depend on beside our own code.
_IMPORTED = ("chevron", "numpy", "pyyaml", "rosbags")
_LAYOUT = "v2"
_FORMER_LAYOUTS = ("v1",)
_ENTRY, _USES, _LOCK, _NEW = ".entry", ".uses", ".lock", ".new-"
_DEFAULT_LIMIT = "1G"
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
# When the store is too large, so much is left that it is not so again at once.
_KEPT_OF_LIMIT = 0.8
# What a process that was killed left behind; no file takes so long to be written.
_ABANDONED_SECONDS = 3600


@dataclass(frozen=True)
class Key:
    """What decides a result: the digest of what was asked for, and those of our own files by name, used or not.

    `about` is plain data that tells people what was asked for.
    """

    request: str
    code: Mapping[str, str]
    about: Mapping[str, str] = field(default_factory=dict, compare=False)

    def with_code(self, used: Iterable[str]) -> str | None:
        """The key of a result that used these of our files; None if one of them is no more."""
        names = sorted(set(used))
        if not set(names) <= self.code.keys():
            return None
        return _digest_of([self.request, {name: self.code[name] for name in names}])


@dataclass(frozen=True)
class Made:
    """Generated files, and the names of our own files that they were made with."""

    files: Files
    used: Iterable[str]


@dataclass(frozen=True)
class Entry:
    """Generated files and whether they were found (True) or had to be made (False)."""

    files: Files
    is_from_store: bool


@dataclass(frozen=True)
class StoredEntry:
    """What an entry says: what was asked for, and the files in the order they were made."""

    about: Mapping[str, str]
    files: Files


@dataclass(frozen=True)
class StoredFile:
    """A file of the store as it lies there: its size in bytes, and when it was last used (seconds since the epoch)."""

    path: Path
    size: int
    used: float


@dataclass(frozen=True)
class Store:
    """A store in the folder `root`, which is made when it is first written to, of about `limit` bytes at most."""

    root: Path
    limit: int

    def obtain(self, key: Callable[[], Key], build: Callable[[], Made]) -> Entry:
        """The files of a key, from the store if it has them undamaged, else from `build`, which are then kept.

        The key is asked for again after `build`, and nothing is kept if it has changed: then something was edited while
        it was read. Processes that want the same at once wait for the first of them. Whatever `build` raises passes
        through. If the store cannot be written, one line on stderr says so and the files are made without it.
        """
        wanted = key()
        if (files := self._find(wanted)) is not None:
            return Entry(files, True)
        with self._lock(wanted) as is_writable:
            # While this process waited for the lock another one may have made the entry.
            if (files := self._find(wanted)) is not None:
                return Entry(files, True)
            made = build()
            if is_writable and key() == wanted:
                self._keep(wanted, made)
        return Entry(made.files, False)

    def entries(self) -> list[StoredFile]:
        """Every entry, the one that was used last first."""
        return [file for file in self._files() if file.path.suffix == _ENTRY]

    def size(self) -> int:
        """The bytes of all that counts against the limit."""
        return sum(file.size for file in self._files())

    def remove_damaged(self) -> list[Path]:
        """Remove the entries that are not whole, and name them. Raises `OSError`."""
        # One that is no more was removed by another process.
        damaged = [file.path for file in self.entries() if read_entry(file.path) is None and file.path.exists()]
        for path in damaged:
            path.unlink(missing_ok=True)
        return damaged

    def shrink(self, limit: int) -> int:
        """Remove what was not used for longest until `limit` bytes are left at most; the number of bytes removed.

        Raises `OSError`.
        """
        total = removed = 0
        for file in self._files():
            total += file.size
            if total > limit:
                # Another process may do the same.
                with suppress(FileNotFoundError):
                    file.path.unlink()
                    removed += file.size
        return removed

    def clean(self) -> int:
        """Remove all of it, that of former versions too; the number of bytes removed. Raises `OSError`."""
        removed = 0
        for layout in (*_FORMER_LAYOUTS, _LAYOUT):
            for folder, _, files in os.walk(self.root / layout, topdown=False):
                for path in (Path(folder, name) for name in files):
                    # Another process may remove it in between.
                    with suppress(FileNotFoundError):
                        size = path.lstat().st_size
                        path.unlink()
                        removed += size
                # Another process may write into it.
                with suppress(OSError):
                    Path(folder).rmdir()
        return removed

    def uses(self, key: Key) -> list[str] | None:
        """Which of our own files were used for what was asked for when it was last made; None if that is not known."""
        try:
            names = json.loads(self._path(key.request, _USES).read_bytes())
        except (OSError, ValueError):
            return None
        return names if isinstance(names, list) and all(isinstance(name, str) for name in names) else None

    def _find(self, key: Key) -> Files | None:
        uses = self.uses(key)
        full = None if uses is None else key.with_code(uses)
        if full is None or (found := read_entry(self._path(full, _ENTRY))) is None:
            return None
        for path in (self._path(full, _ENTRY), self._path(key.request, _USES)):
            # What cannot be written can be read all the same.
            with suppress(OSError):
                os.utime(path)
        return found.files

    @contextmanager
    def _lock(self, key: Key) -> Iterator[bool]:
        """Hold the request's lock, which the system frees if the process dies; False where there can be none."""
        path = self._path(key.request, _LOCK)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file = _locked(path)
        except OSError as error:
            self._warn(error)
            yield False
            return
        try:
            yield True
        finally:
            # While it is held: whoever waits for it then sees that the file is another one.
            with suppress(OSError):
                path.unlink()
            file.close()

    def _keep(self, key: Key, made: Made) -> None:
        names = sorted(made.used)
        full = key.with_code(names)
        # One of our own files is no more, or is new.
        if full is None:
            return
        try:
            _write(self._path(full, _ENTRY), _entry_bytes(key.about, made.files))
            _write(self._path(key.request, _USES), json.dumps(names).encode())
            self._shrink_if_needed()
        except OSError as error:
            self._warn(error)

    def _shrink_if_needed(self) -> None:
        if self.size() > self.limit:
            self.shrink(int(self.limit * _KEPT_OF_LIMIT))
        for path in self._folder().glob(f"*/{_NEW}*"):
            with suppress(OSError):
                if path.stat().st_mtime < time.time() - _ABANDONED_SECONDS:
                    path.unlink()

    def _files(self) -> list[StoredFile]:
        """What counts against the limit, the one that was used last first."""
        found: list[StoredFile] = []
        for path in self._folder().glob("*/*"):
            if path.suffix in (_ENTRY, _USES):
                # Another process may remove it in between.
                with suppress(OSError):
                    status = path.stat()
                    found.append(StoredFile(path, status.st_size, status.st_mtime))
        return sorted(found, key=lambda file: (-file.used, file.path))

    def _folder(self) -> Path:
        return self.root / _LAYOUT

    def _path(self, digest: str, suffix: str) -> Path:
        return self._folder() / digest[:2] / f"{digest}{suffix}"

    def _warn(self, error: OSError) -> None:
        print(f"warning: nothing is kept in the store {self.root}: {error.strerror}", file=sys.stderr)


def default_store(environment: Mapping[str, str] = os.environ) -> Store:
    """The store that the environment names. Raises `InputError` for a limit that is no size."""
    limit = environment.get("FUSESOC_FIRM_CACHE_SIZE") or _DEFAULT_LIMIT
    if (size := parse_size(limit)) is None:
        fail(f"FUSESOC_FIRM_CACHE_SIZE is '{limit}', which is no size", hint="bytes, or such as 500M or 2G")
    return Store(default_root(environment), size)


def default_root(environment: Mapping[str, str] = os.environ) -> Path:
    """FUSESOC_FIRM_CACHE, else `fusesoc_firm` in XDG_CACHE_HOME, else in ~/.cache."""
    if chosen := environment.get("FUSESOC_FIRM_CACHE"):
        return Path(chosen).expanduser().absolute()
    base = environment.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser().absolute() / "fusesoc_firm"


def parse_size(text: str) -> int | None:
    """A number of bytes, with K, M, G or T for powers of 1024; None if it is none."""
    found = re.fullmatch(r"(\d+)([KMGT]?)", text.strip().upper())
    return int(found[1]) * _UNITS[found[2]] if found else None


def request_digest(request: Mapping[str, object], inputs: Mapping[str, bytes | None], code: Iterable[str]) -> str:
    """The digest of all that decides what comes of `request` (plain data), but for the content of our own files.

    `inputs` are the bytes of each file by name, None if there is none. The names of our own files, `code`, count: a new
    one can take the place of another.
    """
    parts = {
        "request": request,
        "inputs": {name: None if data is None else _digest(data) for name, data in inputs.items()},
        "code": sorted(code),
        "versions": {name: _version(name) for name in _IMPORTED},
        "python": sys.version_info[:2],
        # What a compiler made of an accelerator runs on one kind of machine only.
        "machine": platform.machine(),
    }
    return _digest_of(parts)


@cache
def _version(package: str) -> str:
    """Of what this process has imported; looking it up takes longer than all else of a key."""
    return version(package)


def read_entry(path: Path) -> StoredEntry | None:
    """An entry, or None if it is not there or not whole."""
    try:
        digest, _, rest = path.read_bytes().partition(b"\n")
    except OSError:
        return None
    if _digest(rest).encode() != digest:
        return None
    stream = io.BytesIO(rest)
    header = json.loads(stream.readline())
    return StoredEntry(header["about"], {name: stream.read(length) for name, length in header["files"]})


def _entry_bytes(about: Mapping[str, str], files: Files) -> bytes:
    header = {"about": dict(about), "files": [[name, len(data)] for name, data in files.items()]}
    rest = b"".join([json.dumps(header).encode(), b"\n", *files.values()])
    return _digest(rest).encode() + b"\n" + rest


def _write(path: Path, data: bytes) -> None:
    """Write a file at once: no reader sees part of it, and what is there is replaced. Raises `OSError`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{_NEW}{secrets.token_hex(8)}")
    try:
        with temporary.open("xb") as file:
            file.write(data)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _locked(path: Path) -> IO[bytes]:
    """The file at `path`, opened and locked, which whoever had the lock before may have removed meanwhile."""
    while True:
        file = path.open("wb")
        # A file system without locks costs a second build at worst.
        with suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX)
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        file.close()


def _digest_of(data: object) -> str:
    return _digest(json.dumps(data, sort_keys=True).encode())


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
