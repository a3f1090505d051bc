"""Reports of a run to one page, each with the changes since the previous report.

Reports are frequent, so that the page moves smoothly. Most of them omit data that change less often, so that watching
hardly slows the run.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from math import inf
from typing import Any

from fusesoc_firm.node.engine.watch import Count, Seen
from fusesoc_firm.studio.message import words_of
from fusesoc_firm.studio.page_run import RUNNING, Run
from fusesoc_firm.system.derived.model import Topic

# The number of messages in a report.
_MOST_NEW = 20
# The time between two figures of a run, which is limited because figures sort all latencies.
_FIGURE_SECONDS = 0.5

Jobs = Mapping[str, Mapping[str, Any]]
"""The states of the latest builds for boards, by kind."""


class Reports:
    """The reports to one page; the first one is complete."""

    def __init__(self) -> None:
        """Begin before the first report."""
        self._state: Mapping[str, Any] | None = None
        self._is_first = True
        self._last, self._reported = -1, -inf
        self._is_stale = False
        self._loads: Mapping[str, Any] = {}
        self._jobs: Jobs = {}

    def next(self, run: Run | None, number: int, file: str, jobs: Jobs) -> dict[str, Any] | None:
        """Return the changes of the builds, and of the run with this number, of a file; None without changes.

        `run` is the state of the run, which is None without a run; `messages` are the newest messages, after `skipped`
        others; `figures` are counts and loads of all blocks; `jobs` are all builds. A report omits unchanged items.
        """
        state = state_of(run, number, file) if run else None
        report: dict[str, Any] = {}
        if self._is_first or state != self._state:
            report["run"] = state
            if state is None or self._state is None or state["number"] != self._state["number"]:
                self._last = -1
            self._is_first, self._state = False, state
        if jobs != self._jobs:
            report["jobs"] = self._jobs = jobs
        if run:
            self._add_messages(run, report)
            self._add_figures(run, report)
        return report or None

    def _add_messages(self, run: Run, report: dict[str, Any]) -> None:
        news = run.watch.since(self._last, _MOST_NEW)
        if news.last != self._last:
            report |= {"first": run.watch.first, "last": news.last, "skipped": news.skipped}
            topics = run.topics
            report["messages"] = [row(seen, topics) for seen in news.messages]
            self._last, self._is_stale = news.last, True

    def _add_figures(self, run: Run, report: dict[str, Any]) -> None:
        # Queues may change without messages, and the rates of a run then fall.
        is_running = run.state == RUNNING and not is_paused(run)
        is_changing = is_running or self._is_stale or run.watch.loads() != self._loads
        now = time.monotonic()
        if "run" in report or (is_changing and now >= self._reported + _FIGURE_SECONDS):
            report["figures"] = figures(run)
            self._reported, self._is_stale, self._loads = now, False, {**run.watch.loads()}


def state_of(run: Run, number: int, file: str) -> dict[str, Any]:
    """Return the state of a run as shown to the user."""
    clock = run.system.clock
    return {
        "number": number,
        "file": file,
        "title": run.title,
        "state": run.state,
        "text": run.text,
        "isPaused": is_paused(run),
        "isControlled": run.control is not None,
        "clock": None if clock is None else float(clock),
        "wires": run.wires,
    }


def is_paused(run: Run) -> bool:
    """Whether the user has paused a run."""
    return run.control is not None and not run.control.is_open


def figures(run: Run) -> dict[str, Any]:
    """Return counts and loads of all blocks of a run, the waits of its wires, and the time that they cover."""
    watch = run.watch
    return {
        "seconds": time.monotonic() - watch.start_ns / 1e9,
        "counts": {block: _counted(count) for block, count in watch.counts().items()},
        "loads": {block: vars(load) for block, load in watch.loads().items()},
        "waits": watch.waits_of_all and vars(watch.waits_of_all),
    }


def row(seen: Seen, topics: Mapping[str, Topic]) -> tuple[object, ...]:
    """Return a message: number, block, time, bytes, cause, cycles, ns of the wall clock, and its fields as words."""
    latency = seen.latency
    return (
        seen.number,
        seen.block,
        seen.time_ns / 1e9,
        len(seen.payload),
        latency.cause,
        latency.cycles,
        latency.wall_ns,
        words_of(topics[seen.block].frame, seen.payload),
    )


def _counted(count: Count) -> dict[str, Any]:
    """Return the counts of a block as plain data; `asdict` copies deeply, which would take most of a report's time."""
    percentiles = {"cycles": count.cycles, "wall_ns": count.wall_ns}
    return vars(count) | {name: found and vars(found) for name, found in percentiles.items()}
