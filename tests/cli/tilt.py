"""A project that `firm init` writes, for tests of commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.cli import main


def begin_tilt(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    """Write the project `tilt` below `folder`, which is the home, and return it as the current folder."""
    monkeypatch.chdir(folder)
    for name in ("HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(folder))
    monkeypatch.setenv("FUSESOC_CORES", "")
    assert main(["init", "tilt", "--in", "geometry_msgs/Point", "--out", "geometry_msgs/Vector3"]) == 0
    monkeypatch.chdir(folder / "tilt")
    capsys.readouterr()
    return folder / "tilt"
