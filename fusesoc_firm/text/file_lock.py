"""A lock on a file or a folder, which the system frees when the process ends: one process of this machine at a time.

Several machines that share a folder may each have it. `building/folder_lock.py` has a lock that holds between machines.
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
    """Hold the lock of a file or a folder that is there; waits for it. No file is left over. Raises `OSError`."""
    handle = os.open(path, os.O_RDONLY)
    try:
        take(handle)
        yield
    finally:
        os.close(handle)


def take(handle: int, seconds: float | None = None) -> bool:
    """Lock an open file, which frees it when it is closed; False if another process has it for so many seconds.

    Without a limit it waits for as long as it takes. On a file system without locks every lock counts as taken.
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
