"""What the processes of a run of tests make once and share: compiled programs, built simulators."""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

SHARED = "FIRM_TESTS_SHARED"
"""The variable with the folder of a run, which tests/conftest.py sets."""


def made_once(name: str, make: Callable[[Path], object]) -> Path:
    """The folder `name` of this run, which `make` has filled, in whichever process asks first."""
    folder = Path(os.environ[SHARED]) / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    with locked(folder.with_name(f"{folder.name}.lock")):
        if not folder.is_dir():
            folder.mkdir()
            try:
                make(folder)
            except BaseException:
                shutil.rmtree(folder)
                raise
    return folder


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a lock file. That another process works for minutes is no fault of a test that waits (tests/conftest.py)."""
    with path.open("w") as lock:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGALRM])
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        yield
