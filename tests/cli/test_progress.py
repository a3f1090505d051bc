"""What long commands show while they run."""

from __future__ import annotations

import re
import time

import pytest

from fusesoc_firm.cli import progress
from fusesoc_firm.cli.progress import Progress

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FIRM_PROGRESS", "yes")
    for name in ("_PATIENCE", "_BETWEEN_LINES", "_BETWEEN_UPDATES"):
        monkeypatch.setattr(progress, name, 0.01)


def shown(capsys: Captured, *, is_shown: bool = True) -> str:
    with Progress("reading", is_shown=is_shown) as steps:
        text = ""
        for step in ("reading", "building"):
            steps.step(step)
            while is_shown and step not in text:
                time.sleep(0.01)
                text += capsys.readouterr().err
    return text + capsys.readouterr().err


def test_without_a_terminal_lines_follow_each_other(capsys: Captured) -> None:
    assert re.fullmatch(r"(\[0 s\] reading\n)+(\[0 s\] building\n)+", shown(capsys))


def test_on_a_terminal_one_line_is_updated_and_removed(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    text = shown(capsys)
    assert "\n" not in text
    assert text.startswith("\r\033[K[0 s] reading")
    assert text.endswith("building\r\033[K")


def test_a_text_is_above_the_line(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with Progress("starting") as steps:
        while "starting" not in capsys.readouterr().err:
            time.sleep(0.01)
        steps.say("no page:\nit is missing")
        text = ""
        while "[" not in text.rpartition("missing\n")[2]:
            time.sleep(0.01)
            text += capsys.readouterr().err
    assert "\r\033[Kno page:\nit is missing\n" in text
    assert text.rpartition("missing\n")[2].startswith("\r\033[K[0 s] no page:")


def test_a_quiet_command_and_a_program_that_compares_see_nothing(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert shown(capsys, is_shown=False) == ""
    monkeypatch.setenv("FIRM_PROGRESS", "no")
    with Progress("reading"):
        time.sleep(0.05)
    assert capsys.readouterr().err == ""
