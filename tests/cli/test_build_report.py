"""The progress bar of builds."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from fusesoc_firm.builds.setup.outcome import Build, Outcome
from fusesoc_firm.cli.build_report import Outputs, Report, Words
from fusesoc_firm.text.diagnostics import InputError


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
    report = Report(Words(), Outputs())
    report.plan([one, two])
    report.begin(one, 1)
    assert "0/2" in terminal.getvalue().split("\r")[-1]
    assert "acme:m:one:1.0 sim" in terminal.getvalue().split("\r")[-1]
    report.begin(two, 1)
    assert "acme:m:one:1.0 sim, acme:m:two:1.0 sim" in terminal.getvalue().split("\r")[-1]
    report.end(Outcome(one, False, 1.0))
    assert "acme:m:two:1.0 sim, 1 failed" in terminal.getvalue().split("\r")[-1]
    report.close()


def outcomes(folder: Path) -> list[Outcome]:
    found = []
    for name, is_good in (("one", True), ("two", False)):
        build = Build(f"acme:m:{name}:1.0", "sim", folder / name)
        build.log.parent.mkdir(parents=True, exist_ok=True)
        build.log.write_text(f"{name} begins\n{name} ends\n")
        found.append(Outcome(build, is_good, 1.0, last_lines=() if is_good else (f"{name} ends",)))
    return found


@pytest.mark.parametrize("outputs", [Outputs(), Outputs(is_quiet=True), Outputs(is_verbose=True)])
def test_what_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str], outputs: Outputs) -> None:
    """Failures and the summary always, the table unless it is quiet, and all logs if it is verbose."""
    rows = outcomes(tmp_path)
    report = Report(Words(), outputs)
    report.plan([row.build for row in rows])
    for row in rows:
        report.end(row)
    report.close()
    with pytest.raises(InputError, match="1 of 2 builds failed"):
        report.finish()
    said = capsys.readouterr().out
    assert "acme:m:two:1.0 sim failed; the last lines of" in said and "2 builds in" in said
    assert ("core            target" in said) == (not outputs.is_quiet)
    assert ("acme:m:one:1.0 sim: ok\none begins\none ends" in said) == outputs.is_verbose
