"""A lock on a folder of the build root, for one build at a time, on this machine and on all that share it.

FuseSoC and the tools behind it take a work root to be theirs alone. The lock is a file beside it, which is linked into
its place: that either happens or fails, on network folders too, where locks of the system (`text/file_lock.py`) may
hold on one machine only. It names its owner. An owner on this machine is gone when its process is; one on another
machine when it has not touched the file for a while, which is seen by the file's time changing, so clocks are not
compared.

A lock whose owner is gone is removed under a lock of the system, so of several who wait only one removes it. Where that
one does not hold between machines, two of them might do so at the same instant; then one owner finds that the lock is
its own no more, and `beat` tells.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.text.file_lock import locked

BEAT_SECONDS = 2.0
"""How often an owner has to call `beat`."""
_SILENT_SECONDS = 30.0
# What a process starts is ended with it, but not in the same instant.
_GRACE_SECONDS = 1.0


@dataclass(frozen=True)
class Owner:
    """Who has a lock: a process, when it was started, the machine as the system knows it, and as people do."""

    token: str
    machine: str
    process: int
    started: str
    host: str

    def __str__(self) -> str:
        return f"process {self.process} on {self.host}"


@dataclass
class FolderLock:
    """The lock of which the file is `path`; its folder is made. Not for several threads."""

    path: Path
    _mine: Owner | None = field(default=None, init=False)
    # The owner that is waited for, the time of its file, and since when that has been so.
    _watched: tuple[Owner, int, float] | None = field(default=None, init=False)

    def acquire(self) -> Owner | None:
        """Take the lock and return None; if somebody has it, return who, at once. Raises `OSError`."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        mine = Owner(secrets.token_hex(8), _machine(), os.getpid(), _started(os.getpid()), socket.gethostname())
        new = self.path.with_name(f"{self.path.name}.{mine.token}")
        try:
            new.write_text(json.dumps(vars(mine)), encoding="utf-8")
            while True:
                with suppress(FileExistsError):
                    os.link(new, self.path)
                    self._mine, self._watched = mine, None
                    return None
                if (owner := _owner(self.path)) is None:
                    continue
                if not self._is_gone(owner):
                    return owner
                self._remove(owner)
        finally:
            new.unlink(missing_ok=True)

    def beat(self) -> bool:
        """Show that the owner lives; False if the lock is its own no more."""
        if self._mine is None or _owner(self.path) != self._mine:
            return False
        with suppress(FileNotFoundError):
            os.utime(self.path)
        return True

    def release(self) -> None:
        """Let others have it."""
        if self._mine:
            with locked(self.path.parent):
                if _owner(self.path) == self._mine:
                    self.path.unlink()
            self._mine = None

    def _is_gone(self, owner: Owner) -> bool:
        if owner.machine == _machine():
            return _started(owner.process) != owner.started
        try:
            changed = self.path.stat().st_mtime_ns
        except FileNotFoundError:
            return False
        if self._watched is None or self._watched[:2] != (owner, changed):
            self._watched = (owner, changed, time.monotonic())
        return time.monotonic() - self._watched[2] > _SILENT_SECONDS

    def _remove(self, owner: Owner) -> None:
        time.sleep(_GRACE_SECONDS)
        with locked(self.path.parent):
            if _owner(self.path) == owner:
                self.path.unlink()


def _owner(path: Path) -> Owner | None:
    """Who has the lock; None if nobody has."""
    try:
        return Owner(**json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        return None
    except (ValueError, TypeError, RecursionError):
        # Damaged: it is removed when nobody has touched it for a while.
        return Owner("", "", 0, "", "an unknown machine")


def _machine() -> str:
    """What tells machines apart, and containers in which the same process has another number."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:
        return socket.gethostname()


def _started(process: int) -> str:
    """When a process was started, as the system counts; "" if there is none."""
    try:
        # Behind the name in parentheses, which may hold blanks.
        return Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[19]
    except (FileNotFoundError, ProcessLookupError):
        return ""
