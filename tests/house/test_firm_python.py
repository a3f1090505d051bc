"""The generators find a Python with the package, whatever `python3` FuseSoC uses to start them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

from fusesoc_firm import __version__

GENERATORS = Path(__file__).resolve().parents[2] / "generators"
# Replaces the package: prints which Python answers, and the arguments.
ANSWER = "import sys\ndef main(command, argv):\n    print(command, *argv, 'in', sys.prefix)\n    return 3\n"


def make_environment(folder: Path, *, has_package: bool) -> Path:
    """Create a virtual environment, and return its Python."""
    venv.create(folder, symlinks=True)
    site_packages = folder / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
    if has_package:
        (site_packages / "fusesoc_firm" / "builds" / "call").mkdir(parents=True)
        (site_packages / "fusesoc_firm" / "builds" / "call" / "answer.py").write_text(ANSWER)
        packages = (f"fusesoc_firm/{name}__init__.py" for name in ("", "builds/", "builds/call/"))
        for name in (*packages, "chevron.py", "rosbags.py", "yaml.py"):
            (site_packages / name).write_text("")
    return folder / "bin" / "python3"


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """The `python3` of a user who has not activated an environment."""
    return make_environment(tmp_path / "bare", has_package=False)


@pytest.fixture
def owner(tmp_path: Path) -> Path:
    """The Python that has the package."""
    return make_environment(tmp_path / "owner", has_package=True)


def put_generators(folder: Path) -> Path:
    """Copy the generator scripts to `folder`; return that of `far`."""
    shutil.copytree(GENERATORS, folder, ignore=shutil.ignore_patterns("__pycache__"))
    return folder / "far_generator.py"


def call(*command: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command like a shell, without variables that could lead to the package."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "FUSESOC", "VIRTUAL_"))}
    return subprocess.run(
        ["sh", "-c", '"$@"; exit $?', "sh", *map(str, command)],
        env=kept | environment,
        text=True,
        capture_output=True,
        check=False,
    )


def answer(environment: Path) -> tuple[str, int]:
    """The output and exit status of the replacement package in an environment's Python."""
    return f"far input.yml in {environment.parents[1]}\n", 3


def test_the_python_it_is_started_with_is_used_if_it_has_the_package(tmp_path: Path, owner: Path) -> None:
    done = call(owner, put_generators(tmp_path / "generators"), "input.yml")
    assert (done.stdout, done.returncode) == answer(owner)


def test_the_environment_it_is_installed_in(tmp_path: Path, bare: Path, owner: Path) -> None:
    generator = put_generators(owner.parents[1] / "lib" / "firm" / "library" / "generators")
    done = call(bare, generator, "input.yml")
    assert (done.stdout, done.returncode) == answer(owner)


def test_the_environment_of_the_checkout(tmp_path: Path, bare: Path) -> None:
    generator = put_generators(tmp_path / "checkout" / "generators")
    (tmp_path / "checkout" / "library").mkdir()
    link = tmp_path / "checkout" / "library" / "generators"
    link.symlink_to("../generators")
    python = make_environment(tmp_path / "checkout" / ".venv", has_package=True)
    done = call(bare, link / generator.name, "input.yml")
    assert (done.stdout, done.returncode) == answer(python)


# Like FuseSoC: starts a generator as a child and exits with its status.
PARENT = "import subprocess, sys\nsys.exit(subprocess.run(sys.argv[1:]).returncode)\n"


def test_the_python_that_runs_fusesoc(tmp_path: Path, bare: Path, owner: Path) -> None:
    (tmp_path / "fusesoc").write_text(PARENT)
    generator = put_generators(tmp_path / "generators")
    done = call(owner, tmp_path / "fusesoc", bare, generator, "input.yml")
    assert (done.stdout, done.returncode) == answer(owner)


def test_the_environment_of_the_fusesoc_script(tmp_path: Path, bare: Path, owner: Path) -> None:
    script = owner.parent / "fusesoc"
    script.write_text(PARENT)
    generator = put_generators(tmp_path / "generators")
    done = call(bare, script, bare, generator, "input.yml")
    assert (done.stdout, done.returncode) == answer(owner)


def test_a_chosen_python_is_used_and_no_other(tmp_path: Path, bare: Path, owner: Path) -> None:
    other = make_environment(tmp_path / "other", has_package=True)
    generator = put_generators(tmp_path / "generators")
    done = call(owner, generator, "input.yml", FUSESOC_FIRM_PYTHON=str(other))
    assert (done.stdout, done.returncode) == answer(other)
    failed = call(owner, generator, "input.yml", FUSESOC_FIRM_PYTHON=str(bare))
    assert failed.returncode == 1
    assert f"These were tried:\n  {bare}\nInstall" in failed.stderr


@pytest.mark.parametrize("version", [__version__, "7.8.9"])
def test_a_library_of_another_version_is_reported(tmp_path: Path, owner: Path, version: str) -> None:
    (package,) = owner.parents[1].glob("lib/python3*/site-packages/fusesoc_firm")
    (package / "__init__.py").write_text(f'__version__ = "{version}"\n')
    generator = put_generators(tmp_path / "library" / "generators")
    done = call(owner, generator, "input.yml")
    assert (done.stdout, done.returncode) == answer(owner)
    warning = f"far: warning: the library in {generator.parent} has version {__version__}, but fusesoc-firm in "
    assert done.stderr.startswith(warning) if version != __version__ else done.stderr == ""
    assert "7.8.9\n      = 'firm path' prints the folder" in done.stderr or version == __version__


def test_where_there_is_none_the_message_says_what_to_do(tmp_path: Path, bare: Path) -> None:
    done = call(bare, put_generators(tmp_path / "generators"), "input.yml")
    assert (done.stdout, done.returncode) == ("", 1)
    assert done.stderr.startswith("far: error: no Python with the packages fusesoc_firm, chevron, rosbags, yaml was")
    assert f"  {bare}\n" in done.stderr
    assert "set FUSESOC_FIRM_PYTHON to the python3" in done.stderr


def test_the_folder_it_is_called_in_does_not_count(tmp_path: Path, bare: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = make_environment(tmp_path / "other", has_package=False)
    here = tmp_path / "here"
    (here / "fusesoc_firm" / "builds" / "call").mkdir(parents=True)
    for name in (
        "fusesoc_firm/__init__.py",
        "fusesoc_firm/builds/call/answer.py",
        "chevron.py",
        "rosbags.py",
        "yaml.py",
    ):
        (here / name).write_text("")
    monkeypatch.chdir(here)
    done = call(bare, put_generators(other.parents[1] / "lib" / "generators"), "input.yml")
    assert f"These were tried:\n  {bare}\n  {other}\nInstall" in done.stderr


MAKEFILE = "python := $(shell python3 {})\nall:\n\t@echo found: $(python)\n"


@pytest.mark.parametrize("shell", ["/bin/sh", "/bin/bash"])
def test_a_makefile_finds_the_python_of_the_fusesoc_that_started_make(
    tmp_path: Path, bare: Path, owner: Path, shell: str
) -> None:
    """Bash replaces itself by a single command; Debian's sh may remain above it."""
    (tmp_path / "fusesoc").write_text(PARENT)
    generator = put_generators(tmp_path / "generators")
    command = f"{generator.with_name('firm_python.py')} || true"
    (tmp_path / "Makefile").write_text(f"SHELL := {shell}\n{MAKEFILE.format(command)}")
    done = call(owner, tmp_path / "fusesoc", "make", "-C", tmp_path, PATH=f"{bare.parent}:/usr/bin:/bin")
    assert f"found: {owner}" in done.stdout.splitlines()


def test_a_makefile_does_without(tmp_path: Path, bare: Path) -> None:
    generator = put_generators(tmp_path / "generators")
    (tmp_path / "Makefile").write_text(MAKEFILE.format(generator.with_name("firm_python.py")))
    done = call("make", "-C", tmp_path, PATH=f"{bare.parent}:/usr/bin:/bin")
    assert "found:" in done.stdout.splitlines()
    chosen = call("make", "-C", tmp_path, PATH=f"{bare.parent}:/usr/bin:/bin", FUSESOC_FIRM_PYTHON=sys.executable)
    assert f"found: {sys.executable}" in chosen.stdout.splitlines()
