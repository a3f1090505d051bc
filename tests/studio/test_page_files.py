"""A checkout builds its page when the sources are newer, and says in the terminal what it does or lacks."""

from __future__ import annotations

import os
import runpy
import shutil
import sys
from pathlib import Path

import pytest

from fusesoc_firm.studio import page_files

ROOT = Path(__file__).resolve().parents[2]
NPM = '#!/bin/sh\necho "$@" >> calls\n{}\n'
BUILDS = 'if [ "$1" = run ]; then mkdir -p ../static; touch -d "+1 minute" ../static/index.html; fi'


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout's room without the built page and without npm."""
    (tmp_path / "page" / "src").mkdir(parents=True)
    for name in ("src/App.svelte", "package-lock.json"):
        (tmp_path / "page" / name).touch()
    monkeypatch.setattr(page_files, "PAGE", tmp_path / "static")
    monkeypatch.setattr(page_files, "_SOURCES", tmp_path / "page")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "bin" / "python"))
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}{os.pathsep}/usr/bin{os.pathsep}/bin")
    monkeypatch.setattr(shutil, "which", lambda _, path: _found(path))
    return tmp_path


def _found(path: str) -> str | None:
    program = Path(path.partition(os.pathsep)[0]) / "npm"
    return str(program) if program.exists() else None


def put_npm(room: Path, what: str) -> None:
    (room / "bin").mkdir()
    (room / "bin" / "npm").write_text(NPM.format(what), encoding="utf-8")
    (room / "bin" / "npm").chmod(0o755)


def test_it_is_built_once(room: Path) -> None:
    put_npm(room, BUILDS)
    told: list[str] = []
    page_files.build_page(told.append)
    assert told == ["building the page from its sources"]
    calls = (room / "page" / "calls").read_text(encoding="utf-8").splitlines()
    assert [call.split()[0] for call in calls] == ["ci", "run"]
    page_files.build_page(told.append)
    page_files.say_if_missing(told.append)
    assert len(told) == 1
    # A changed source; the packages are there.
    (room / "page" / "node_modules").mkdir()
    later = (room / "static" / "index.html").stat().st_mtime + 60
    os.utime(room / "page" / "src" / "App.svelte", (later, later))
    page_files.build_page(told.append)
    assert len(told) == 2
    assert len((room / "page" / "calls").read_text(encoding="utf-8").splitlines()) == 3


def test_what_is_missing_is_said(room: Path) -> None:
    told: list[str] = []
    page_files.build_page(told.append)
    page_files.say_if_missing(told.append)
    assert "npm is missing: 'make studio' builds it" in told[0]
    assert told[1] == "the page is not built, so the browser shows none: 'make studio' builds it"


def test_a_failed_build_is_said_with_its_output(room: Path) -> None:
    put_npm(room, "echo no network >&2; exit 3")
    told: list[str] = []
    page_files.build_page(told.append)
    (failure,) = told[1:]
    assert failure.startswith("the page cannot be built: ci ")
    assert failure.endswith("failed; 'make studio' builds it\nno network")


def test_an_installation_has_no_sources(room: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_files, "_SOURCES", room / "missing")
    told: list[str] = []
    page_files.build_page(told.append)
    assert told == []
    page_files.say_if_missing(told.append)
    assert told == [
        "the page is not built, so the browser shows none: install a wheel that was built after 'make studio'"
    ]


@pytest.mark.parametrize("command", ["bdist_wheel", "egg_info"])
def test_a_wheel_without_the_page_is_built_with_a_warning(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("setup.py", "README.md"):
        shutil.copy(ROOT / name, tmp_path)
    monkeypatch.setattr("setuptools.setup", lambda **_: None)
    monkeypatch.setattr(sys, "argv", ["setup.py", command])
    runpy.run_path(str(tmp_path / "setup.py"))
    assert ("'make studio' builds the page first" in capsys.readouterr().err) == (command == "bdist_wheel")
    page = tmp_path / "fusesoc_firm" / "studio" / "static" / "index.html"
    page.parent.mkdir(parents=True)
    page.touch()
    runpy.run_path(str(tmp_path / "setup.py"))
    assert capsys.readouterr().err == ""
