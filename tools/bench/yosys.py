"""What a netlist becomes on an UltraScale+ device, or one of another family: Yosys maps it and the cells are counted.

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
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from tools.bench import yowasp

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
_FF = re.compile(r"FD[RSCP]E(_1)?")
# Where a slice has an inverter of its own (UG574); everywhere else one takes a LUT.
_INVERTIBLE = {"R", "S", "CLR", "PRE", "C"}
_RESET_INVERTER = "INV to resets"
_LATCH = re.compile(r"LD[CP]E(_1)?|\$_?dlatch.*", re.IGNORECASE)
# Yosys' notes on hierarchy.
_NOTE = "$scopeinfo"


class SynthesisError(Exception):
    """A netlist that cannot be measured: Yosys failed, or the design holds a latch or an unknown cell."""


@dataclass(frozen=True)
class Cells:
    """Cells of a mapped design. `memory` are LUTs used as RAM or shift register; `block` block RAMs."""

    lut: int = 0
    ff: int = 0
    carry: int = 0
    memory: int = 0
    block: int = 0
    dsp: int = 0

    def __str__(self) -> str:
        return f"{self.lut}/{self.ff}"


# The kind of a cell: a field of `Cells`, or "" for cells without cost, and their number.
Kind = tuple[str, int]


@dataclass(frozen=True)
class Family:
    """A family of FPGAs: Yosys' command for it, and its cells, each by the first expression that is its name."""

    name: str
    synthesis: str
    cells: Mapping[str, Kind]

    def kind(self, cell: str) -> Kind:
        """Return the kind of a cell. Raises `SynthesisError` for an unknown cell."""
        found = next((kind for name, kind in self.cells.items() if re.fullmatch(name, cell)), None)
        if found is None:
            raise SynthesisError(f"the cell {cell} is not known")
        return found


XILINX = Family(
    "xcup",
    "synth_xilinx -family xcup -flatten -abc9",
    {
        "LUT[1-6]": ("lut", 1),
        _FF.pattern: ("ff", 1),
        "CARRY[48]": ("carry", 1),
        **{name: ("memory", luts) for name, luts in _LUTS_AS_MEMORY.items()},
        "RAMB(18|36)E2|URAM288": ("block", 1),
        "DSP48E2": ("dsp", 1),
        # Pins and clock buffers of a top level, constants, the multiplexers beside the LUTs.
        f"[IO]?BUFT?|IOBUF|BUFG|GND|VCC|MUXF[789]|{_RESET_INVERTER}": ("", 0),
    },
)
# A carry cell uses the two LUTs around it, a distributed RAM four.
ECP5 = Family(
    "ecp5",
    "synth_ecp5 -abc9",
    {
        "LUT4": ("lut", 1),
        "CCU2C": ("lut", 2),
        "TRELLIS_FF": ("ff", 1),
        "TRELLIS_DPR16X4": ("memory", 4),
        "DP16KD|PDPW16KD": ("block", 1),
        "MULT18X18D": ("dsp", 1),
        "PFUMX|L6MUX21|GND|VCC": ("", 0),
    },
)
# A carry cell is beside a LUT.
ICE40 = Family(
    "ice40",
    "synth_ice40 -abc9 -device u -dsp",
    {
        "SB_LUT4": ("lut", 1),
        "SB_DFF.*": ("ff", 1),
        "SB_CARRY": ("carry", 1),
        "SB_RAM40_4K.*|SB_SPRAM256KA": ("block", 1),
        "SB_MAC16": ("dsp", 1),
        "GND|VCC|SB_GB": ("", 0),
    },
)
FAMILIES = (XILINX, ECP5, ICE40)
SYNTHESIS = XILINX.synthesis


def count_cells(number_of: Mapping[str, int], family: Family = XILINX) -> Cells:
    """Count cells by the resources of a device. Raises `SynthesisError` for a latch or an unknown cell."""
    latches = [cell for cell in number_of if _LATCH.fullmatch(cell)]
    if latches:
        raise SynthesisError(f"latches: {', '.join(latches)}")
    found = Counter[str]()
    for cell, number in number_of.items():
        if cell != _NOTE:
            kind, weight = family.kind(cell)
            found[kind] += number * weight
    return Cells(**{field.name: found[field.name] for field in fields(Cells)})


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

    def cells(self, verilog: str, top: str, family: Family = XILINX) -> Cells:
        """Map a netlist for a family and count its cells; raises `SynthesisError`."""
        with tempfile.TemporaryDirectory() as name:
            directory = Path(name)
            (directory / "netlist.v").write_text(verilog, encoding="utf-8")
            script = f"read_verilog netlist.v; {family.synthesis} -top {top}; check -assert; write_json mapped.json"
            done = self.run(["-q", "-p", script], directory)
            mapped = directory / "mapped.json"
            if done.exit_code != 0 or not mapped.is_file():
                raise SynthesisError(f"Yosys ended with {done.exit_code} and no netlist:\n{done.output[-2000:]}")
            modules = json.loads(mapped.read_text(encoding="utf-8"))["modules"]
            return count_cells(_numbers(modules[top]), family)
