"""The lock on a folder of the build root: one owner at a time, and an owner that is gone does not block others."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import time
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest

from fusesoc_firm.builds.setup import folder_lock
from fusesoc_firm.builds.setup.folder_lock import FolderLock

FORK = multiprocessing.get_context("fork")


def work_alone(path: Path, log: Path, times: int) -> None:
    """Take the lock `times` times, and log the start and end of each exclusive period."""
    for _ in range(times):
        lock = FolderLock(path)
        while lock.acquire():
            time.sleep(0.001)
        with log.open("a") as file:
            file.write("begin\n")
        time.sleep(0.001)
        with log.open("a") as file:
            file.write("end\n")
        lock.release()


def take_and_stay(path: Path) -> None:
    assert FolderLock(path).acquire() is None
    time.sleep(600)


def killed_owner(path: Path) -> BaseProcess:
    """A process that was killed while it held the lock."""
    owner = FORK.Process(target=take_and_stay, args=(path,))
    owner.start()
    while not path.exists():
        time.sleep(0.01)
    assert owner.pid
    os.kill(owner.pid, signal.SIGKILL)
    owner.join()
    return owner


def work_of(path: Path, log: Path, processes: int, times: int) -> list[str]:
    workers = [FORK.Process(target=work_alone, args=(path, log, times)) for _ in range(processes)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
        assert worker.exitcode == 0
    return log.read_text().split()


def test_one_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "below" / "sim.lock"
    assert work_of(path, tmp_path / "log", processes=6, times=20) == ["begin", "end"] * 120
    assert not list(path.parent.iterdir())


def test_who_has_it_is_named(tmp_path: Path) -> None:
    lock, other = FolderLock(tmp_path / "sim.lock"), FolderLock(tmp_path / "sim.lock")
    assert lock.acquire() is None
    assert str(other.acquire()).startswith(f"process {os.getpid()} on ")
    lock.release()
    assert other.acquire() is None


def test_of_a_killed_owner_one_takes_it_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Many processes notice at the same time that the owner is gone."""
    monkeypatch.setattr(folder_lock, "_GRACE_SECONDS", 0.05)
    for number in range(5):
        path, log = tmp_path / f"{number}.lock", tmp_path / f"{number}.log"
        killed_owner(path)
        assert work_of(path, log, processes=6, times=2) == ["begin", "end"] * 12


def test_what_a_killed_owner_started_has_time_to_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder_lock, "_GRACE_SECONDS", 0.5)
    killed_owner(tmp_path / "sim.lock")
    start = time.monotonic()
    assert FolderLock(tmp_path / "sim.lock").acquire() is None
    assert time.monotonic() - start >= 0.5


def test_a_process_of_the_same_number_is_another_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder_lock, "_GRACE_SECONDS", 0)
    path = tmp_path / "sim.lock"
    assert FolderLock(path).acquire() is None
    path.write_text(json.dumps(json.loads(path.read_text()) | {"started": "1"}))
    assert FolderLock(path).acquire() is None


def of_another_machine(path: Path) -> FolderLock:
    """A lock held on another machine, whose process is unknown here."""
    lock = FolderLock(path)
    assert lock.acquire() is None
    path.write_text(json.dumps(json.loads(path.read_text()) | {"machine": "elsewhere", "process": 1, "started": "0"}))
    return lock


def test_an_owner_elsewhere_has_it_while_its_file_is_touched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder_lock, "_GRACE_SECONDS", 0)
    monkeypatch.setattr(folder_lock, "_SILENT_SECONDS", 0.3)
    path = tmp_path / "sim.lock"
    lost, mine = of_another_machine(path), FolderLock(path)
    for _ in range(12):
        assert mine.acquire()
        time.sleep(0.05)
        # The other machine's clock does not matter.
        path.touch()
        os.utime(path, ns=(0, path.stat().st_mtime_ns - 10**18))
    end = time.monotonic() + 0.3
    while mine.acquire():
        time.sleep(0.05)
    assert time.monotonic() >= end
    # It notices this, and removes nothing when it ends.
    assert not lost.beat()
    lost.release()
    assert mine.beat()


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"token": 1}', b"\xff", b"[" * 100_000])
def test_a_damaged_lock_is_removed_after_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes
) -> None:
    monkeypatch.setattr(folder_lock, "_GRACE_SECONDS", 0)
    monkeypatch.setattr(folder_lock, "_SILENT_SECONDS", 0.05)
    path = tmp_path / "sim.lock"
    path.write_bytes(content)
    lock = FolderLock(path)
    assert str(lock.acquire()) == "process 0 on an unknown machine"
    while lock.acquire():
        time.sleep(0.01)
    assert lock.beat()


def test_a_beat_changes_the_time(tmp_path: Path) -> None:
    lock = FolderLock(tmp_path / "sim.lock")
    assert not lock.beat()
    assert lock.acquire() is None
    os.utime(lock.path, ns=(0, 0))
    assert lock.beat()
    assert lock.path.stat().st_mtime_ns > 0
