"""Compile the program that plays messages to a system, for a Zynq on bare metal or a Zynq-7000 with FreeRTOS.

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

_C = Path(fusesoc_firm.node.__file__).resolve().parent / "c"
_BOARDS = _C / "boards"
# The emulator's clock does not wait for the simulated hardware; `firm emulate` has a separate limit.
_OPTIONS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-nostartfiles", "-DFIRM_UART_PATIENCE_MS=600000u")


@dataclass(frozen=True)
class Processor:
    """An emulated processor: its compiler, and its emulator with the machine and the machine's options.

    `files` are those of its folder in `node/c/boards` beside the start-up code. `package` has the library that the
    compiler needs.
    """

    name: str
    compiler: str
    options: tuple[str, ...]
    files: tuple[str, ...]
    emulator: str
    machine: str
    options_of_machine: tuple[str, ...]
    package: str

    @property
    def folder(self) -> Path:
        """The folder of its files."""
        return _BOARDS / self.name

    @property
    def sources(self) -> list[Path]:
        """The files that differ between processors."""
        return [self.folder / name for name in ("start.S", "firm_processor.c", *self.files)]


_ZYNQ = Processor(
    "zynq7000",
    "arm-none-eabi-gcc",
    ("-mcpu=cortex-a9", "-mfpu=vfpv3", "-mfloat-abi=hard", "-marm"),
    (),
    "qemu-system-arm",
    "xilinx-zynq-a9",
    ("-m", "512"),
    "libnewlib-arm-none-eabi",
)
_ZYNQMP = Processor(
    "zynqmp",
    "aarch64-linux-gnu-gcc",
    # Without a bare-metal library; the files define its functions.
    (
        *("-mcpu=cortex-a53", "-mstrict-align", "-ffreestanding", "-fno-tree-loop-distribute-patterns"),
        *("-fno-pic", "-no-pie", "-fno-stack-protector", "-mno-outline-atomics", "-nostdlib", "-static"),
    ),
    ("firm_memory.c",),
    "qemu-system-aarch64",
    # The program starts at level 3, as after AMD's FSBL.
    "xlnx-zcu102,secure=on",
    ("-m", "1024"),
    "libc6-dev-arm64-cross",
)
PROCESSORS = {item.name: item for item in (_ZYNQ, _ZYNQMP)}
"""The processors by name, the default first."""

_FREERTOS_SOURCES = ("tasks.c", "list.c", "queue.c", "portable/MemMang/heap_4.c")
_FREERTOS_PORT = "portable/GCC/ARM_CA9"


@dataclass(frozen=True)
class Kernel:
    """The caller of the program's functions: a loop, or the FreeRTOS kernel in a folder."""

    freertos: Path | None = None

    @property
    def title(self) -> str:
        """The name for people."""
        return "FreeRTOS" if self.freertos else "bare metal"

    def check(self, processor: Processor) -> None:
        """Raise `InputError` if the folder lacks the kernel, or the kernel lacks a port for the processor."""
        if self.freertos is None:
            return
        if processor is not _ZYNQ:
            fail(f"FreeRTOS is not emulated on {processor.name}", hint=f"legal: --processor {_ZYNQ.name}")
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


def compile_player(system: DerivedSystem, kernel: Kernel, processor: Processor, folder: Path) -> Path:
    """Compile the program for a system into a folder, and return its ELF file. May raise `InputError`.

    The kernel was checked before.
    """
    program = folder / f"player_{processor.name}.elf"
    firm = [_C / "firm" / f"firm_{name}.c" for name in ("frame", "limit", "link", "queues", "uart")]
    board = [*processor.sources, _BOARDS / "firm_board.c", _C / "ports" / "zynq.c"]
    folders = [_C / "firm", _C / "player", _BOARDS, processor.folder]
    command = [
        shutil.which(processor.compiler) or processor.compiler,
        *_OPTIONS,
        *processor.options,
        *("-T", str(processor.folder / f"{processor.name}.ld")),
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
        hint = f"apt-get install {processor.package}" if is_without_library else ""
        fail(f"{processor.compiler} cannot compile the program for {kernel.title}:\n{done.stderr.rstrip()}", hint=hint)
    return program


def sizes(system: DerivedSystem) -> dict[str, int]:
    """Return the sizes of a node in C for a system, as in `node/c/firm/firm_config.h`."""
    return {
        "FIRM_SUBSCRIBERS": len(system.subscribers),
        "FIRM_PUBLISHERS": len(system.publishers),
        "FIRM_LONGEST_PAYLOAD": max(map(longest_payload_of, (*system.subscribers, *system.publishers))),
    }
