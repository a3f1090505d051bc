"""`make matrix`: each supported Python, with the oldest and with the newest packages that pyproject.toml accepts.

    python -m tools.matrix [PYTHON ...]

Those named, those on PATH and pyenv's are tried; the first of each supported version counts. Each gets two environments
with packages from the registry and this package as a wheel, and a project with an empty store. uv selects the packages:
the oldest are the declared minima, or the first release after them that has a wheel for this Python.

Progress goes to the standard error, the table to the standard output. The exit code is 1 if a step fails.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.scheduling.tables import grid

ROOT = Path(__file__).resolve().parents[1]
PROJECT = ROOT / "pyproject.toml"
UV = Path(sys.executable).with_name("uv")
RESOLUTIONS = {"oldest": "lowest-direct", "newest": "highest"}
SYSTEM, LOOP = "matrix:sys:obstacle", "me:robots:loop"
_SHOWN = ("fusesoc", "edalize", "numpy", "rosbags")
_SECONDS = 900


class StepError(Exception):
    """A command failed, or did not say what it should; with the end of its output."""


@dataclass(frozen=True)
class Environment:
    """A folder with an environment `venv` and a `project` that has added the library."""

    folder: Path
    python: Path
    resolution: str

    def install(self, wheel: Path) -> None:
        """Packages first, so that only those that pyproject.toml names are taken in their oldest version."""
        self._run(str(UV), "venv", "--quiet", "--no-python-downloads", "--python", str(self.python), str(self._venv))
        install = (str(UV), "pip", "install", "--quiet", "--python", str(self._bin / "python"))
        self._run(*install, "--no-build", f"--resolution={self.resolution}", "--requirement", str(PROJECT))
        self._run(*install, "--no-deps", str(wheel))
        shutil.copytree(ROOT / "specs" / "obstacle", self._project / "obstacle")
        shutil.copytree(ROOT / "tests" / "house" / "data" / "robot", self._project / "loop")
        _replace(self._core, "robot:sys:obstacle", SYSTEM)
        (self._project / "fusesoc.conf").touch()
        for name, folder in (("firm", self._run("firm", "path").strip()), ("own", str(self._project))):
            self._run("fusesoc", "library", "add", name, folder)

    def versions(self) -> list[str]:
        """Those of the packages that the table shows."""
        listed = self._run(str(UV), "pip", "list", "--python", str(self._bin / "python"))
        found = dict(line.split()[:2] for line in listed.splitlines() if line.strip())
        return [found[name] for name in _SHOWN]

    def generate(self) -> None:
        """Both generators, in processes of their own, with nothing in the store."""
        for core, target in ((SYSTEM, "sim"), (LOOP, "default")):
            said = self._run("fusesoc", "run", "--setup", f"--target={target}", core)
            if "generated in" not in said:
                raise StepError(f"{core} was not generated:\n{said}")

    def build(self) -> None:
        """`firm build`, which generates in its own process, with nothing in the store; and `firm lock`."""
        options = ("--target", "sim", "lint", "--build-root", "build_firm")
        self._run("firm", "build", SYSTEM, *options, FUSESOC_FIRM_CACHE=str(self.folder / "store_build"))
        self._run("firm", "lock", SYSTEM)
        self._run("firm", "lock", SYSTEM, "--locked")

    def simulate(self) -> None:
        """Simulate with GHDL."""
        for core, target in ((SYSTEM, "sim"), (LOOP, "default")):
            said = self._run("fusesoc", "run", f"--target={target}", core)
            if "PASS " not in said:
                raise StepError(f"{core} did not pass:\n{said}")

    def lint(self) -> None:
        """Translate to Verilog with GHDL, check that with Verilator."""
        self._run("fusesoc", "run", "--target=lint", SYSTEM)

    def edit(self) -> None:
        """Another file in the core, and both again."""
        (self._core.parent / "edited.vhd").write_text("package edited is\nend package;\n", encoding="ascii")
        _replace(self._core, "  base:\n", "  base:\n    files: [edited.vhd: {file_type: vhdlSource-93}]\n")
        self.lint()
        self.simulate()

    @property
    def _venv(self) -> Path:
        return self.folder / "venv"

    @property
    def _bin(self) -> Path:
        return self._venv / "bin"

    @property
    def _project(self) -> Path:
        return self.folder / "project"

    @property
    def _core(self) -> Path:
        return self._project / "obstacle" / "obstacle.core"

    def _run(self, *command: str, **variables: str) -> str:
        """What a command prints, in the project, with the environment's programs first on PATH."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("FUSESOC", "PYTHON", "EDA"))}
        kept["PATH"] = f"{self._bin}{os.pathsep}{kept['PATH']}"
        kept["FUSESOC_FIRM_CACHE"] = str(self.folder / "store")
        self._project.mkdir(parents=True, exist_ok=True)
        # By env, which finds it on the PATH of the child.
        done = subprocess.run(
            ["/usr/bin/env", *command],
            cwd=self._project,
            env=kept | variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=_SECONDS,
            check=False,
        )
        if done.returncode:
            raise StepError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout}")
        return done.stdout


STEPS = {
    "generate": Environment.generate,
    "firm build": Environment.build,
    "simulate": Environment.simulate,
    "lint": Environment.lint,
    "after an edit": Environment.edit,
}


def supported() -> list[str]:
    """The versions of Python that pyproject.toml declares."""
    classifiers = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["classifiers"]
    return [found[1] for item in classifiers if (found := re.fullmatch(r"Programming .* :: (3\.\d+)", item))]


def find(named: Iterable[str]) -> dict[str, Path]:
    """The Python of each supported version that was found."""
    found: dict[str, Path] = {}
    for path in (*named, *_candidates()):
        version = _version(path)
        if version in supported():
            found.setdefault(version, Path(path))
    return found


def _candidates() -> Iterator[str]:
    folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    folders += map(str, sorted(pyenv.glob("versions/*/bin"), reverse=True))
    for folder, version in ((folder, version) for version in supported() for folder in folders):
        if (path := Path(folder) / f"python{version}").exists():
            yield str(path)


def _version(python: str) -> str:
    """The version of a Python, "" if it is none or does not start, as pyenv's shims of those that are not chosen."""
    program = "import sys; print('%d.%d' % sys.version_info[:2])"
    try:
        return subprocess.run([python, "-c", program], capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def _replace(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    if old not in text:
        raise StepError(f"{path} has no '{old}'")
    path.write_text(text.replace(old, new), encoding="utf-8")


def build_wheel(folder: Path) -> Path:
    """This package as a wheel, of a copy, since a build leaves files beside its sources."""
    ignored = shutil.ignore_patterns(".*", "build", "dist", "tests", "*.egg-info", "__pycache__")
    shutil.copytree(ROOT, folder / "source", symlinks=True, ignore=ignored)
    options = ("--quiet", "--wheel", "--no-python-downloads", "--python", sys.executable, "--out-dir", folder / "wheel")
    if subprocess.run([UV, "build", *options, folder / "source"], check=False).returncode:
        sys.exit("The wheel cannot be built; uv says why above.")
    (wheel,) = (folder / "wheel").glob("*.whl")
    return wheel


def row(environment: Environment, wheel: Path) -> list[str]:
    """The versions of packages, and what came of each step; nothing is tried after a step that failed."""
    cells: list[str] = []
    started = time.monotonic()
    try:
        environment.install(wheel)
        cells += environment.versions()
        for name, step in STEPS.items():
            print(f"  {name}", file=sys.stderr, flush=True)
            step(environment)
            cells.append("ok")
    except (StepError, subprocess.TimeoutExpired) as error:
        print(*str(error).splitlines()[-30:], sep="\n", file=sys.stderr)
        cells += ["FAILED"]
    empty = len(_SHOWN) + len(STEPS) - len(cells)
    return [*cells, *[""] * empty, f"{time.monotonic() - started:.0f}"]


def main(arguments: Sequence[str]) -> int:
    """Try all environments; the exit code."""
    parser = argparse.ArgumentParser(prog="tools.matrix", description="Try each supported Python.")
    parser.add_argument("pythons", nargs="*", metavar="PYTHON", help="in addition to those on PATH and pyenv's")
    pythons = find(parser.parse_args(arguments).pythons)
    rows = []
    with tempfile.TemporaryDirectory(prefix="matrix_") as place:
        wheel = build_wheel(Path(place))
        for version, python in sorted(pythons.items()):
            for name, resolution in RESOLUTIONS.items():
                print(f"Python {version} ({python}), {name} packages", file=sys.stderr, flush=True)
                environment = Environment(Path(place, f"{version}_{name}"), python, resolution)
                rows.append([version, name, *row(environment, wheel)])
    print(grid(("Python", "packages", *_SHOWN, *STEPS, "s"), rows))
    if missing := [version for version in supported() if version not in pythons]:
        print(f"Not found: Python {', '.join(missing)}. PYTHONS=/path/to/python3 names further ones.")
    return int(not rows or any("FAILED" in cells for cells in rows))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
