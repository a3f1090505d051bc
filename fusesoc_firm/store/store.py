"""A content-addressed store of generated files, so that nothing is generated twice.

FuseSoC's own generator cache cannot be used: it sees neither the code nor the templates that a core is made with,
keeps partial output after an interrupt, and is not locked. Here an entry's key covers all that decides its content.

Which of this package's own files do so is known only when they have been used. So there are two steps: what was asked
for leads to the names of the files that it used when it was last made, and these with their present digests to the
entry. An entry is right whichever names led to it: what used just these files, in this state, for this request, will do
so again.

A call that was answered leaves a note of all facts that its key follows from, by which `recall` answers it the next
time without making the key. `store_files` tells how all this lies in the store.

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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path

from fusesoc_firm.store import layout, shared_files
from fusesoc_firm.store.layout import CALL, ENTRY, KEPT, LAYOUT, LOCK, USES, digest, digest_of, place
from fusesoc_firm.store.recall import IMPORTED, Fact
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.file_lock import take
from fusesoc_firm.text.files import TEMPORARY

Files = Mapping[str, bytes]
"""Contents by file name; a name may hold `/`."""

_FORMER_LAYOUTS = ("v1", "v2")
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
        return digest_of([self.request, {name: self.code[name] for name in names}])


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
class Call:
    """A call as `recall` knows it: its digest, the facts that its key follows from, and what else the note holds.

    `facts` are told for those of our own files that were used, in their state at that moment.
    """

    digest: str
    facts: Callable[[Iterable[str]], Sequence[Fact]]
    note: Mapping[str, str]


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

    def obtain(self, key: Callable[[], Key], build: Callable[[], Made], call: Call | None = None) -> Entry:
        """The files of a key, from the store if it has them undamaged, else from `build`, which are then kept.

        The key is asked for again after `build`, and nothing is kept if it has changed: then something was edited while
        it was read. Processes that want the same at once wait for the first of them. Whatever `build` raises passes
        through. If the store cannot be written, one line on stderr says so and the files are made without it. The
        answer to a `call` is noted, so that it can be recalled.
        """
        wanted = key()
        if (files := self._find(wanted)) is not None:
            if call and self.is_writable():
                self._note(key, wanted, call)
            return Entry(files, True)
        with self._lock(wanted):
            # While this process waited for the lock another one may have made the entry.
            if (files := self._find(wanted)) is not None:
                return Entry(files, True)
            made = build()
            self._keep(key, wanted, made, call)
        return Entry(made.files, False)

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

    def uses(self, key: Key) -> list[str] | None:
        """Which of our own files were used for what was asked for when it was last made; None if that is not known."""
        return layout.read_uses(self._root, place(key.request, USES))

    def _find(self, key: Key) -> Files | None:
        uses = self.uses(key)
        full = None if uses is None else key.with_code(uses)
        if full is None or (found := layout.read_entry(self._root, place(full, ENTRY))) is None:
            return None
        layout.mark_used(self._root, place(full, ENTRY), place(key.request, USES))
        return found[1]

    @contextmanager
    def _lock(self, key: Key) -> Iterator[None]:
        """Hold the request's lock, which the system frees if the process dies.

        Who cannot have it, or has waited too long for it, goes on without.
        """
        name = place(key.request, LOCK)
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

    def _keep(self, key: Callable[[], Key], wanted: Key, made: Made, call: Call | None) -> None:
        used = sorted(made.used)
        full = wanted.with_code(used)
        facts = call.facts(used) if call else ()
        # The key after the facts: what is edited in between is found now, and what is edited later differs from them.
        # None if one of our own files is no more, or is new.
        if full is None or key() != wanted:
            return
        try:
            layout.write_entry(self._root, place(full, ENTRY), wanted.about, made.files)
            layout.write_json(self._root, place(wanted.request, USES), used)
            if call:
                self._write_note(call, full, facts)
            self._shrink_if_needed()
        except OSError as error:
            # Who may only read a store of others knows, or is told by `firm cache show`.
            if self.is_writable():
                print(f"warning: nothing is kept in the store {self.root}: {error.strerror}", file=sys.stderr)

    def _note(self, key: Callable[[], Key], wanted: Key, call: Call) -> None:
        """Note a call whose entry was found by the key, unless something is edited meanwhile."""
        used = self.uses(wanted) or []
        full = wanted.with_code(used)
        facts = call.facts(used)
        if full is not None and key() == wanted:
            # It only saves time.
            with suppress(OSError):
                self._write_note(call, full, facts)

    def _write_note(self, call: Call, full: str, facts: Sequence[Fact]) -> None:
        note = {**call.note, "key": full, "facts": facts}
        layout.write_json(self._root, place(call.digest, CALL), note)

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
        fail(f"FUSESOC_FIRM_CACHE_SIZE is '{limit}', which is no size", hint="bytes, or such as 500M or 2G")
    return Store(Path(layout.default_root(environment)), size)


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
        "inputs": {name: None if data is None else digest(data) for name, data in inputs.items()},
        "code": sorted(code),
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
