"""`make debian` refuses what it cannot do in a sentence, and reads results from logs."""

from __future__ import annotations

import os
import runpy
from pathlib import Path
from typing import Any

import pytest

MODULE: dict[str, Any] = runpy.run_path(str(Path(__file__).resolve().parents[2] / ".ci" / "debian.py"))


@pytest.mark.parametrize(
    ("suite", "user", "reason"),
    [
        ("buster", 0, "SUITE is 'buster'; legal: bookworm, trixie, forky"),
        ("trixie", 1000, "only root can build and enter a minimal system: sudo make debian"),
    ],
)
def test_why_nothing_is_run_is_a_sentence(
    suite: str, user: int, reason: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: user)
    assert MODULE["main"]([suite, "true"]) == 1
    assert capsys.readouterr() == ("", f"make debian: {reason}\n")


@pytest.mark.parametrize(
    ("status", "seconds", "printed", "row"),
    [
        (0, 66.4, "log:   build/sim.log\nPASS 100/100\n", "| `make x` | passed | 1:06 | PASS 100/100 |"),
        (
            2,
            1205.0,
            "= 3 failed, 7700 passed, 45 skipped in 1089.85s (0:18:09) =\nmake: *** [Makefile:79: test] Error 1\n",
            "| `make x` | **failed** (exit status 2) | 20:05 | 3 failed, 7700 passed, 45 skipped |",
        ),
        (1, 3, "E: Unable to locate package ghdl\n", "| `make x` | **failed** (exit status 1) | 0:03 |  |"),
    ],
)
def test_a_row_has_the_counts_of_the_log(tmp_path: Path, status: int, seconds: float, printed: str, row: str) -> None:
    log = tmp_path / "1.log"
    log.write_text(printed)
    assert MODULE["Result"]("make x", status, seconds, log).row == row
