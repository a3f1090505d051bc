"""Where the time of a test run goes: the seconds of each room of tests and of its slowest tests, the longest first.

A test has the seconds of the processor that its process and the ended processes below it take, which say the same on
a busy machine as on an idle one, and those of the clock. The last lines show how many runs of tools were recalled
(tests/recall.py), and idle time: of processes without a test, and of processors.
"""

from __future__ import annotations

import os
import time
from collections import defaultdict
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import PurePosixPath

import pytest
from _pytest.terminal import TerminalReporter

from tests.recall import COUNTS

_SLOWEST = 10
_BEGUN = time.monotonic()


@dataclass
class Seconds:
    """Of the processor and of the clock."""

    processor: float = 0.0
    clock: float = 0.0

    def __str__(self) -> str:
        return f"{self.processor:9.1f} {self.clock:7.1f}"


class _Meter:
    """The processor seconds since it was read last."""

    def __init__(self) -> None:
        self._last = 0.0

    def read(self) -> float:
        now = sum(os.times()[:4])
        passed, self._last = now - self._last, now
        return passed


_METER = _Meter()


def room_of(test: str) -> str:
    """The room of a test by its id; `tests` for what lies in none."""
    return str(PurePosixPath(*PurePosixPath(test.partition("::")[0]).parent.parts[:2]))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup() -> Iterator[None]:
    _METER.read()
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A report of a stage takes its seconds along, from one process of a run to the other."""
    report = yield
    vars(report).update(processor=_METER.read(), recalled=COUNTS.recalled, run=COUNTS.run)
    COUNTS.recalled = COUNTS.run = 0
    return report


def pytest_terminal_summary(terminalreporter: TerminalReporter, config: pytest.Config) -> None:
    rooms: dict[str, Seconds] = defaultdict(Seconds)
    tests: dict[str, Seconds] = defaultdict(Seconds)
    total, recalled, run = Seconds(), 0, 0
    for reports in terminalreporter.stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport):
                for seconds in (rooms[room_of(report.nodeid)], tests[report.nodeid], total):
                    seconds.processor += getattr(report, "processor", 0.0)
                    seconds.clock += report.duration
                recalled += getattr(report, "recalled", 0)
                run += getattr(report, "run", 0)
    _write(terminalreporter, f"the {_SLOWEST} slowest tests", dict(_longest(tests)[:_SLOWEST]))
    _write(terminalreporter, "the rooms", {**dict(_longest(rooms)), "in all": total})
    terminalreporter.line(f"runs of tools: {recalled:,} were recalled, {run:,} ran")
    terminalreporter.line(_run(total, getattr(config.option, "numprocesses", None) or 1))


def _run(total: Seconds, processes: int) -> str:
    clock, processors = time.monotonic() - _BEGUN, len(os.sched_getaffinity(0))
    had_tests, worked = total.clock / (processes * clock), total.processor / (processors * clock)
    return (
        f"{clock:.0f} s by the clock; processes: {processes}, which had tests for {had_tests:.0%} of it; "
        f"processors: {processors}, which worked for {worked:.0%} of it"
    )


def _longest(seconds: dict[str, Seconds]) -> list[tuple[str, Seconds]]:
    return sorted(seconds.items(), key=lambda item: -item[1].processor)


def _write(terminal: TerminalReporter, title: str, rows: dict[str, Seconds]) -> None:
    terminal.section(title)
    terminal.line("processor   clock  seconds of all processes")
    for name, seconds in rows.items():
        terminal.line(f"{seconds}  {name}")
