"""`make matrix` before it needs a package index: finds Pythons, and reports missing and failing ones."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tools import matrix

# Builds the wheel, and then finds no packages to install.
UV = """
PATH=/bin
[ "$1" = build ] || { echo "there is no index"; exit 2; }
while [ "$1" != --out-dir ]; do shift; done
mkdir "$2"
touch "$2/firm.whl"
"""


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that is the whole PATH of a machine without pyenv."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path / "pyenv"))
    return tmp_path


def add(path: Path, script: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


def test_every_version_that_can_be_installed_is_supported() -> None:
    project = tomllib.loads(matrix.PROJECT.read_text(encoding="utf-8"))["project"]
    versions = matrix.supported()
    assert project["requires-python"] == f">={versions[0]}"
    assert versions == [f"3.{minor}" for minor in range(11, 11 + len(versions))]
    assert "3.14" in versions


def test_pythons_are_found(machine: Path) -> None:
    on_path = add(machine / "python3.11", "echo 3.11")
    # The answer of pyenv's shims for a version that is not selected.
    add(machine / "python3.12", "exit 127")
    of_pyenv = add(machine / "pyenv" / "versions" / "3.12.1" / "bin" / "python3.12", "echo 3.12")
    add(machine / "pyenv" / "versions" / "3.11.9" / "bin" / "python3.11", "echo 3.11")
    named = add(machine / "elsewhere" / "python3", "echo 3.14")
    too_old = add(machine / "elsewhere" / "python3.10", "echo 3.10")
    absent = machine / "absent"
    found = matrix.find(map(str, (named, too_old, absent)))
    assert found == {"3.14": named, "3.11": on_path, "3.12": of_pyenv}


def test_a_failure_and_what_was_not_found_are_told(
    machine: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    add(machine / "python3.13", "echo 3.13")
    monkeypatch.setattr(matrix, "UV", add(machine / "uv", UV))
    assert matrix.main([]) == 1
    out, err = capsys.readouterr()
    assert "there is no index" in err
    failed = [line.replace("|", " ").split() for line in out.splitlines() if "FAILED" in line]
    assert [cells[:2] for cells in failed] == [["3.13", "oldest"], ["3.13", "newest"]]
    assert out.splitlines()[-1].startswith("Not found: Python 3.11, 3.12, 3.14.")
