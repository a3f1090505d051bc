"""Compile the program that plays messages to a system: for a Zynq-7000, on bare metal or with FreeRTOS.

The program is an example of a node without Linux (docs/how-to/emulate.md); its sources are in `node/c`.
"""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import fusesoc_firm.node
from fusesoc_firm.system.derived.link import longest_payload_of
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.text.diagnostics import fail

COMPILER = "arm-none-eabi-gcc"
_C = Path(fusesoc_firm.node.__file__).resolve().parent / "c"
_BOARD = _C / "boards" / "zynq7000"
_MACHINE = ("-mcpu=cortex-a9", "-mfpu=vfpv3", "-mfloat-abi=hard", "-marm")
_OPTIONS = ("-std=c99", "-O2", "-Wall", "-Wextra", *_MACHINE, "-nostartfiles", "-T", str(_BOARD / "zynq7000.ld"))
_FREERTOS_SOURCES = ("tasks.c", "list.c", "queue.c", "portable/MemMang/heap_4.c")
_FREERTOS_PORT = "portable/GCC/ARM_CA9"


@dataclass(frozen=True)
class Kernel:
    """What calls the program's functions: a loop, or the FreeRTOS kernel in a folder."""

    freertos: Path | None = None

    @property
    def title(self) -> str:
        """The name for people."""
        return "FreeRTOS" if self.freertos else "bare metal"

    def check(self) -> None:
        """Raise `InputError` if the folder does not have the kernel."""
        if self.freertos is None:
            return
        for name in (*_FREERTOS_SOURCES, f"{_FREERTOS_PORT}/port.c"):
            if not (self.freertos / name).is_file():
                fail(
                    f"{self.freertos} is not the FreeRTOS kernel: there is no {name}",
                    hint="--freertos needs a folder with FreeRTOS-Kernel, such as a clone of its repository",
                )

    def sources(self) -> list[Path]:
        """Return the files that differ."""
        if self.freertos is None:
            return [_C / "player" / "bare_metal.c", _C / "ports" / "bare_metal" / "firm_port.c"]
        port = self.freertos / _FREERTOS_PORT
        kernel = [*(self.freertos / name for name in _FREERTOS_SOURCES), port / "port.c", port / "portASM.S"]
        return [_C / "player" / "freertos.c", _C / "ports" / "freertos" / "firm_port.c", *kernel]

    def options(self) -> list[str]:
        """Return the options of the compiler that differ."""
        if self.freertos is None:
            return [f"-I{_C / 'ports' / 'bare_metal'}"]
        folders = (_C / "ports" / "freertos", self.freertos / "include", self.freertos / _FREERTOS_PORT)
        # The kernel's port has GNU's assembly.
        return ["-std=gnu99", "-DFIRM_FREERTOS", *(f"-I{folder}" for folder in folders)]


def compile_player(system: DerivedSystem, kernel: Kernel, folder: Path) -> Path:
    """Compile the program for a system into a folder, and return its ELF file. May raise `InputError`.

    The kernel was checked before.
    """
    program = folder / "player.elf"
    firm = [_C / "firm" / f"firm_{name}.c" for name in ("frame", "limit", "link", "queues", "uart")]
    board = [_BOARD / "start.S", _BOARD / "firm_board.c", _C / "ports" / "zynq.c"]
    folders = [_C / "firm", _C / "player", _BOARD]
    command = [
        shutil.which(COMPILER) or COMPILER,
        *_OPTIONS,
        *kernel.options(),
        *(f"-I{item}" for item in folders),
        *(f"-D{name}={value}" for name, value in sizes(system).items()),
        *map(str, (*board, _C / "player" / "firm_player.c", *firm, *kernel.sources())),
        "-o",
        str(program),
    ]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        is_without_library = "string.h: No such file" in done.stderr
        hint = "apt-get install libnewlib-arm-none-eabi" if is_without_library else ""
        fail(f"{COMPILER} cannot compile the program for {kernel.title}:\n{done.stderr.rstrip()}", hint=hint)
    return program


def sizes(system: DerivedSystem) -> dict[str, int]:
    """Return the sizes of a node in C for a system, as in `node/c/firm/firm_config.h`."""
    return {
        "FIRM_SUBSCRIBERS": len(system.subscribers),
        "FIRM_PUBLISHERS": len(system.publishers),
        "FIRM_LONGEST_PAYLOAD": max(map(longest_payload_of, (*system.subscribers, *system.publishers))),
    }
