"""Atomic writes of files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fusesoc_firm.text.files import read_file, write_if_changed, write_whole


def test_write_if_changed_keeps_an_unchanged_file(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b.vhd"
    assert write_if_changed(path, "é\n")
    before = path.stat()
    assert not write_if_changed(path, "é\n".encode())
    assert path.stat().st_mtime_ns == before.st_mtime_ns
    assert path.stat().st_ino == before.st_ino
    assert write_if_changed(path, "other\r\n")
    assert path.read_bytes() == b"other\r\n"
    assert [entry.name for entry in path.parent.iterdir()] == ["b.vhd"]


def test_a_file_that_cannot_be_put_in_place_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OSError, match="No space left"):
        write_whole(tmp_path / "a", b"whole")
    assert [*tmp_path.iterdir()] == []


def test_what_cannot_be_read_is_none(tmp_path: Path) -> None:
    assert read_file(tmp_path) is None
    assert read_file(tmp_path / "none") is None
