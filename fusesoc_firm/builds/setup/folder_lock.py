"""A lock that admits only one build at a time to a folder, on all machines that share the folder.

FuseSoC and the tools that it starts assume exclusive use of a work root. The lock is a file next to the work root that
is created as a hard link. Linking is atomic even in network folders, where system locks (`text/file_lock.py`) may cover
only one machine. The file names the owner. An owner on this machine is gone when its process has ended; an owner on
another machine is gone when it has not touched the file for some time. Only changes to the file's time matter, so
clocks are not compared.

If a lock's owner is gone, the lock is removed under a system lock, so that only one waiting process removes it. If the
system lock does not work between machines, two machines might remove the file simultaneously; one owner then loses its
lock, which `beat` reports.
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
from fusesoc_firm.tools.processes import start_time

BEAT_SECONDS = 2.0
"""The maximum time in seconds between an owner's calls of `beat`."""
_SILENT_SECONDS = 30.0
# The processes that an owner started end with the owner, but not in the same instant.
_GRACE_SECONDS = 1.0


@dataclass(frozen=True)
class Owner:
    """The owner of a lock: a process, its start time, and the machine's system id and name."""

    token: str
    machine: str
    process: int
    started: str
    host: str

    def __str__(self) -> str:
        return f"process {self.process} on {self.host}"


@dataclass
class FolderLock:
    """The lock in the file `path`, whose folder is created if necessary; the class is not thread-safe."""

    path: Path
    _mine: Owner | None = field(default=None, init=False)
    # The current owner, the time of the lock file, and the time since which both have been unchanged.
    _watched: tuple[Owner, int, float] | None = field(default=None, init=False)

    def acquire(self) -> Owner | None:
        """Take the lock and return None or, without waiting, return the current owner. May raise `OSError`."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        mine = Owner(secrets.token_hex(8), _machine(), os.getpid(), start_time(os.getpid()), socket.gethostname())
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
        """Show that this owner is alive; return False if this owner has lost the lock."""
        if self._mine is None or _owner(self.path) != self._mine:
            return False
        with suppress(FileNotFoundError):
            os.utime(self.path)
        return True

    def release(self) -> None:
        """Release the lock."""
        if self._mine:
            with locked(self.path.parent):
                if _owner(self.path) == self._mine:
                    self.path.unlink()
            self._mine = None

    def _is_gone(self, owner: Owner) -> bool:
        if owner.machine == _machine():
            return start_time(owner.process) != owner.started
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
    """Return the owner of a lock, or None if the lock is free."""
    try:
        return Owner(**json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        return None
    except (ValueError, TypeError, RecursionError):
        # A damaged file is removed when it has not been touched for some time.
        return Owner("", "", 0, "", "an unknown machine")


def _machine() -> str:
    """Return an id of the machine, or of the container if it has separate process numbers."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:
        return socket.gethostname()
