"""Programs that speak for `fusesoc_firm/node/cpp` and `fusesoc_firm/node/c`: lines in, lines out."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import fusesoc_firm.node
from tests.compilers import compile_program
from tests.shared import made_once

HERE = Path(__file__).resolve().parent
HEADERS = Path(fusesoc_firm.node.__file__).resolve().parent / "cpp"
C_FOLDER = HEADERS.parent / "c"
_OPTIONS = ["-std=c++17", "-g", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow"]
_OPTIONS += ["-Wconversion", "-Wsign-conversion", "-Werror", "-pthread"]


@dataclass(frozen=True)
class Driver:
    """A compiled driver."""

    program: Path
    emulator: tuple[str, ...] = ()
    """What runs it, if it is for another processor."""

    def answers(self, lines: Sequence[str], *arguments: str) -> list[str]:
        """What it says to `lines`; fails if it, or a sanitizer, ends with a fault."""
        return self._run(list(arguments), "".join(f"{line}\n" for line in lines)).splitlines()

    def run(self, *arguments: str) -> None:
        """Run it on its own."""
        self._run(list(arguments), "")

    def _run(self, arguments: list[str], text: str) -> str:
        done = subprocess.run(
            [*self.emulator, self.program, *arguments], input=text, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0 and not done.stderr, done.stderr
        return done.stdout


def cpp_driver(name: str, sanitizers: str = "address,undefined") -> Driver:
    """`<name>_driver.cpp`, compiled with all warnings and these sanitizers, once in a run.

    It is not optimised, which takes half of the time; without sanitizers, a fifth.
    """
    sanitize = [f"-fsanitize={sanitizers}", "-fno-sanitize-recover=all"] if sanitizers else []
    command = ["g++", *_OPTIONS, "-O0", *sanitize, "-I", str(HEADERS), str(HERE / f"{name}_driver.cpp"), "-o", name]
    folder = made_once(
        f"drivers/{name}_{sanitizers.replace(',', '_')}", lambda folder: compile_program(command, folder)
    )
    return Driver(folder / name)


def cross_compiled_driver(name: str, processor: str, triple: str) -> Driver:
    """`<name>_driver.cpp`, compiled for Linux on another processor, which QEMU emulates, once in a run."""
    command = [f"{triple}-g++", *_OPTIONS, "-O1", "-I", str(HEADERS), str(HERE / f"{name}_driver.cpp"), "-o", name]
    folder = made_once(f"drivers/{name}_{processor}", lambda folder: compile_program(command, folder))
    return Driver(folder / name, (f"qemu-{processor}", "-L", f"/usr/{triple}"))


def compile_c_driver(
    name: str, directory: Path, sources: Sequence[str], folders: Sequence[Path], sizes: Mapping[str, int]
) -> Driver:
    """Compile `<name>_driver.c` as C99 with `sources` of the node in C, which have these `sizes`, and sanitizers."""
    program = directory / name
    options = ["-std=c99", "-O1", "-g", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"]
    sanitize = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    include = [word for folder in (C_FOLDER / "firm", *folders) for word in ("-I", str(folder))]
    define = [f"-D{key}={value}" for key, value in sizes.items()]
    files = [str(HERE / f"{name}_driver.c"), *(str(C_FOLDER / source) for source in sources)]
    compile_program(["gcc", *options, *sanitize, *include, *define, *files, "-o", name], directory)
    return Driver(program)
