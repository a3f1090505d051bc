"""Programs that tests compile, with GCC or from Verilog with Verilator; what was compiled before is recalled.

A compiled program is recalled if the command is the same and all files are, which the compiler and the linker say that
they read.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

from tests.recall import RunResult, digest_of_source, identity, recalled

REPOSITORY = Path(__file__).resolve().parents[1]
_READ = ".read"
_LINKED = ".linked"


class CompilerError(Exception):
    """A compiler refused its input; the text is what it printed."""


def compile_program(command: Sequence[str], folder: Path, faster: Callable[[], Sequence[str]] = tuple) -> None:
    """Run GCC in `folder`, where all lies that it writes; raise `CompilerError` on a fault.

    `faster` gives options that do not change the result, such as for a precompiled header. The folders of the files
    that they name contain nothing else.
    """
    # Neither debug information nor assertions name the folder, which the next run does not have.
    maps = [f"-ffile-prefix-map={place}=." for place in (folder, REPOSITORY)]
    notes = ["-fpch-deps", f"-Wl,--dependency-file={folder / _LINKED}"]
    environment = {**os.environ, "SUNPRO_DEPENDENCIES": str(folder / _READ)}
    options: list[str] = []

    def run() -> RunResult:
        options.extend(faster())
        done = subprocess.run(
            [command[0], *options, *command[1:], *maps, *notes],
            cwd=folder,
            capture_output=True,
            text=True,
            env=environment,
            check=False,
        )
        if done.returncode:
            raise CompilerError(done.stdout + done.stderr)
        return RunResult(0, done.stdout + done.stderr)

    def read() -> list[Path]:
        files = [path for name in (_READ, _LINKED) for path in _named_in(folder / name)]
        for name in (_READ, _LINKED):
            (folder / name).unlink(missing_ok=True)
        # What only makes it faster is elsewhere in the next run.
        return [path for path in files if path.parent not in {Path(option).parent for option in options}]

    # GCC does not name the sources of its command among the files that it read.
    paths = [folder / word for word in command[1:] if not word.startswith("-")]
    sources = [digest_of_source(path) for path in paths if path.is_file()]
    parts = {"compiler": identity(command[0]), "command": list(command), "sources": sources}
    recalled(parts, [folder], run, [REPOSITORY], read=read)


def verilated(command: Sequence[str], folder: Path, made: str, top: str, sources: Sequence[str]) -> Path:
    """Run Verilator on sources in `folder`, and return the program in its folder `made`; raise `CompilerError`."""
    program = folder / made / f"V{top}"

    def run() -> RunResult:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise CompilerError(done.stdout + done.stderr)
        return RunResult(0, done.stdout)

    def read() -> list[Path]:
        files = [path for note in program.parent.glob("*.d") for path in _named_in(note)]
        for path in program.parent.iterdir():
            if path != program:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        return files

    program.parent.mkdir(exist_ok=True)
    parts = {"verilator": identity("verilator"), "compiler": identity("g++"), "command": list(command)}
    parts["sources"] = [digest_of_source(folder / name) for name in sources]
    recalled(parts, [program.parent], run, [folder, REPOSITORY], read=read)
    return program


def _named_in(note: Path) -> list[Path]:
    """The files in rules of `make`: GCC names what it read behind what it makes; the linker names each as a target."""
    if not note.exists():
        return []
    text = note.read_text(encoding="utf-8").replace("\\\n", " ")
    names = (word for line in text.splitlines() for word in re.split(r"(?<!\\)\s+", line.rpartition(": ")[2]) if word)
    found = (note.parent / name.replace("\\ ", " ") for name in names if not name.endswith(":"))
    return sorted({path.resolve() for path in found if path.is_file()})
