"""The bench of accelerators in Python: what it compiles, how it judges bars, and the table beside Holoso."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.bench import holoso, kernels
from tools.bench.kernels import Bars, Compiled
from tools.bench.nextpnr import Nextpnr, Placement, TooLargeError
from tools.bench.tables import MET, MISSED, NOT_MEASURED, Table
from tools.bench.yosys import Cells, Yosys

_MADE = Compiled(lines=20, cycles=50, interval=52, element=1, entity="k", vhdl="", seconds=0.5)
_PLACED = Placement(Cells(lut=900, ff=300, memory=100, dsp=2), {1: 100.0, 2: 140.0, 3: 120.0})


@pytest.mark.parametrize("kernel", kernels.KERNELS, ids=lambda kernel: "-".join(kernel.key))
def test_every_kernel_is_compiled(kernel: kernels.Kernel) -> None:
    """Lines and cycles do not depend on a tool, so a missed bar of theirs is found here."""
    made = kernels.compiled(kernel)
    assert f"entity {made.entity} is" in made.vhdl
    assert 0 < made.lines <= (kernel.bars.lines or 100)
    assert made.element <= (kernel.bars.element or 100)


@pytest.mark.parametrize(
    ("bars", "result"),
    [
        (Bars(), ""),
        (Bars(20, 50, 1, 1000, 120), MET),
        (Bars(lines=19), MISSED),
        (Bars(cycles=49), MISSED),
        # RAM in LUTs counts.
        (Bars(lut=999), MISSED),
        # The median of the seeds.
        (Bars(megahertz=121), MISSED),
    ],
)
def test_a_bar_that_is_missed_is_reported(bars: Bars, result: str) -> None:
    assert kernels.cells(bars, _MADE, _PLACED)[-2:] == (str(bars), result)


def test_bars_are_in_the_order_of_the_note() -> None:
    assert str(Bars(25, 190, 0, 7500, 110)) == "25 / 190 / 7500 / 110"
    assert str(Bars(element=1)) == "- / 1 / - / -"


def test_without_holoso_its_rows_are_those_of_the_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("HOLOSO", raising=False)
    nextpnr = Nextpnr(Yosys(), tmp_path)
    written = ("pid", "Holoso, no stages", "28", "50.0", "0.56", "3000", "900", "9", "1680", "0.1")
    ours = {"pid": holoso.Figures(52, _PLACED)}
    page = str(Table(holoso.TITLE, holoso._COLUMNS, (written,)))
    found = holoso.measured(ours, nextpnr, print, page, "", (1,))
    rows = {row[:2]: row for row in found.rows}
    assert rows["pid", "Holoso, no stages"] == written
    assert rows["pid", holoso.OURS][2:6] == ("52", "120.0", "0.43", "1000")
    assert rows["pid", "Holoso, all stages"][-1] == NOT_MEASURED
    assert set(rows) == set(holoso.keys()[holoso.TITLE])


def test_a_kernel_that_no_device_holds_has_its_cells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """nextpnr refuses it, which is a result, and its cells are those that Yosys has mapped."""

    def without_place(*_: object) -> Placement:
        raise TooLargeError("no BELs remaining", Cells(lut=21000, ff=10000, memory=500, dsp=181))

    monkeypatch.setattr(Nextpnr, "place", without_place)
    made = {"kernel": "k", "stages": "none", "folder": str(tmp_path), "top": "k", "cycles": 178, "version": "1"}
    row = holoso._placed(made, Nextpnr(Yosys()), print, (1,))
    assert row == ("178", holoso.TOO_LARGE, "", "21500", "10000", "181", "", "1")
