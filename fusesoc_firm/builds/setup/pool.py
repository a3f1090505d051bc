"""Run several builds on this machine in parallel, but only one at a time in each build folder."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING

from fusesoc_firm.builds.setup.folder_lock import BEAT_SECONDS, FolderLock
from fusesoc_firm.builds.setup.outcome import Build, Limits, Outcome, ignore
from fusesoc_firm.builds.setup.process import Run, build_in_this_process, last_lines, run_all
from fusesoc_firm.tools.processes import process_status

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.plan import Plan

_POLL_SECONDS = 0.2
# The time in seconds between the request to end and the kill.
_PATIENCE_SECONDS = 5.0
_END_POLL_SECONDS = 0.02
SHOWN_LINES = 20
"""The number of lines shown from a failed build's log."""


@dataclass
class _Running:
    build: Build
    number: int
    lock: FolderLock
    process: BaseProcess
    started: float
    beaten: float


@dataclass(frozen=True)
class Pool:
    """A runner of at most `jobs` parallel builds with the options of `fusesoc run`.

    `tell` reports waiting builds, and `begin` receives each started build with the number of its try. `run_build` runs
    one build in a separate process.
    """

    options: tuple[str, ...]
    jobs: int
    tell: Callable[[str], None]
    limits: Limits = field(default_factory=Limits)
    begin: Callable[[Build, int], None] = ignore
    run_build: Run = run_all

    def run(self, plan: Plan) -> Iterator[Outcome]:
        """Yield the outcome of each build as it finishes. On exit, end all started processes."""
        waiting = {build: FolderLock(build.lock) for build in plan.builds}
        running: list[_Running] = []
        told: set[Build] = set()
        failed: dict[Build, Outcome] = {}
        alive = os.pipe()
        # In a copy of this process, the garbage collector would write to each object, and so copy its page.
        gc.freeze()
        try:
            while waiting or running:
                for build, lock in list(waiting.items())[: self.jobs]:
                    if len(running) < self.jobs and self._take(build, lock, told):
                        del waiting[build]
                        number = failed[build].tries + 1 if build in failed else 1
                        running.append(self._start(plan, build, number, lock, alive))
                        self.begin(build, number)
                wait([item.process.sentinel for item in running], _POLL_SECONDS)
                for item in [*running]:
                    if item.process.exitcode is None and not self._is_late(item) and _holds(item):
                        continue
                    running.remove(item)
                    outcome = self._finish(item, failed.get(item.build))
                    if outcome.is_good or item.number > self.limits.retries:
                        yield outcome
                    else:
                        failed[item.build] = outcome
                        waiting[item.build] = item.lock
        finally:
            gc.unfreeze()
            _end(running)
            for end in alive:
                os.close(end)

    def _take(self, build: Build, lock: FolderLock, told: set[Build]) -> bool:
        owner = lock.acquire()
        if owner and build not in told:
            self.tell(f"{build}: waiting for {owner}, which is building in {build.work_root}")
            told.add(build)
        return owner is None

    def _is_late(self, item: _Running) -> bool:
        return 0 < self.limits.seconds < time.monotonic() - item.started

    def _start(self, plan: Plan, build: Build, number: int, lock: FolderLock, alive: tuple[int, int]) -> _Running:
        process = multiprocessing.get_context("fork").Process(
            target=build_in_this_process, args=(plan.fusesoc, build, self.options, alive, self.run_build)
        )
        process.start()
        return _Running(build, number, lock, process, time.monotonic(), time.monotonic())

    def _finish(self, item: _Running, former: Outcome | None) -> Outcome:
        """End a build, and return its outcome; `former` is that of the previous try."""
        status, is_late = item.process.exitcode, self._is_late(item)
        _end([item])
        seconds = time.monotonic() - item.started
        if status == 0:
            return Outcome(item.build, True, seconds, former.last_lines if former else (), item.number)
        lines = last_lines(item.build.log, SHOWN_LINES)
        if status is None and is_late:
            lines.append(f"ended at the time limit of {self.limits.seconds:g} s")
        elif status is None:
            lines = [
                f"another machine took over {item.build.work_root} because this build had shown no activity for a while"
            ]
        elif status < 0:
            lines.append(f"ended by {signal.Signals(-status).name}")
        return Outcome(item.build, False, seconds, tuple(lines), item.number)


def _holds(item: _Running) -> bool:
    """Return whether a build still holds its folder's lock, and renew the lock at intervals."""
    if time.monotonic() - item.beaten < BEAT_SECONDS:
        return True
    item.beaten = time.monotonic()
    return item.lock.beat()


def _end(items: list[_Running]) -> None:
    """End the running processes of builds, then release their locks."""
    patience = time.monotonic() + _PATIENCE_SECONDS
    for item in items:
        _signal(item.process, signal.SIGTERM)
    for item in items:
        item.process.join(max(0.0, patience - time.monotonic()))
        while time.monotonic() < patience and _signal(item.process, signal.SIGTERM) and not _has_ended(item.process):
            time.sleep(_END_POLL_SECONDS)
        _signal(item.process, signal.SIGKILL)
        item.process.join()
        item.lock.release()


def _signal(process: BaseProcess, number: signal.Signals) -> bool:
    """Send a signal to a build and all its processes; return False if no process is left."""
    assert process.pid
    try:
        os.killpg(process.pid, number)
    except ProcessLookupError:
        # The process is not yet a group leader, or has ended.
        if process.is_alive():
            os.kill(process.pid, number)
        return process.is_alive()
    return True


def _has_ended(process: BaseProcess) -> bool:
    """Return whether only zombies are left of a build's processes; the system reaps those of a sandbox."""
    found = (process_status(entry.name) for entry in Path("/proc").glob("[0-9]*"))
    return {status.state for status in found if status and status.group == str(process.pid)} == {"Z"}
