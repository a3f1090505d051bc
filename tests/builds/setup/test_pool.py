"""Builds in parallel, and how their processes end."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.setup.pool import Pool

PR_SET_CHILD_SUBREAPER = 36


def leave_a_zombie(_fusesoc: Any, build: Build, _options: tuple[str, ...]) -> None:
    """End while a program of the build, which has ended, is not reaped, as after a sandbox."""
    if (child := os.fork()) == 0:
        os._exit(0)
    os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)
    build.work_root.with_name("zombie").write_text(str(child))


def test_zombies_of_a_build_are_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr("fusesoc_firm.builds.setup.pool.time.sleep", slept.append)
    plan: Any = SimpleNamespace(fusesoc=None, builds=(Build("a:b:c:1", "sim", tmp_path / "work"),))
    prctl = ctypes.CDLL(None).prctl
    # The zombie becomes a child of this process, which does not reap it until the end.
    assert prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0) == 0
    try:
        outcomes = [*Pool((), 1, print, run_build=leave_a_zombie).run(plan)]
    finally:
        prctl(PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0)
    assert os.waitpid(int((tmp_path / "zombie").read_text()), 0)[1] == 0
    assert [item.result for item in outcomes] == ["ok"]
    assert slept == []
