"""The linters are the authority on style and types; their configuration is in pyproject.toml."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


LINTERS = [["ruff", "check", "--no-cache", "."], pytest.param(["mypy"], marks=pytest.mark.check)]


@pytest.mark.parametrize("linter", LINTERS, ids=["ruff", "mypy"])
def test_lint(linter: list[str]) -> None:
    done = subprocess.run([sys.executable, "-m", *linter], cwd=ROOT, text=True, capture_output=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
