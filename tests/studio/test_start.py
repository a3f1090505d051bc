"""`firm studio` shows its progress while it starts."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import pytest

from fusesoc_firm.cli import main, progress
from fusesoc_firm.studio import page_files, server


class EndError(Exception):
    """The end of a server that would run until Ctrl-C."""


def test_a_slow_start_shows_its_progress(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FIRM_PROGRESS", "yes")
    monkeypatch.setattr(progress, "_PATIENCE", 0.01)
    monkeypatch.setattr(progress, "_BETWEEN_LINES", 0.01)
    monkeypatch.setattr(page_files, "build_page", lambda _: time.sleep(0.2))
    seen: list[str] = []

    async def wait(_: object) -> None:
        seen.append(capsys.readouterr().err)
        await asyncio.sleep(0.1)
        seen.append(capsys.readouterr().err)
        raise EndError

    monkeypatch.setattr(asyncio.Event, "wait", wait)
    monkeypatch.setattr(server, "PAGE", tmp_path)
    with pytest.raises(EndError):
        main(["studio", str(tmp_path), "--no-browser"])
    assert seen[0].startswith("[0 s] starting the page's server\n")
    # It ends with the address.
    assert seen[1] == ""
