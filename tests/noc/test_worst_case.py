"""Bounds of exchanges that a search reaches, and others that it does not exceed."""

from __future__ import annotations

import pytest

from fusesoc_firm.noc.network import Flow, Network, chain, crossbar, mesh
from fusesoc_firm.noc.worst_case import WorstCase
from tests.noc.adversary import worst_found
from tests.noc.exchanges import network

CASES: dict[str, tuple[Network, list[int], dict[int, int]]] = {
    "a lone source": (network(chain(3), (Flow(0, (2,)),)), [5], {}),
    "three sources of a sink": (network(crossbar(4), (Flow(0, (3,)), Flow(1, (3,)), Flow(2, (3,)))), [4, 1, 9], {}),
    "a slow sink": (network(crossbar(3), (Flow(0, (2,)), Flow(1, (2,)))), [6, 3], {2: 20}),
    "copies to slow sinks": (network(crossbar(4), (Flow(0, (2, 3)),)), [8], {2: 30, 3: 12}),
    "a link behind another one": (network(mesh(3, 1), (Flow(0, (2,)), Flow(1, (2,)))), [12, 7], {}),
}
# From source to sink, by hand: the wait for the message before, and then a message's own time.
KNOWN = {
    "a lone source": {(0, 2): 5 - 1 + 3 + 5},
    # Two messages of a beat are in the first buffer.
    "three sources of a sink": {(1, 3): (4 + 9 + 1) - 1 + 3 * (4 + 9) + 1 + 1},
    "a slow sink": {(0, 2): (23 + 26) - 1 + 23 + 20 + 1 + 6},
    "copies to slow sinks": {(0, 2): (30 + 1 + 8) - 1 + 30 + 1 + 1 + 8},
}


@pytest.mark.parametrize("name", CASES)
def test_a_search_reaches_the_bound(name: str) -> None:
    made, beats, holds = CASES[name]
    bounds = WorstCase(made, beats, lambda sink: holds.get(sink, 0))
    found = worst_found(bounds, seed=1, runs=40, cycles=500)
    expected = {pair: bounds.acceptance(pair[0]) - 1 + bounds.delivery(*pair) for pair in found}
    assert {pair: expected[pair] for pair in KNOWN.get(name, {})} == KNOWN.get(name, {})
    assert found == expected


@pytest.mark.parametrize(
    ("made", "beats", "holds"),
    [
        (network(crossbar(4), (Flow(0, (2, 3)), Flow(1, (3,)))), [8, 4], {}),
        (network(crossbar(5), (Flow(0, (3, 4)), Flow(1, (4, 2)), Flow(2, (3,)))), [2, 5, 3], {3: 9, 4: 25}),
        (network(chain(3), (Flow(0, (2,)), Flow(1, (2,)))), [1, 9], {2: 3}),
        (network(mesh(2, 2), (Flow(0, (3,)), Flow(0, (1,)), Flow(1, (3,)), Flow(2, (3,)))), [3, 3, 1, 6], {3: 8}),
    ],
)
def test_no_message_is_slower(made: Network, beats: list[int], holds: dict[int, int]) -> None:
    bounds = WorstCase(made, beats, lambda sink: holds.get(sink, 0))
    for pair, time in worst_found(bounds, seed=2, runs=60, cycles=500).items():
        assert time <= bounds.acceptance(pair[0]) - 1 + bounds.delivery(*pair) < 2.5 * time
