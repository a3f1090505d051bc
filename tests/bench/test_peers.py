"""The comparison with other libraries: without their folders it says so, and ours are mapped as the others are."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.hdl.ghdl import REPOSITORY
from tools.bench import peers
from tools.bench.nextpnr import Placement
from tools.bench.peers import FUNCTIONS, OPEN_LOGIC, OURS, VERILOG_AXIS, Function
from tools.bench.tables import FAILED, MET, MISSED
from tools.bench.yosys import Cells


def test_without_folders_a_line_says_so_and_the_page_stays() -> None:
    page = REPOSITORY / "docs" / "figures" / "peers.md"
    before = page.read_bytes()
    environment = {name: value for name, value in os.environ.items() if name not in ("VERILOG_AXIS", "OPEN_LOGIC")}
    words = [sys.executable, "-m", "tools.bench", "peers"]
    done = subprocess.run(words, cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", f"{peers.WITHOUT_FOLDERS}\n")
    assert page.read_bytes() == before


def test_all_folders_must_be_named() -> None:
    assert not peers.folders({"VERILOG_AXIS": "/a"})
    both = peers.folders({"VERILOG_AXIS": "/a", "OPEN_LOGIC": "/b"})
    assert both == {VERILOG_AXIS: Path("/a"), OPEN_LOGIC: Path("/b")}


@pytest.mark.parametrize("library", ["ours", "verilog_axis", "open_logic"])
def test_each_library_has_its_functions_with_the_same_ports(library: str) -> None:
    folder = Path(peers.__file__).with_name("peers")
    ports = {
        name: dict(re.findall(r"^module (\w+) \((.*)\);$", (folder / f"{name}.v").read_text(), re.MULTILINE))
        for name in ("ours", library)
    }
    name = {"ours": OURS, "verilog_axis": VERILOG_AXIS, "open_logic": OPEN_LOGIC}[library]
    wanted = {function.module: ports["ours"][function.module] for function in FUNCTIONS if name in function.libraries}
    assert ports[library] == wanted


@pytest.mark.parametrize(
    ("ours", "is_larger", "end"),
    [
        (Cells(lut=6, memory=4, ff=20), False, ("1.00", "1.00", "1", MET)),
        (Cells(lut=11, ff=5), False, ("1.10", "0.25", "1", MISSED)),
        (Cells(lut=11, ff=5), True, ("1.10", "0.25", "1", "named")),
    ],
)
def test_ours_is_compared_with_the_lower_figure_of_each_kind(
    ours: Cells, is_larger: bool, end: tuple[str, ...]
) -> None:
    cells = {OURS: ours, VERILOG_AXIS: Cells(lut=10, ff=30), OPEN_LOGIC: Cells(lut=40, ff=20)}
    lines = _lines(Function("fifo", "a FIFO", is_larger=is_larger), cells)
    assert lines[0][-4:] == end
    assert {line[-1] for line in lines[1:]} == {""}


def test_a_library_that_fails_is_told() -> None:
    lines = _lines(Function("fifo", "a FIFO"), {OURS: Cells(lut=1, ff=1), VERILOG_AXIS: Cells(lut=1, ff=1)})
    assert [line[-1] for line in lines] == [MET, "", FAILED]


def _lines(function: Function, cells: dict[str, Cells]) -> list[tuple[str, ...]]:
    """The rows of a function for which the libraries have these cells; one without cells fails."""

    def measured(_: Function, library: str) -> Placement | str:
        return Placement(cells[library], {1: 100.0}) if library in cells else FAILED

    return peers.lines(function, measured)
