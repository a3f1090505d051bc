"""A lock on a file or folder for one process on this machine, which the system releases when the process ends.

Processes on several machines that share a folder may hold the lock at the same time. The lock in
`builds/setup/folder_lock.py` also excludes processes on other machines.
"""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager

_POLL_SECONDS = 0.02


@contextmanager
def locked(path: str | os.PathLike[str]) -> Iterator[None]:
    """Wait for the lock of an existing file or folder, and hold it without creating a file. May raise `OSError`."""
    handle = os.open(path, os.O_RDONLY)
    try:
        take(handle)
        yield
    finally:
        os.close(handle)


def take(handle: int, seconds: float | None = None) -> bool:
    """Lock an open file until it is closed; return False if another process holds the lock for `seconds`.

    If `seconds` is None, wait without a limit. On a file system without locks, return True without a lock.
    """
    end = None if seconds is None else time.monotonic() + seconds
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX if end is None else fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if end is not None and time.monotonic() >= end:
                return False
            time.sleep(_POLL_SECONDS)
            continue
        except OSError:
            pass
        return True
