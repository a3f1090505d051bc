"""The kernels beside those of Holoso, a synthesizer of Python for numeric kernels: time of a sample, and area.

    HOLOSO=~/holoso/bin/python python -m tools.bench kernels

`HOLOSO` is a Python in which Holoso is installed. Without it, the written table stays.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm import __version__
from tools.bench.nextpnr import Nextpnr, Placement, TooLargeError
from tools.bench.tables import FAILED, NOT_MEASURED, Table, Tell, known_rows
from tools.bench.yosys import SynthesisError

TITLE = "Beside Holoso"
OURS = "ours"
TOO_LARGE = "too large"
STAGES = ("no stages", "all stages")
KERNELS = ("pid", "complementary_filter", "inverse_kinematics", "quat2euler_python", "state_kalman")

_PROGRAM = Path(__file__).parent / "kernels" / "holoso_kernels.py"
_COLUMNS = ("kernel", "of", "cycles", "MHz", "us", "LUT4", "FF", "DSP", "LUT4 x us", "version")
_NOTE = """The kernels have float64 numbers in both. 'cycles' are those from a sample to the next one, 'us' is their
    time at the measured clock. Holoso has optional stages in its operators, which its users choose by
    trials; here, all of them or none are present. It reorders sums, has neither NaN nor subnormal numbers and computes
    square roots by logarithms, so its results are not those of Python to the bit. Its filter of two states lacks the
    choice of a period without a measurement. 'too large' is a kernel that needs more multipliers than the 156 of the
    LFE5U-85, the largest ECP5."""


@dataclass(frozen=True)
class Figures:
    """A placed kernel, and the cycles from a sample to the next one."""

    cycles: int
    placement: Placement

    def cells(self, version: str) -> tuple[str, ...]:
        """Return the cells of a row after the key."""
        cells, time = self.placement.cells, self.cycles / self.placement.median
        lut = cells.lut + cells.memory
        numbers = (self.cycles, f"{self.placement.median:.1f}", f"{time:.2f}", lut, cells.ff, cells.dsp)
        return (*map(str, numbers), f"{lut * time:.0f}", version)


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row."""
    return {TITLE: [(name, of) for name in KERNELS for of in (OURS, *(f"Holoso, {stages}" for stages in STAGES))]}


def measured(
    ours: Mapping[str, Figures], nextpnr: Nextpnr, tell: Tell, written: str, pattern: str, seeds: Sequence[int]
) -> Table:
    """Return the table, in which rows that `pattern` does not match, or that cannot be measured, are the written ones.

    `ours` are our figures, by kernel.
    """
    known = known_rows(written, TITLE, _COLUMNS)
    found: dict[tuple[str, ...], tuple[str, ...]] = {
        (name, OURS): figures.cells(__version__) for name, figures in ours.items()
    }
    if python := os.environ.get("HOLOSO"):
        found |= _peers(python, nextpnr, tell, pattern, seeds)
    empty = ("",) * (len(_COLUMNS) - 3)
    rows = [
        (*key, *found[key]) if key in found else known.get(key) or (*key, *empty, NOT_MEASURED) for key in keys()[TITLE]
    ]
    return Table(TITLE, _COLUMNS, tuple(rows), _NOTE)


def _peers(
    python: str, nextpnr: Nextpnr, tell: Tell, pattern: str, seeds: Sequence[int]
) -> dict[tuple[str, ...], tuple[str, ...]]:
    found: dict[tuple[str, ...], tuple[str, ...]] = {}
    with tempfile.TemporaryDirectory() as name:
        done = subprocess.run([python, _PROGRAM, name], capture_output=True, text=True, check=False)
        if done.returncode:
            tell(f"Holoso: {done.stderr[-2000:]}")
        for line in done.stdout.splitlines():
            if not line.startswith("{"):
                continue
            made = json.loads(line)
            if re.search(pattern, f"{made['kernel']} Holoso"):
                found[made["kernel"], f"Holoso, {made['stages']}"] = _placed(made, nextpnr, tell, seeds)
    return found


def _placed(made: Mapping[str, Any], nextpnr: Nextpnr, tell: Tell, seeds: Sequence[int]) -> tuple[str, ...]:
    verilog = "\n".join(path.read_text(encoding="utf-8") for path in sorted(Path(made["folder"]).glob("*.v")))
    try:
        figures = Figures(int(made["cycles"]), nextpnr.place(verilog, made["top"], seeds))
    except TooLargeError as error:
        tell(f"{made['kernel']}, Holoso, {made['stages']}: {TOO_LARGE}: {error.cells}")
        lut = error.cells.lut + error.cells.memory
        numbers = map(str, (lut, error.cells.ff, error.cells.dsp))
        return (str(made["cycles"]), TOO_LARGE, "", *numbers, "", made["version"])
    except SynthesisError as error:
        tell(f"{made['kernel']}, Holoso, {made['stages']}: {error}")
        return (*("",) * (len(_COLUMNS) - 3), FAILED)
    cells = figures.cells(made["version"])
    tell(f"{made['kernel']}, Holoso, {made['stages']}: {' '.join(cells)}")
    return cells
