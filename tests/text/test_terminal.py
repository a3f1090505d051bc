"""What a command prints never controls a terminal."""

from __future__ import annotations

import io
import sys

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.text.terminal import safe, safe_output

HOSTILE = "a\x1b]0;title\x07b\x1b[2Jc\x9b31md\u202ee\udc80f\x7f"
ESCAPED = r"a\x1b]0;title\x07b\x1b[2Jc\x9b31md\u202ee\udc80f\x7f"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_codes_are_escaped() -> None:
    assert safe(HOSTILE) == ESCAPED
    assert safe("é µs\u00a0→ 🤖\n\tb\r") == "é µs\u00a0→ 🤖\n\tb\r"


def test_all_that_is_printed_is_safe(capsys: pytest.CaptureFixture[str]) -> None:
    with safe_output():
        print(HOSTILE, "\033[32mgreen\033[0m")
        print(HOSTILE, file=sys.stderr)
    found = capsys.readouterr()
    assert (found.out, found.err) == (rf"{ESCAPED} \x1b[32mgreen\x1b[0m" + "\n", f"{ESCAPED}\n")


def test_own_colours_remain_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    with safe_output():
        print(f"\r\033[K\033[32mpassed\033[0m {HOSTILE}")
    assert terminal.getvalue() == f"\r\033[K\033[32mpassed\033[0m {ESCAPED}\n"
    assert sys.stdout is terminal


def test_the_command_line_itself_is_safe(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["no\x1b[2J"])
    assert "\x1b" not in capsys.readouterr().err
