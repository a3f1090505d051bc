"""The router of five ports beside that of FlooNoC with the same flits, mapped and placed by the same tools.

    FLOONOC=~/FlooNoC COMMON_CELLS=~/common_cells AXI=~/axi python -m tools.bench noc --row FlooNoC

The folders hold the repositories of github.com/pulp-platform; without them, the written rows stay.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from tools.bench.nextpnr import Nextpnr, Placement
from tools.bench.tables import MET, MISSED, NOT_MEASURED, Table, Tell, known_rows
from tools.bench.yosys import SynthesisError

TITLE = "The router beside that of FlooNoC"
OURS, THEIRS = "ours", "FlooNoC"

_WRAPPER = Path(__file__).with_name("peers") / "floonoc.sv"
_TOP = "floonoc_router"
# For each variable, the folders of its repository that are read.
_PARTS = {"FLOONOC": ("hw",), "COMMON_CELLS": ("src", "include"), "AXI": ("src", "include")}
# In the order of their packages; others are found by their names.
_PACKAGES = ("COMMON_CELLS/src/cc_pkg.sv", "AXI/src/axi_pkg.sv", "FLOONOC/hw/floo_pkg.sv")
_CELLS = (
    "fifo",
    "stream_fifo",
    "spill_register_flushable",
    "spill_register",
    "stream_fifo_optimal_wrap",
    "lzc",
    "rr_arb_tree",
    "popcount",
    "stream_demux",
    "addr_decode",
    "addr_decode_dync",
)
_ROUTER = (
    "route_select",
    "route_xymask",
    "wormhole_arbiter",
    "output_arbiter",
    "vc_arbiter",
    "reduction_arbiter",
    "reduction_sync",
    "reduction_unit",
    "router",
)
_COLUMNS = ("bits", "router", "LUT4", "FF", "MHz", "LUT4 to FlooNoC", "MHz to FlooNoC", "bars", "result")
# LUT4 at most and MHz at least, as quotients.
_BARS = {8: (0.5, 1.8), 64: (0.62, 1.8)}
_NOTE = """Both routers have five ports, XY routing, input buffers of two beats and flits of the same bits; neither has
    registers at its outputs. That of FlooNoC has a comparison of coordinates where ours has constant routes, and any
    turn of XY routing. Yosys reads it with `read_slang`. Its commit is 2fa02eb, and that of common_cells 62a689b."""


def keys() -> list[tuple[str, ...]]:
    """The first cells of the rows."""
    return [(str(width), name) for width in _BARS for name in (THEIRS, OURS)]


def measure(
    nextpnr: Nextpnr, tell: Tell, known: str, pattern: str, seeds: Sequence[int], ours: Callable[[int], tuple[str, str]]
) -> Table:
    """Measure the routers if the folders are named; `ours` returns the netlist of our router and its top level."""
    before = known_rows(known, TITLE, _COLUMNS)
    folders = {name: os.environ.get(name, "") for name in _PARTS}
    rows = []
    for width in _BARS:
        own = [before.get(key, (*key, *[""] * 6, NOT_MEASURED)) for key in keys() if key[0] == str(width)]
        if all(folders.values()) and re.search(pattern, f"{THEIRS} {width} bits"):
            theirs = nextpnr.place(_verilog(nextpnr, width, folders), _TOP, seeds)
            own = [*_rows(width, theirs, nextpnr.place(*ours(width), seeds))]
            for row in own:
                tell(" ".join(row))
        rows += own
    return Table(TITLE, _COLUMNS, tuple(rows), _NOTE)


def _rows(width: int, theirs: Placement, ours: Placement) -> list[tuple[str, ...]]:
    quotients = ours.cells.lut / theirs.cells.lut, ours.median / theirs.median
    most, least = _BARS[width]
    result = MET if quotients[0] <= most and quotients[1] >= least else MISSED
    figures = [(str(item.cells.lut), str(item.cells.ff), f"{item.median:.0f}") for item in (theirs, ours)]
    return [
        (str(width), THEIRS, *figures[0], "", "", "", ""),
        (str(width), OURS, *figures[1], *(f"{item:.2f}" for item in quotients), f"<= {most}, >= {least}", result),
    ]


def _verilog(nextpnr: Nextpnr, width: int, folders: dict[str, str]) -> str:
    """Return the netlist of FlooNoC's router; raise `SynthesisError`."""
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        for variable, parts in _PARTS.items():
            for part in parts:
                shutil.copytree(Path(folders[variable]) / part, directory / variable / part)
        shutil.copy(_WRAPPER, directory)
        files = [*_PACKAGES, *(f"COMMON_CELLS/src/cc_{item}.sv" for item in _CELLS)]
        files += [*(f"FLOONOC/hw/floo_{item}.sv" for item in _ROUTER), _WRAPPER.name]
        includes = "-I COMMON_CELLS/include -I FLOONOC/hw/include -I AXI/include"
        # Yosys in WebAssembly has one thread.
        read = f"read_slang --threads 1 --top {_TOP} -G WIDTH={width} -DSYNTHESIS {includes} {' '.join(files)}"
        script = f"{read}; hierarchy -check -top {_TOP}; proc; flatten; opt; opt_clean -purge"
        done = nextpnr.yosys.run(["-q", "-p", f"{script}; write_verilog -noattr made.v"], directory)
        made = directory / "made.v"
        if done.exit_code or not made.is_file():
            raise SynthesisError(f"Yosys ended with {done.exit_code}:\n{done.output[-2000:]}")
        return made.read_text(encoding="utf-8")
