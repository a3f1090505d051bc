"""Bitstreams of whole systems on boards: the clock that nextpnr's report promises, and the cells that it counts."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from functools import cache
from importlib import metadata
from pathlib import Path

from fusesoc_firm.system.boards.board import read_board
from fusesoc_firm.tools.open_flows import OPEN_FLOWS, REPORT
from fusesoc_firm.tools.programs import PROGRAMS
from tests.hdl.ghdl import REPOSITORY
from tests.netlist.mapped_system import FAMILIES, set_up, verdict, yosys_for
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows

TITLE = "Whole systems on boards"
FAMILY_TITLE = "Families with open tools"
_COLUMNS = ("system", "board", "MHz", "logic cells", "flip-flops", "block RAMs", "kB", "bar", "result")
_FAMILY_COLUMNS = (
    "family",
    "flow",
    "simulated as cells",
    "placed",
    "bitstream",
    "clock met",
    "on hardware",
    "result",
)
# Systems of specs, and their boards; the first rows have a board of each family.
_BUILDS = (
    ("obstacle", "crosslink_nx_evn"),
    ("obstacle", "gatemate_a1_evb"),
    ("obstacle", "icebreaker"),
    ("obstacle", "step_mxo2"),
    ("obstacle", "tangnano9k"),
    ("obstacle", "ulx3s"),
    ("obstacle_node", "icebreaker_w5500"),
    ("obstacle_node", "ulx3s_w5500"),
    ("quat2euler", "crosslink_nx_evn"),
    ("quat2euler", "ulx3s"),
    ("quat2euler_ethernet", "ecp5_versa"),
)
# nextpnr's names of the cells of each family, in the order of the columns; those of an iCE40 have both.
_CELLS = {
    "apicula": ("LUT4", "DFF", "BSRAM"),
    "gatemate": ("CPE_LT", "CPE_FF", "RAM_HALF"),
    "icestorm": ("ICESTORM_LC", "", "ICESTORM_RAM"),
    "machxo2": ("TRELLIS_COMB", "TRELLIS_FF", "DP8KC"),
    "nexus": ("OXIDE_COMB", "OXIDE_FF", "OXIDE_EBR"),
    "trellis": ("TRELLIS_COMB", "TRELLIS_FF", "DP16KD"),
}
# Of the output of a failed build.
_LINES = 20
_NOTE = """Bitstreams as `make bitstream` builds them, with the seed of the board. The bar is the board's clock in MHz,
    by which nextpnr judged. Logic cells are those of nextpnr, with carry cells and distributed memories."""
_FAMILY_NOTE = """By the rows of robot:sys:obstacle above. For the third column, Icarus simulates the whole system, made
    of the cells of the family as Yosys models them, with the stimuli of the system: each answer is equal to the byte.
    No bitstream has been tried on hardware."""


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row."""
    return {TITLE: [*_BUILDS], FAMILY_TITLE: [(flow.family, name) for name, flow in OPEN_FLOWS.items()]}


def measure(tell: Tell, written: str = "", pattern: str = "") -> list[Table]:
    """Build the bitstreams whose names match the regular expression `pattern`; `tell` hears of each."""
    known = known_rows(written, TITLE, _COLUMNS)
    rows = []
    for build in _BUILDS:
        if re.search(pattern, " on ".join(build)):
            row = _built(*build, tell)
            tell(f"{' on '.join(build)}: {', '.join(row[2:])}")
        else:
            row = known.get(build, (*build, *[""] * 6, NOT_MEASURED))
        rows.append(row)
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE), _families(rows, tell, written, pattern)]


def versions() -> list[str]:
    """The versions of Debian's Yosys, and of the packages that synthesise, place and pack."""
    yosys = subprocess.run(["yosys", "-V"], capture_output=True, text=True, check=True).stdout.partition(" (")[0]
    packages = {PROGRAMS[program].pypi for flow in OPEN_FLOWS.values() for program in flow.programs}
    return [yosys, *(f"{package} {metadata.version(package)}" for package in sorted(filter(None, packages)))]


def _families(rows: list[tuple[str, ...]], tell: Tell, written: str, pattern: str) -> Table:
    """Return what has been done for each family, by the rows of the smallest system."""
    known = known_rows(written, FAMILY_TITLE, _FAMILY_COLUMNS)
    lines = []
    for name, flow in OPEN_FLOWS.items():
        build = next(row for row in rows if row[0] == "obstacle" and read_board(row[1]).flow == name)
        key = (flow.family, name)
        if not re.search(pattern, " on ".join(build[:2])):
            lines.append(known.get(key, (*key, *[""] * 5, NOT_MEASURED)))
            continue
        simulated = _simulated(name)
        tell(f"{flow.family}: simulated as cells: {simulated}")
        is_good = simulated == "yes" and build[-1] == MET
        done = "yes" if build[-1] == MET else "no"
        lines.append((*key, simulated, done, done, done, "no", MET if is_good else MISSED))
    return Table(FAMILY_TITLE, _FAMILY_COLUMNS, tuple(lines), _FAMILY_NOTE)


@cache
def _simulation() -> tuple[tempfile.TemporaryDirectory[str], Path]:
    """Return the set-up of the simulation, in a folder that lives as long as this process."""
    folder = tempfile.TemporaryDirectory()
    return folder, set_up(Path(folder.name))


def _simulated(name: str) -> str:
    cells = FAMILIES[name]
    yosys = yosys_for(cells)
    if yosys is None:
        return ""
    with tempfile.TemporaryDirectory() as folder:
        return "yes" if verdict(_simulation()[1], Path(folder), cells, *yosys).startswith("PASS") else "no"


def _built(system: str, board: str, tell: Tell) -> tuple[str, ...]:
    """Return the row of a bitstream. A build fails if a clock is too slow, so what is built meets its bar.

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
        reports = [*Path(place).glob(f"*/{board}/{REPORT}")]
        if done.returncode or not reports:
            for line in done.stdout.splitlines()[-_LINES:]:
                tell(line)
            return (system, board, *[""] * 6, FAILED)
        (stream,) = reports[0].parent.glob(f"*{OPEN_FLOWS[read_board(board).flow].bitstream}")
        return row_of(system, board, reports[0].read_text(encoding="utf-8"), stream.stat().st_size)


def row_of(system: str, board: str, report: str, size: int) -> tuple[str, ...]:
    """Return the row of a bitstream of `size` bytes with this report of nextpnr."""
    content = json.loads(report)
    clock = next(clock for name, clock in content["fmax"].items() if re.search(r"(?<!_)\bclk\b", name))
    used = content["utilization"]
    cells = (str(used.get(cell, {"used": 0})["used"]) if cell else "" for cell in _CELLS[read_board(board).flow])
    reached, bar = f"{clock['achieved']:.1f}", f"{clock['constraint']:.0f}"
    return (system, board, reached, *cells, f"{size / 1000:.0f}", bar, MET)
