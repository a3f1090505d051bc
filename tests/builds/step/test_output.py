"""The output of a step's programs, seen line by line and passed on."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

from fusesoc_firm.builds.step.output import each_line


def test_lines_are_seen_and_passed_on(capfd: pytest.CaptureFixture[str]) -> None:
    code = "import sys; print('a', flush=True); print('b', file=sys.stderr, flush=True); print('c' * 10**6, end='')"
    lines: list[str] = []
    with each_line(lines.append):
        os.write(1, b"begin\r\n")
        subprocess.run([sys.executable, "-c", code], check=True)
    assert lines == ["begin", "a", "b", "c" * 4096]
    assert capfd.readouterr().out == f"begin\r\na\nb\n{'c' * 10**6}"
    os.write(1, b"after\n")
    assert capfd.readouterr().out == "after\n"


def test_a_program_that_stays_does_not_keep_the_step(capfd: pytest.CaptureFixture[str]) -> None:
    lines: list[str] = []
    has_printed = threading.Event()

    def see(line: str) -> None:
        lines.append(line)
        has_printed.set()

    with each_line(see):
        left = subprocess.Popen([sys.executable, "-c", "print('left', flush=True); input()"], stdin=subprocess.PIPE)
        has_printed.wait()
    assert lines == ["left"]
    left.communicate()
    assert capfd.readouterr().out == "left\n"
