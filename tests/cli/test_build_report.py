"""The progress bar of builds."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from fusesoc_firm.building.plan import Build
from fusesoc_firm.building.pool import Outcome
from fusesoc_firm.cli.build_report import Report, Words


class Terminal(io.StringIO):
    """A terminal that keeps what it shows."""

    def isatty(self) -> bool:
        return True


def test_the_bar_names_what_runs_now(monkeypatch: pytest.MonkeyPatch) -> None:
    """As soon as a build begins, not when the next one ends."""
    terminal = Terminal()
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(sys, "stderr", terminal)
    one, two = (Build(f"acme:m:{name}:1.0", "sim", Path(name)) for name in ("one", "two"))
    report = Report(Words(), None, None)
    report.plan([one, two])
    report.begin(one, 1)
    assert "0/2" in terminal.getvalue().split("\r")[-1]
    assert "acme:m:one:1.0 sim" in terminal.getvalue().split("\r")[-1]
    report.begin(two, 1)
    assert "acme:m:one:1.0 sim, acme:m:two:1.0 sim" in terminal.getvalue().split("\r")[-1]
    report.end(Outcome(one, False, 1.0))
    assert "acme:m:two:1.0 sim, 1 failed" in terminal.getvalue().split("\r")[-1]
    report.close()
