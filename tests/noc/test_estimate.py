"""The estimated cells of routers against those of the figures."""

from __future__ import annotations

import pytest

from fusesoc_firm.noc.estimate import router_lut
from fusesoc_firm.noc.network import Network, crossbar, mesh
from tests.hdl.ghdl import REPOSITORY
from tools.bench.noc import AREA_TITLE, all_to_all, pipelines

_MESH = Network(mesh(4, 4), mesh(4, 4).slots, all_to_all(16))
_CROSSBAR = Network(crossbar(16), crossbar(16).slots, pipelines(16))
DESIGNS = {
    "router of five ports": (_MESH, [5]),
    "router at a corner": (_MESH, [0]),
    "crossbar, 16 endpoints, 19 flows": (_CROSSBAR, [0]),
    "mesh 4 x 4, all to all": (_MESH, range(16)),
}
_PAGE = (REPOSITORY / "docs" / "figures" / "noc.md").read_text(encoding="utf-8").partition(AREA_TITLE)[2]
ROWS = [
    (cells[0], int(cells[1]), int(cells[2]))
    for line in _PAGE.splitlines()
    if (cells := [cell.strip() for cell in line.strip("|").split("|")])[0] in DESIGNS
]


def test_there_are_rows() -> None:
    assert {name for name, *_ in ROWS} == {*DESIGNS}


@pytest.mark.parametrize(("name", "width", "lut"), ROWS)
def test_the_estimate_is_near_to_the_placed_design(name: str, width: int, lut: int) -> None:
    """A beat has a mark for each byte, the user's and the last mark, and a destination of four bits."""
    network, routers = DESIGNS[name]
    bits = width + width // 8 + 1 + 1 + 4
    estimate = sum(router_lut(network.turns[router], bits) for router in routers)
    print(f"{estimate} of {lut}, {estimate / lut - 1:+.1%}")
    assert estimate == pytest.approx(lut, rel=0.08)
