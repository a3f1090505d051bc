"""`make fuzz` before it starts a test: what its campaigns run is there."""

from __future__ import annotations

from tests.hdl.ghdl import REPOSITORY
from tools.fuzz import CAMPAIGNS


def test_the_places_of_all_campaigns_are_there() -> None:
    places = [place for places in CAMPAIGNS.values() for place in places]
    assert [place for place in places if not (REPOSITORY / "tests" / place).exists()] == []
