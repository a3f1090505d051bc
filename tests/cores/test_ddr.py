"""The cells of FPGAs at the pins of an RGMII: GHDL's netlist and the modules of each family, as Yosys maps them."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import pytest

from fusesoc_firm.netlist.translation import Translation, translate
from tests.hdl.ghdl import core_files

TOP = "firm_rgmii"
CORES = ("axis/package", "axis/axis", "cdc/sync", "cdc/cdc", "net/mac", "net/mii")
# The five pins from the PHY, and the six to it.
CELLS = {
    "ecp5": {"IDDRX1F": 5, "ODDRX1F": 6},
    "xilinx": {"IDDR": 5, "ODDR": 6},
}


@pytest.mark.one_in(2)
@pytest.mark.parametrize("family", CELLS)
def test_each_pin_of_an_rgmii_has_a_cell_of_its_family(tmp_path: Path, family: str) -> None:
    """Yosys knows the ports of each family's cells, and refuses others."""
    if not shutil.which("yosys"):
        pytest.skip("yosys is not installed")
    sources = [*map(str, core_files(f"net/ddr_{family}"))]
    libraries = {"firm": [*map(str, core_files(*CORES))]}
    translate(Translation(f"firm.{TOP}", str(tmp_path / "netlist.v"), libraries, {}, sources), tmp_path)
    script = f"synth_{family} -top {TOP}; flatten; write_json mapped.json"
    subprocess.run(["yosys", "-q", "-p", script, "netlist.v", *sources], cwd=tmp_path, check=True)
    modules = json.loads((tmp_path / "mapped.json").read_text(encoding="utf-8"))["modules"]
    counts = Counter(cell["type"] for cell in modules[TOP]["cells"].values())
    assert {kind: count for kind, count in counts.items() if "DDR" in kind} == CELLS[family]
