"""What a netlist becomes on an UltraScale+ device: Yosys maps it and the cells are counted.

    yosys = Yosys()
    yosys.prepare()
    cells = yosys.cells(library.synthesise("firm_manager", {"WIDTH": 8}, "verilog"), "firm_manager")
    cells.lut, cells.ff

YoWASP's Yosys falls silent on its standard output after ABC while it works on, so nothing is read there: the mapped
netlist is a file, which is there and whole only if all commands before it ended well.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests import yowasp

SYNTHESIS = "synth_xilinx -family xcup -flatten -abc9"

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


class Yosys(yowasp.Yosys):
    """Yosys that maps and counts; it must be prepared."""

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
