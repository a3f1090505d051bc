"""A content-addressed store of generated files, so that nothing is generated twice.

FuseSoC's own generator cache cannot be used: it sees neither the code nor the templates that a core is made with,
keeps partial output after an interrupt, and is not locked. Here an entry's key covers all that decides its content,
this package's own files included.

A call that was answered leaves a note of all facts that its key follows from, by which `plugin.recall` answers it the
next time without making the key. `layout` tells how all this lies in the store.

A file is written beside its place and appears there by one rename; it is read whole and checked before it is used. So
no reader, on this machine or on another that shares the folder, sees half of it or is disturbed by its removal. Locks
only save work: they need not hold between machines, and are never trusted. `shared_files` tells what else is not.
"""

from __future__ import annotations

import os
import platform
import re
import stat
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path

from fusesoc_firm.store import layout, shared_files
from fusesoc_firm.store.layout import CALL, ENTRY, KEPT, LAYOUT, LOCK, digest, digest_of, place
from fusesoc_firm.store.own_code import IMPORTED
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.file_lock import take
from fusesoc_firm.text.files import TEMPORARY

Files = Mapping[str, bytes]
"""Contents by file name; a name may hold `/`."""

_FORMER_LAYOUTS = ("v1", "v2", "v3")
_DEFAULT_LIMIT = "1G"
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
# When the store is too large, so much is left that it is not so again at once.
_KEPT_OF_LIMIT = 0.8
# Who makes an entry may be stopped, or be on a machine that is no more. It is longer than generation takes.
_LONGEST_WAIT_SECONDS = 120
# What a process that was killed left behind; no file takes so long to be written.
_ABANDONED_SECONDS = 3600


@dataclass(frozen=True)
class Key:
    """The digest of what decides a result; `about` is plain data that tells people what was asked for."""

    digest: str
    about: Mapping[str, str] = field(default_factory=dict, compare=False)


@dataclass(frozen=True)
class Entry:
    """Generated files and whether they were found (True) or had to be made (False)."""

    files: Files
    is_from_store: bool


@dataclass(frozen=True)
class StoredFile:
    """A file by its name in the store: its size in bytes, and when it was last used (seconds since the epoch)."""

    name: str
    size: int
    used: float


@dataclass(frozen=True)
class Store:
    """A store in the folder `root`, which is made when it is first written to, of about `limit` bytes at most."""

    root: Path
    limit: int

    def obtain(self, key: Key, build: Callable[[], Files], is_current: Callable[[], bool] = lambda: True) -> Entry:
        """The files of a key, from the store if it has them undamaged, else from `build`, which are then kept.

        Nothing is kept unless the key `is_current` after `build`: otherwise something was edited while it was read.
        Processes that want the same at once wait for the first of them. Whatever `build` raises passes through. If the
        store cannot be written, one line on stderr says so and the files are made without it.
        """
        if (files := self._find(key)) is not None:
            return Entry(files, True)
        with self._lock(key):
            # While this process waited for the lock another one may have made the entry.
            if (files := self._find(key)) is not None:
                return Entry(files, True)
            files = build()
            if is_current():
                self._keep(key, files)
        return Entry(files, False)

    def note(self, call: str, note: Mapping[str, object]) -> None:
        """Note the answer to a call, by its digest, so that it can be recalled."""
        # It only saves time.
        with suppress(OSError):
            if self.is_writable():
                layout.write_json(self._root, place(call, CALL), note)

    def entries(self) -> list[StoredFile]:
        """Every entry, the one that was used last first."""
        return [file for file in self._files() if file.name.endswith(ENTRY)]

    def size(self) -> int:
        """The bytes of all that counts against the limit."""
        return sum(file.size for file in self._files())

    def is_writable(self) -> bool:
        """Whether this user may add entries; True also if the store's folder is missing."""
        there = next((folder for folder in (self.root / LAYOUT, self.root) if os.access(folder, os.F_OK)), None)
        return there is None or os.access(there, os.W_OK)

    def remove_damaged(self) -> list[Path]:
        """Remove what is damaged, or is no file that a store can have, and name it. Raises `OSError`."""
        damaged = []
        for name, status in self._listed():
            is_kept = name.endswith(KEPT)
            is_good = stat.S_ISREG(status.st_mode) and (not is_kept or layout.is_whole(self._root, name))
            # What is no more was removed by another process.
            if not is_good and shared_files.state(self._root, name) is not None:
                shared_files.remove(self._root, name)
                damaged.append(self.root / name)
        return damaged

    def shrink(self, limit: int) -> int:
        """Remove what was not used for longest until `limit` bytes are left at most; the number of bytes removed.

        Raises `OSError`.
        """
        total = removed = 0
        for file in self._files():
            total += file.size
            if total > limit:
                removed += shared_files.remove(self._root, file.name)
        return removed

    def clean(self) -> int:
        """Remove all of it, that of former versions too; the number of bytes removed. Raises `OSError`."""
        return sum(shared_files.remove(self._root, layout) for layout in (*_FORMER_LAYOUTS, LAYOUT))

    def _find(self, key: Key) -> Files | None:
        name = place(key.digest, ENTRY)
        if (found := layout.read_entry(self._root, name)) is None:
            return None
        layout.mark_used(self._root, name)
        return found[1]

    @contextmanager
    def _lock(self, key: Key) -> Iterator[None]:
        """Hold the lock of a key, which the system frees if the process dies.

        Who cannot have it, or has waited too long for it, goes on without.
        """
        name = place(key.digest, LOCK)
        try:
            handle, is_held = _locked(self._root, name)
        except OSError:
            # If the store cannot be written, that is found out when the entry is.
            yield
            return
        try:
            yield
        finally:
            # While it is held: whoever waits for it then sees that the file is another one.
            if is_held:
                with suppress(OSError):
                    shared_files.remove(self._root, name)
            os.close(handle)

    def _keep(self, key: Key, files: Files) -> None:
        try:
            layout.write_entry(self._root, place(key.digest, ENTRY), key.about, files)
            self._shrink_if_needed()
        except OSError as error:
            # Who may only read a store of others knows, or is told by `firm cache show`.
            if self.is_writable():
                print(f"warning: results cannot be cached in the store {self.root}: {error.strerror}", file=sys.stderr)

    def _shrink_if_needed(self) -> None:
        if self.size() > self.limit:
            self.shrink(int(self.limit * _KEPT_OF_LIMIT))
        for name, status in self._listed():
            is_abandoned = status.st_mtime < time.time() - _ABANDONED_SECONDS
            if is_abandoned and name.rpartition("/")[2].startswith(TEMPORARY):
                with suppress(OSError):
                    shared_files.remove(self._root, name)

    def _files(self) -> list[StoredFile]:
        """What counts against the limit, the one that was used last first."""
        found = [
            StoredFile(name, status.st_size, status.st_mtime)
            for name, status in self._listed()
            if name.endswith(KEPT) and stat.S_ISREG(status.st_mode)
        ]
        return sorted(found, key=lambda file: (-file.used, file.name))

    def _listed(self) -> list[tuple[str, os.stat_result]]:
        return shared_files.listed(self._root, LAYOUT)

    @property
    def _root(self) -> str:
        return str(self.root)


def default_store(environment: Mapping[str, str] = os.environ) -> Store:
    """The store that the environment names. Raises `InputError` for a limit that is no size."""
    limit = environment.get("FUSESOC_FIRM_CACHE_SIZE") or _DEFAULT_LIMIT
    if (size := parse_size(limit)) is None:
        fail(
            f"FUSESOC_FIRM_CACHE_SIZE is '{limit}', which is not a size",
            hint="legal: a number of bytes, such as 4096, 500M or 2G",
        )
    return Store(Path(layout.default_root(environment)), size)


def parse_size(text: str) -> int | None:
    """A number of bytes, with K, M, G or T for powers of 1024; None if it is none."""
    found = re.fullmatch(r"(\d+)([KMGT]?)", text.strip().upper())
    return int(found[1]) * _UNITS[found[2]] if found else None


def request_digest(request: Mapping[str, object], inputs: Mapping[str, bytes | None], code: str) -> str:
    """The digest of all that decides what comes of `request` (plain data).

    `inputs` are the bytes of each file by name, None if there is none; `code` is the digest of our own files.
    """
    parts = {
        "request": request,
        "inputs": {name: None if data is None else digest(data) for name, data in inputs.items()},
        "code": code,
        "versions": {name: _version(name) for name in IMPORTED},
        "python": sys.version_info[:2],
        # What a compiler made of an accelerator runs on one kind of machine only.
        "machine": platform.machine(),
    }
    return digest_of(parts)


@cache
def _version(package: str) -> str:
    """Of what this process has imported; looking it up takes longer than all else of a key."""
    return version(package)


def _locked(root: str, name: str) -> tuple[int, bool]:
    """A lock, opened, and whether it is held; whoever had it before may have removed it meanwhile. Raises `OSError`.

    A file system without locks, or one that another machine keeps, costs a second build at worst.
    """
    end = time.monotonic() + _LONGEST_WAIT_SECONDS
    while True:
        handle = shared_files.open_lock(root, name)
        is_held = take(handle, end - time.monotonic())
        there = shared_files.state(root, name)
        if not is_held or (there and os.path.samestat(os.fstat(handle), there)):
            return handle, is_held
        os.close(handle)
