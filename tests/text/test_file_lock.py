"""The system's lock on a file or a folder: one holder at a time."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import pytest

from fusesoc_firm.text.file_lock import locked, take


def test_a_lock_that_is_held_is_waited_for(tmp_path: Path) -> None:
    entered = threading.Event()

    def wait_for_it() -> None:
        with locked(tmp_path):
            entered.set()

    waiting = threading.Thread(target=wait_for_it)
    with locked(tmp_path):
        waiting.start()
        assert not entered.wait(0.1)
    waiting.join()
    assert entered.is_set()
    assert not list(tmp_path.iterdir())


def test_a_limit_ends_the_waiting(tmp_path: Path) -> None:
    handle = os.open(tmp_path, os.O_RDONLY)
    try:
        with locked(tmp_path):
            start = time.monotonic()
            assert not take(handle, 0.1)
            assert time.monotonic() - start >= 0.1
            assert not take(handle, -1)
        assert take(handle, 0)
    finally:
        os.close(handle)


def test_a_file_system_without_locks_counts_as_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(37, "No locks available")

    monkeypatch.setattr("fcntl.flock", refuse)
    with locked(tmp_path), locked(tmp_path):
        pass
