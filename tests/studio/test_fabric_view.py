"""The topics within the FPGA on the page: their ways, the map of the exchange, and another way by a click."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.exploration.fabric_map import Place, places_of
from fusesoc_firm.noc.network import CHAIN, KINDS, MESH, RING, Topology
from fusesoc_firm.noc.network import topology as topology_of
from fusesoc_firm.studio.views import ways
from tests.exploration.test_fabrics import spec
from tests.studio.browser import PROGRAM, Page
from tests.studio.served import load
from tests.studio.test_page import ROOM
from tests.studio.test_sight import WINDOWS, measure, seen
from tests.studio.test_watching import press

needs_browser = [
    pytest.mark.check,
    pytest.mark.skipif(not PROGRAM, reason="Chromium is missing"),
    pytest.mark.skipif(not (ROOM / "static" / "index.html").exists(), reason="make studio builds the page"),
]
VIEW = "document.querySelector('.view')"


def test_the_page_gets_what_the_command_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = spec(tmp_path, "tree")
    found = ways(load(path, path.read_text(encoding="utf-8")))
    assert main(["fabric", "show", str(path), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert {key: said[key] for key in ("fabric", "ways", "map")} | {"topics": found["topics"]} == found
    assert found["fabric"] == "tree"
    assert sum(len(router["blocks"]) for router in found["map"]["routers"]) == 5
    assert any("regions_out, corners_out -> tracker_in" in line for line in found["topics"])


@pytest.mark.parametrize("kind", KINDS)
def test_routers_have_places_of_their_own(kind: str) -> None:
    for endpoints in (1, 5, 12, 30):
        topology = topology_of(kind, endpoints)
        places = places_of(topology)
        assert len({*places}) == topology.routers
        if kind in (CHAIN, RING, MESH):
            # A link between neighbours passes no other router.
            assert {max(abs(a - c), abs(b - d)) for (a, b), (c, d) in ends_of(topology, places)} <= {1}


def ends_of(topology: Topology, places: list[Place]) -> list[tuple[Place, Place]]:
    return [(places[first], places[last]) for first, last in topology.links]


class TestPage:
    pytestmark = needs_browser

    @pytest.mark.parametrize("size", WINDOWS[1:3], ids=str)
    def test_another_way_is_one_click(self, tmp_path: Path, size: tuple[int, int]) -> None:
        path = spec(tmp_path, "mesh")

        async def steps(page: Page) -> None:
            await press(page, "evaluate", ".text > [role=group]")
            await page.until(f"{VIEW}.querySelectorAll('.map rect').length === 6")
            await page.evaluate(f"{VIEW}.querySelector('.map').scrollIntoView()")
            await measure(page)
            label = await page.evaluate(f"{VIEW}.querySelector('.map svg').ariaLabel")
            assert label.startswith("a mesh of 3 x 2 with 6 routers and 5 endpoints: router 0 with ")
            await press(page, "use crossbar", ".view")
            await page.until(f"{VIEW}.querySelectorAll('.map rect').length === 1")
            assert yaml.safe_load(path.read_text(encoding="utf-8"))["project"]["fabric"] == "crossbar"
            assert await page.evaluate(f"{VIEW}.querySelector('tr.chosen td').innerText") == "crossbar"

        seen(path, tmp_path, size, steps)
