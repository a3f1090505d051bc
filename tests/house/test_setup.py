"""Set-up installs what is missing, does nothing twice, and says what to do where it may not install."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


class Machine:
    """A folder of programs, which is all that the set-up finds on PATH."""

    def __init__(self, folder: Path) -> None:
        self.programs = folder / "bin"
        self.log = folder / "log"
        self.programs.mkdir()

    def add(self, name: str, script: str = "") -> None:
        # Only a new file: nothing is ever written through what lies there.
        with (self.programs / name).open("x") as file:
            file.write(f"#!/bin/bash\n{script}\n")
        (self.programs / name).chmod(0o755)

    def add_apt(self, *brings: str) -> None:
        """Add an apt-get that notes how it is called, and whose `install` brings programs."""
        copies = [f'[ "$1" = update ] || /bin/cp "$0" {self.programs}/{name}' for name in brings]
        self.add("apt-get", "\n".join([f'echo "$DEBIAN_FRONTEND $*" >> {self.log}', 'echo "apt talks"', *copies]))

    def install(self) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["/bin/bash", ROOT / ".ci" / "install-tools"],
            env={"PATH": str(self.programs)},
            text=True,
            capture_output=True,
            check=False,
        )


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    machine = Machine(tmp_path)
    # A Python that has what is asked for: the script asks by its exit status.
    machine.add("python3", "exit 0")
    return machine


def test_nothing_is_installed_where_all_is_there(machine: Machine) -> None:
    machine.add("ghdl")
    machine.add("g++")
    machine.add_apt()
    done = machine.install()
    assert (done.stdout, done.stderr, done.returncode) == ("python3\n", "", 0)
    assert not machine.log.exists()


def test_what_is_missing_is_installed(machine: Machine) -> None:
    machine.add("id", "echo 0")
    machine.add_apt("ghdl", "g++")
    done = machine.install()
    # Only the Python to use goes to stdout; make reads it.
    assert (done.stdout, done.returncode) == ("python3\n", 0), done.stderr
    assert machine.log.read_text() == (
        "noninteractive update -q\nnoninteractive install -q -y --no-install-recommends ghdl g++\n"
    )


def test_without_root_it_says_what_is_missing(machine: Machine) -> None:
    machine.add("g++")
    machine.add("id", "echo 1000")
    machine.add_apt("ghdl")
    done = machine.install()
    assert (done.stdout, done.returncode) == ("", 1)
    assert done.stderr.startswith("Missing: ghdl\nOnly root may install them.")
    assert "  apt-get install --no-install-recommends ghdl\n" in done.stderr
    assert not machine.log.exists()


def test_without_apt_it_says_what_is_missing(machine: Machine) -> None:
    done = machine.install()
    assert done.returncode == 1
    assert done.stderr.startswith("Missing: ghdl g++\nThere is no apt-get")


def test_what_apt_did_not_bring_is_said(machine: Machine) -> None:
    machine.add("id", "echo 0")
    machine.add_apt("g++")
    done = machine.install()
    assert done.returncode == 1
    assert "Missing: ghdl\napt-get ran" in done.stderr


def test_make_without_a_target_lists_them() -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    done = subprocess.run(["make"], cwd=ROOT, env=environment, text=True, capture_output=True, check=True)
    listed = [line.split()[0] for line in done.stdout.splitlines()[1:]]
    assert listed == [
        "help",
        "sim",
        "test",
        "corpus",
        "bench",
        "bitstream",
        "proofs",
        "lint",
        "setup",
        "clean",
        "distclean",
    ]


@pytest.mark.parametrize(
    ("variables", "arguments"),
    [
        ([], "robot:sys:quat2euler"),
        (["SEED=7"], 'robot:sys:quat2euler --sim_options="-gSEED=7"'),
        (["SYSTEM=a:b:c", "SEED=7", "WAVES=1"], 'a:b:c --sim_options="-gSEED=7 --wave=waves.ghw"'),
    ],
)
def test_make_sim_passes_its_variables_on(variables: list[str], arguments: str) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    command = ["make", "--dry-run", "sim", *variables]
    done = subprocess.run(command, cwd=ROOT, env=environment, text=True, capture_output=True, check=True)
    assert f" .venv/bin/fusesoc run --target=sim {arguments} 2>&1 | " in " ".join(done.stdout.split())


@pytest.mark.parametrize("status", [0, 1])
def test_make_sim_prints_the_path_of_its_waves(tmp_path: Path, status: int) -> None:
    """Of a run that fails, too; programs that do nothing stand in for ours."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    waves = "build/a_b_c_1/sim/waves.ghw"
    programs = {
        ".ci/install-tools": "true",
        ".venv/bin/python": "true",
        ".venv/bin/fusesoc": f"mkdir -p {Path(waves).parent}; touch {waves}; echo PASS 1/1; exit {status}",
    }
    for name, text in programs.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        path.chmod(0o755)
    for name in ("pyproject.toml", ".venv/.installed"):
        (tmp_path / name).touch()
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    command = ["make", "sim", "SYSTEM=a:b:c", "WAVES=1"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, text=True, capture_output=True, check=False)
    assert done.stdout.splitlines()[-2:] == ["PASS 1/1", f"waves: {waves}"], done.stderr
    assert bool(done.returncode) is bool(status)


def make_corpus(corpus: Path) -> list[str]:
    """What `make corpus` would do, line by line."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    command = ["make", "--dry-run", "corpus", f"CORPUS={corpus}", "VERIFY_OPTIONS=--width 64"]
    return subprocess.run(
        command, cwd=ROOT, env=environment, text=True, capture_output=True, check=True
    ).stdout.splitlines()


def test_make_corpus_verifies_both_versions(tmp_path: Path) -> None:
    for ros in ("ros1", "ros2"):
        (tmp_path / ros).mkdir()
    text = " ".join(" ".join(make_corpus(tmp_path)).replace("\\", "").split())
    expected = (
        f'firm message verify --ros $ros --path "{tmp_path}/ros$ros" --report build/corpus_ros$ros.json --width 64'
    )
    assert expected in text


def test_make_corpus_without_a_corpus_is_one_line(tmp_path: Path) -> None:
    (line,) = make_corpus(tmp_path)
    assert line.startswith(f"echo \"No corpus: '{tmp_path}' has no folders ros1 and ros2")
