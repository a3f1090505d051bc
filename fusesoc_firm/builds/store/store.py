"""A store of generated files, indexed by key, so that nothing is generated twice.

FuseSoC's own generator cache is not suitable: it ignores the generator's code and templates, keeps partial output after
an interrupt, and has no lock. In this store, an entry's key covers everything that determines the content, including
this package's files.

Each answered call leaves a note of all facts that determine its key, so that `plugin.recall` can answer the same call
again without computing the key. `layout` describes the files in the store.

A file is written under a temporary name and then renamed; it is read as a whole and checked before use. Therefore no
reader, on this machine or on another that shares the folder, sees a partial file or is disturbed when a file is
removed. Locks only avoid duplicate work: they need not work between machines and are never trusted. `shared_files`
describes how the store treats files from other people.
"""

from __future__ import annotations

import os
import platform
import stat
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.builds.store import layout, shared_files
from fusesoc_firm.builds.store.layout import CALL, ENTRY, KEPT, LAYOUT, LOCK, place
from fusesoc_firm.builds.store.limited import LimitedFolder, StoredFile, limit_of
from fusesoc_firm.builds.store.packages import version
from fusesoc_firm.builds.store.remote import Remote, remote_store
from fusesoc_firm.text.file_lock import take
from fusesoc_firm.text.files import TEMPORARY
from fusesoc_firm.tools.digests import default_root, digest, digest_of
from fusesoc_firm.tools.own_code import IMPORTED

Files = Mapping[str, bytes]
"""The contents of files by name; a name may contain `/`."""

_FORMER_LAYOUTS = ("v1", "v2", "v3")
_DEFAULT_LIMIT = "1G"
_SERVED = "served"
# A process that writes many entries looks through the store after each such part of the limit.
_PART_OF_LIMIT = 1 / 64
# The process that holds a lock may be stopped, or its machine may be down. This limit exceeds the time to generate a
# core.
_LONGEST_WAIT_SECONDS = 120
# A temporary file of this age is from a process that was killed, since no write takes this long.
_ABANDONED_SECONDS = 3600

# The bytes that this process has written to a store since it last looked through the store, by folder.
_unseen: dict[str, int] = {}


@dataclass(frozen=True)
class Key:
    """The digest of all inputs of a result; `about` describes the request for people, as plain data."""

    digest: str
    about: Mapping[str, str] = field(default_factory=dict, compare=False)


@dataclass(frozen=True)
class Entry:
    """Generated files, and whether they were in the store (True) or were built (False).

    `is_current` is False if an input changed while the files were built.
    """

    files: Files
    is_from_store: bool
    is_current: bool = True


@dataclass(frozen=True)
class Store(LimitedFolder):
    """A store of generated files.

    Entries that are missing here are obtained from the `remote` store, and built entries are written to both.
    """

    remote: Remote | None = None

    def obtain(self, key: Key, build: Callable[[], Files], is_current: Callable[[], bool] = lambda: True) -> Entry:
        """Return the files for a key: undamaged files from the store or, after a miss, the files from `build`.

        Built files are stored only if `is_current` returns true after `build`; otherwise, an input changed during the
        build. Concurrent processes that need the same key wait for the first of them. Exceptions from `build`
        propagate. If the store is not writable, a line on standard error reports this, and the files are returned
        without being stored.
        """
        if (files := self._find(key)) is not None:
            return Entry(files, True)
        with self._lock(key):
            # Another process may have built the entry while this one waited for the lock.
            if (files := self._find(key)) is not None or (files := self._fetch(key)) is not None:
                return Entry(files, True)
            files = build()
            if not is_current():
                return Entry(files, False, False)
            data = layout.entry_data(key.about, files)
            self._keep(key, data)
            if self.remote:
                self.remote.put_entry(key.digest, data)
        return Entry(files, False)

    def note(self, call: str, note: Mapping[str, object]) -> None:
        """Store a call's note under the call's digest, so that `plugin.recall` can answer the call."""
        # A failed write only makes the next call slower.
        with suppress(OSError):
            if self.is_writable():
                layout.write_json(self._root, place(call, CALL), note)

    def entries(self) -> list[StoredFile]:
        """Return all entries in the order of last use, the most recent first."""
        return [file for file in self._files() if file.name.endswith(ENTRY)]

    def is_writable(self) -> bool:
        """Return whether this user may add entries, which is also the case if the store's folder is missing."""
        there = next((folder for folder in (self.root / LAYOUT, self.root) if os.access(folder, os.F_OK)), None)
        return there is None or os.access(there, os.W_OK)

    def clean(self) -> int:
        """Remove the whole store, including older formats; return the number of removed bytes. May raise `OSError`."""
        return sum(shared_files.remove(self._root, layout) for layout in (*_FORMER_LAYOUTS, LAYOUT))

    def _find(self, key: Key) -> Files | None:
        name = place(key.digest, ENTRY)
        if (found := layout.read_entry(self._root, name)) is None:
            return None
        layout.mark_used(self._root, name)
        return found[1]

    @contextmanager
    def _lock(self, key: Key) -> Iterator[None]:
        """Hold the lock of a key within this context; the operating system releases the lock if the process ends.

        A process that cannot get the lock, or has waited too long, continues without the lock.
        """
        name = place(key.digest, LOCK)
        try:
            handle, is_held = _locked(self._root, name)
        except OSError:
            # The write of the entry reports a read-only store.
            yield
            return
        try:
            yield
        finally:
            # Remove the lock file while it is locked, so that waiting processes notice that the file has been replaced.
            if is_held:
                with suppress(OSError):
                    shared_files.remove(self._root, name)
            os.close(handle)

    def _fetch(self, key: Key) -> Files | None:
        """Return the files for a key from the remote store, and keep them in this one."""
        if self.remote is None or (data := self.remote.entry(key.digest)) is None:
            return None
        if (found := layout.entry_in(data)) is None:
            self.remote.tell_damage(key.digest)
            return None
        self._keep(key, data)
        return found[1]

    def _keep(self, key: Key, data: bytes) -> None:
        try:
            layout.write(self._root, place(key.digest, ENTRY), data)
            self._count(len(data))
        except OSError as error:
            # Users of a read-only store expect this failure, and `firm cache show` reports it.
            if self.is_writable():
                print(f"warning: results cannot be cached in the store {self.root}: {error.strerror}", file=sys.stderr)

    def _count(self, size: int) -> None:
        """Note that this process wrote `size` bytes; after its first write and then at times, shrink if needed."""
        unseen = _unseen.get(self._root, self.limit) + size
        if unseen > self.limit * _PART_OF_LIMIT:
            self.shrink_if_needed()
            unseen = 0
        _unseen[self._root] = unseen

    def shrink_if_needed(self) -> None:
        """Remove old files if the store exceeds its limit, and abandoned temporary files. May raise `OSError`."""
        super().shrink_if_needed()
        for name, status in self._listed():
            is_abandoned = status.st_mtime < time.time() - _ABANDONED_SECONDS
            if is_abandoned and name.rpartition("/")[2].startswith(TEMPORARY):
                with suppress(OSError):
                    shared_files.remove(self._root, name)

    def _listed(self) -> list[tuple[str, os.stat_result]]:
        return shared_files.listed(self._root, LAYOUT)

    def _counts(self, name: str) -> bool:
        return name.endswith(KEPT)

    def _is_whole(self, name: str, status: os.stat_result) -> bool:
        return stat.S_ISREG(status.st_mode) and (not name.endswith(KEPT) or layout.is_whole(self._root, name))


def default_store(environment: Mapping[str, str] = os.environ) -> Store:
    """Return the store selected by the environment variables. Raise `InputError` if a value is illegal."""
    limit = limit_of(environment, "FUSESOC_FIRM_CACHE_SIZE", _DEFAULT_LIMIT, "4096, 500M or 2G")
    root = default_root(environment)
    return Store(Path(root), limit, remote_store(environment, root))


def served_store(limit: int, environment: Mapping[str, str] = os.environ) -> Store:
    """Return the store of the data that other machines write to this one, with a separate limit."""
    return Store(Path(default_root(environment), _SERVED), limit)


def request_digest(request: Mapping[str, object], inputs: Mapping[str, bytes | None], code: str) -> str:
    """Return the digest of everything that determines the result of `request` (plain data).

    `inputs` maps the name of each file to its bytes, or to None for a missing file; `code` is the digest of our own
    files.
    """
    parts = {
        "request": request,
        "inputs": {name: None if data is None else digest(data) for name, data in inputs.items()},
        "code": code,
        "versions": {name: version(name) for name in IMPORTED},
        "python": sys.version_info[:2],
        # A compiled accelerator runs only on one kind of machine.
        "machine": platform.machine(),
    }
    return digest_of(parts)


def _locked(root: str, name: str) -> tuple[int, bool]:
    """Open and lock a file; return the handle, and whether the lock is held. May raise `OSError`.

    The previous holder may have removed the file in the meantime. If the file system does not support locks, or only
    within one machine, the worst result is a duplicate build.
    """
    end = time.monotonic() + _LONGEST_WAIT_SECONDS
    while True:
        handle = shared_files.open_lock(root, name)
        is_held = take(handle, end - time.monotonic())
        there = shared_files.state(root, name)
        if not is_held or (there and os.path.samestat(os.fstat(handle), there)):
            return handle, is_held
        os.close(handle)
