"""What the processes of a run of tests make once and share: compiled programs, built simulators."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from fusesoc_firm.text.file_lock import locked

SHARED = "FIRM_TESTS_SHARED"
"""The variable with the folder of a run, which tests/conftest.py sets."""


def made_once(name: str, make: Callable[[Path], object]) -> Path:
    """The folder `name` of this run, which `make` has filled, in whichever process asks first."""
    folder = Path(os.environ[SHARED]) / name
    mark = folder.with_name(f"{folder.name}.made")
    folder.mkdir(parents=True, exist_ok=True)
    with patient_lock(folder):
        if not mark.exists():
            make(folder)
            mark.touch()
    return folder


@contextmanager
def patient_lock(folder: Path) -> Iterator[None]:
    """Lock a folder. That another process works for minutes is no fault of a test that waits (tests/conftest.py)."""
    with ExitStack() as stack:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGALRM])
        try:
            stack.enter_context(locked(folder))
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        yield
