"""Where the time of a test run goes: the seconds of each folder of tests, the longest first."""

from __future__ import annotations

from collections import defaultdict
from pathlib import PurePosixPath

import pytest
from _pytest.terminal import TerminalReporter


def folder_of(test: str) -> str:
    """The folder of a test by its id; below `unit`, the room that it tests."""
    folder = PurePosixPath(test.partition("::")[0]).parent
    return str(PurePosixPath(*folder.parts[:3]))


def pytest_terminal_summary(terminalreporter: TerminalReporter) -> None:
    seconds: dict[str, float] = defaultdict(float)
    for reports in terminalreporter.stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport):
                seconds[folder_of(report.nodeid)] += report.duration
    terminalreporter.section("seconds by folder, of all processes")
    for folder, total in sorted(seconds.items(), key=lambda item: -item[1]):
        terminalreporter.line(f"{total:8.1f}  {folder}")
    terminalreporter.line(f"{sum(seconds.values()):8.1f}  in all")
