"""Bytes that are lost, doubled or changed on the wires of whole links: what each fault costs, in both directions."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from fusesoc_firm.text.render import render
from tests.hdl.ghdl import core_files
from tests.hdl.verilator import compiled
from tests.hdl.verilog import netlist
from tests.links import decoded, faulty_row, right_row
from tests.node.drivers import HEADERS
from tests.seeds import seeded
from tests.shared import made_once

pytestmark = pytest.mark.skipif(shutil.which("verilator") is None, reason="Verilator is not installed")
SEED = seeded(20261123)
BIT_CYCLES = 4  # the fewest that the UART allows
LONGEST = 16
# All in all 100,000 faults for each link and direction.
PIECES, PIECE = 10, 10_000
_GENERICS: dict[str, dict[str, int]] = {
    "uart": {"LONGEST": 100, "CLOCK_HZ": 100_000_000, "BAUD": 100_000_000 // BIT_CYCLES},
    "spi": {"LONGEST": 100, "DEPTH": 1024},
}


@dataclass(frozen=True)
class Outcome:
    """The frames that came back, and the counts: the link's good, broken, lost and refused ones, and the host's."""

    frames: list[bytes]
    link: tuple[int, ...]
    good: int
    broken: int
    faults: int


@dataclass(frozen=True)
class Link:
    """A link as a program."""

    program: Path

    def run(self, folder: Path, data: bytes, seed: int, faults_back: int) -> Outcome:
        """Send bytes to the board, and bring `faults_back` faults into those that come back."""
        (folder / "bytes").write_bytes(len(data).to_bytes(4, "little") + data)
        command = [str(self.program), "bytes", "frames", str(seed), str(faults_back)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        print(done.stdout)
        numbers = tuple(map(int, re.findall(r"\d+", done.stdout)))
        return Outcome(_strings((folder / "frames").read_bytes()), numbers[3:7], *numbers[:3])


def _strings(data: bytes) -> list[bytes]:
    found, place = [], 0
    while place < len(data):
        end = place + 4 + int.from_bytes(data[place : place + 4], "little")
        found.append(data[place + 4 : end])
        place = end
    return found


@pytest.fixture(params=_GENERICS)
def link(request: pytest.FixtureRequest) -> Link:
    made = made_once(f"link_pins_{request.param}", partial(_build, request.param))
    return Link(made / "model" / f"V{_entity(request.param)}")


def _entity(kind: str) -> str:
    return f"firm_{kind}_link"


def _build(kind: str, folder: Path) -> Path:
    """The link, translated by Verilator, with a bench."""
    entity, is_uart = _entity(kind), kind == "uart"
    values = {"entity": entity, "is_uart": is_uart, "is_spi": not is_uart, "bit_cycles": BIT_CYCLES}
    bench = render("link_pins.cpp", values, Path(__file__).parent)
    (top,) = [path for path in core_files("board/link") if path.stem == entity]
    cores = core_files("axis/package", "axis/axis", "cdc/sync", "board/link")
    verilog = netlist(entity, folder, [top], cores, (), WIDTH=8, **_GENERICS[kind]).read_text(encoding="utf-8")
    return compiled(verilog, entity, bench, folder, [HEADERS])


PIECES_OF_ALL = [pytest.param(500, 0, marks=pytest.mark.check)]
PIECES_OF_ALL += [pytest.param(PIECE, piece, marks=pytest.mark.thorough) for piece in range(PIECES)]


@pytest.mark.parametrize(("faults", "piece"), PIECES_OF_ALL)
def test_a_fault_to_the_board_costs_its_frame_and_at_most_the_next(
    link: Link, tmp_path: Path, faults: int, piece: int
) -> None:
    row = faulty_row(faults, LONGEST, SEED + piece)
    outcome = link.run(tmp_path, row.data, SEED + piece, 0)
    row.check(outcome.frames)
    expected = [*decoded(row.data)]
    assert outcome.frames == [frame for frame in expected if frame is not None]
    assert outcome.link == (len(outcome.frames), expected.count(None), 0, 0)
    assert (outcome.good, outcome.broken) == (len(outcome.frames), 0)


@pytest.mark.parametrize(("faults", "piece"), PIECES_OF_ALL)
def test_a_fault_from_the_board_costs_its_frame_and_at_most_the_next(
    link: Link, tmp_path: Path, faults: int, piece: int
) -> None:
    row = right_row(faults, LONGEST, SEED + piece)
    outcome = link.run(tmp_path, row.data, SEED + piece, faults)
    row.check(outcome.frames)
    assert outcome.faults == faults
    assert outcome.link == (len(row.frames), 0, 0, 0)
    assert outcome.good == len(outcome.frames) < len(row.frames)
    assert outcome.broken > faults / 2
