"""Bitstreams of whole systems on boards: the clock that nextpnr's report promises, and the cells that it counts."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.hdl.ghdl import REPOSITORY
from tools.bench.tables import FAILED, MET, NOT_MEASURED, Table, Tell, known_rows

TITLE = "Whole systems by Ethernet on boards, MHz"
_COLUMNS = ("system", "board", "MHz", "LUT4", "FF", "block RAMs", "bar", "result")
# Systems of specs, and their boards.
_BUILDS = (("quat2euler_ethernet", "ecp5_versa"),)
# nextpnr's names of the cells of an ECP5, in the order of the columns.
_CELLS = ("TRELLIS_COMB", "TRELLIS_FF", "DP16KD")
# Of the output of a failed build.
_LINES = 20
_NOTE = """Bitstreams as `make bitstream` builds them, with Debian's Yosys and the seed of the board. The bar is the
    board's clock. LUT4 are those of nextpnr (`TRELLIS_COMB`), with carry cells and distributed memories."""


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row."""
    return {TITLE: [*_BUILDS]}


def measure(tell: Tell, written: str = "", pattern: str = "") -> Table:
    """Build the bitstreams whose names match the regular expression `pattern`; `tell` hears of each."""
    known = known_rows(written, TITLE, _COLUMNS)
    rows = []
    for build in _BUILDS:
        if re.search(pattern, " on ".join(build)):
            row = _built(*build, tell)
            tell(f"{' on '.join(build)}: {', '.join(row[2:])}")
        else:
            row = known.get(build, (*build, *[""] * 5, NOT_MEASURED))
        rows.append(row)
    return Table(TITLE, _COLUMNS, tuple(rows), _NOTE)


def _built(system: str, board: str, tell: Tell) -> tuple[str, ...]:
    """Return the row of a bitstream. nextpnr fails if a clock is too slow, so what is built meets its bar.

    `tell` hears the last lines of a failed build.
    """
    with tempfile.TemporaryDirectory() as place:
        fusesoc = [sys.executable, "-m", "fusesoc.main", "run", "--setup", "--build", f"--target={board}"]
        done = subprocess.run(
            [*fusesoc, f"--build-root={place}", f"robot:sys:{system}"],
            cwd=REPOSITORY,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        reports = [*Path(place).glob(f"*/{board}/report.json")]
        if done.returncode or not reports:
            for line in done.stdout.splitlines()[-_LINES:]:
                tell(line)
            return (system, board, *[""] * 5, FAILED)
        return row_of(system, board, reports[0].read_text(encoding="utf-8"))


def row_of(system: str, board: str, report: str) -> tuple[str, ...]:
    """Return the row of a bitstream with this report of nextpnr."""
    content = json.loads(report)
    (clock,) = (clock for name, clock in content["fmax"].items() if name.endswith("$clk"))
    cells = (str(content["utilization"][cell]["used"]) for cell in _CELLS)
    return (system, board, f"{clock['achieved']:.1f}", *cells, f"{clock['constraint']:.0f}", MET)
