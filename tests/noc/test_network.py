"""Topologies, ways and turns, and cycles of channels, judged by another algorithm and by simulation."""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from random import Random

import pytest

from fusesoc_firm.noc.model import Beat, Model
from fusesoc_firm.noc.network import (
    CONCENTRATED,
    KINDS,
    Flow,
    Network,
    Topology,
    chain,
    crossbar,
    mesh,
    ring,
    topologies,
    torus,
    tree,
)
from tests.noc.exchanges import all_to_all, network
from tests.seeds import seeded

SEED = seeded(44)
# Cycles without a movement after which a simulated network is in a deadlock.
_LIMIT = 100


@pytest.mark.parametrize("endpoints", [1, 2, 3, 5, 9, 13, 16, 30])
def test_every_candidate_connects_all_endpoints(endpoints: int) -> None:
    candidates = topologies(endpoints)
    assert len({candidate.kind for candidate in candidates}) == len(candidates)
    for candidate in candidates:
        assert len(candidate.slots) >= endpoints
        for router, following in candidate.links:
            # One step.
            assert candidate.way(router, following) == (router, following)
        made = network(candidate, all_to_all(endpoints), endpoints)
        for (source, sink), way in made.ways.items():
            assert (way[0], way[-1]) == (made.places[source], made.places[sink])
            assert {*pairwise(way)} <= {*candidate.links}
            assert len({*way}) == len(way)


def test_kinds_and_sizes() -> None:
    found = {candidate.kind: candidate for candidate in topologies(16)}
    assert tuple(found) == KINDS
    assert [found[kind].routers for kind in KINDS] == [1, 16, 4, 16, 5, 16, 16]
    assert (found["mesh"].columns, found[CONCENTRATED].columns) == (4, 2)
    assert mesh(3, 2).way(0, 5) == (0, 1, 2, 5)
    assert torus(3, 3).way(4, 0) == (4, 5, 3, 6, 0)
    assert ring(4).way(3, 1) == (3, 0, 1)
    assert tree(16).way(0, 3) == (0, 4, 3)
    assert tree(30).way(0, 7) == (0, 8, 10, 9, 7)
    assert chain(4).way(3, 1) == (3, 2, 1)


def test_turns_are_those_in_use() -> None:
    """XY routing never turns from a column into a row."""
    made = network(mesh(3, 3), all_to_all(9))
    # Endpoint, then routers 1, 3, 5 and 7.
    names = ("endpoint", "south", "west", "east", "north")
    found = {(names[source], names[sink]) for source, sink in made.turns[4]}
    rows = {("endpoint", "west"), ("endpoint", "east"), ("west", "east"), ("east", "west")}
    columns = {(first, last) for first in ("endpoint", "west", "east") for last in ("north", "south")}
    straight = {("north", "south"), ("south", "north")}
    ends = {(name, "endpoint") for name in names[1:]}
    assert found == rows | columns | straight | ends
    few = network(mesh(3, 3), (Flow(0, (2,)), Flow(3, (0,))))
    assert [len(turns) for turns in few.turns] == [2, 1, 1, 1, 0, 0, 0, 0, 0]
    assert few.ports[4] == ()


def test_hops_are_weighted_by_rates() -> None:
    assert network(chain(4), (Flow(0, (3,), 3.0), Flow(1, (2,)))).hops == (3 * 4 + 2) / 4
    assert network(crossbar(4), (Flow(0, (1, 3)), Flow(1, (2,), 0.5))).hops == 1
    assert network(chain(4), ()).hops == 0


@pytest.mark.parametrize(
    ("topology", "places", "flows", "words"),
    [
        (mesh(2, 2), (0, 1, 1), (Flow(0, (1,)),), "endpoint 2: no place is left at router 1"),
        (mesh(2, 2), (0, 7), (Flow(0, (1,)),), "endpoint 1: no place is left at router 7"),
        (mesh(2, 2), (0, 1), (Flow(0, (2,)),), "unknown endpoint"),
        (mesh(2, 2), (0, 1, 2), (Flow(0, (1, 2)),), "only a crossbar copies frames"),
    ],
)
def test_illegal_networks_are_refused(
    topology: Topology, places: tuple[int, ...], flows: tuple[Flow, ...], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        Network(topology, places, flows)


@pytest.mark.parametrize("sinks", [(), (1, 1), (0, 1)])
def test_illegal_sinks_are_refused(sinks: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="the sinks must be others, each once"):
        Flow(0, sinks)


def test_a_cycle_is_named() -> None:
    made = network(ring(3), (Flow(0, (2,)), Flow(1, (0,)), Flow(2, (1,))))
    assert [str(channel) for channel in made.cycle() or ()] == [
        "link from router 0 to router 1",
        "link from router 1 to router 2",
        "link from router 2 to router 0",
    ]
    pair = network(crossbar(2), (Flow(0, (1,)), Flow(1, (0,))))
    assert pair.cycle() is None
    assert pair.cycle(held=[(0, 0)]) is None
    assert {str(channel) for channel in pair.cycle(held=[(0, 0), (1, 1)]) or ()} == {
        "input of endpoint 0",
        "output to endpoint 1",
        "input of endpoint 1",
        "output to endpoint 0",
    }


@pytest.mark.parametrize(("holder", "other"), [(1, 2), (2, 1)])
def test_copies_hold_the_outputs_of_each_other(holder: int, other: int) -> None:
    """An endpoint holds the copy of a frame until the other one takes its own frame, which waits for the other copy."""
    copies = network(crossbar(3), (Flow(0, (1, 2)), Flow(holder, (other,))))
    assert copies.cycle() is None
    assert copies.cycle(held=[(holder, holder)]) is not None
    assert copies.cycle(held=[(other, other)]) is None
    assert _deadlocks(copies, frozenset({holder}), SEED)
    alone = network(crossbar(3), (Flow(0, (1,)), Flow(0, (2,)), Flow(holder, (other,))))
    assert alone.cycle(held=[(holder, holder)]) is None
    assert not _deadlocks(alone, frozenset({holder}), SEED)


# --- random networks -------------------------------------------------------------------------------------------------


def _random(seed: int) -> tuple[Network, frozenset[int]]:
    """Return a network with few flows, and the endpoints that hold their inputs."""
    random = Random(seed)
    topology = random.choice([ring(5), ring(4), torus(3, 3), mesh(3, 3), chain(5), crossbar(6), tree(9)])
    endpoints = range(len(topology.slots))
    flows = [Flow(*_pair(random, endpoints)) for _ in range(random.randint(2, len(endpoints)))]
    held = frozenset(random.sample(endpoints, random.choice([0, 0, 2, len(endpoints)])))
    return network(topology, tuple(dict.fromkeys(flows))), held


def _pair(random: Random, endpoints: range) -> tuple[int, tuple[int]]:
    source, sink = random.sample(endpoints, 2)
    return source, (sink,)


def _has_cycle(made: Network, held: frozenset[int]) -> bool:
    """Whether channels remain after those that wait for no other one were removed, again and again."""
    waits = set()
    for source, sink in made.ways:
        way = [f"in {source}", *map(str, pairwise(made.ways[source, sink])), f"out {sink}"]
        waits |= {*pairwise(way)}
    waits |= {(f"out {endpoint}", f"in {endpoint}") for endpoint in held}
    while True:
        waiting = {first for first, _ in waits}
        left = {(first, last) for first, last in waits if last in waiting}
        if left == waits:
            return bool(left)
        waits = left


def _deadlocks(made: Network, held: frozenset[int], seed: int, cycles: int = 4000) -> bool:
    """Simulate long frames; an endpoint of `held` takes no beat between a frame that it has received and its next one.

    Every other frame of such an endpoint is one that nothing has caused.
    """
    random = Random(seed)
    model = Model(made)
    flows = {source: [place for place, flow in enumerate(made.flows) if flow.source == source] for source in held}
    spontaneous = {flow.source for flow in made.flows}
    sending: dict[int, deque[Beat]] = {}
    owed: set[int] = set()
    idle = 0
    for _ in range(cycles):
        for source in spontaneous:
            if not sending.get(source) and (source not in held or source in owed or random.random() < 0.02):
                flow = random.choice([place for place, flow in enumerate(made.flows) if flow.source == source])
                sending[source] = deque(Beat(flow, place == 39) for place in range(40))
        offers = {source: beats[0] for source, beats in sending.items() if beats}
        taken, arrived = model.step(offers, lambda sink: not (sink in held and flows[sink] and sending.get(sink)))
        for source in taken:
            sending[source].popleft()
            if not sending[source]:
                owed.discard(source)
        owed |= {sink for sink, beat in arrived.items() if beat.is_last and sink in held and flows[sink]}
        idle = 0 if taken or arrived or not offers else idle + 1
        if idle > _LIMIT:
            return True
    return False


def test_cycles_of_random_networks() -> None:
    """As another algorithm finds them; a simulated network never deadlocks without a cycle, and mostly with one.

    With some cycles, it cannot: two of the waiting frames would have to come from the same source at once.
    """
    counts = {True: 0, False: 0}
    deadlocks = 0
    for seed in range(SEED, SEED + 400):
        made, held = _random(seed)
        is_cyclic = _has_cycle(made, held)
        if counts[is_cyclic] == 50:
            continue
        counts[is_cyclic] += 1
        print(f"seed {seed}, {made.topology.kind}")
        assert (made.cycle([(endpoint, endpoint) for endpoint in held]) is not None) == is_cyclic
        if not is_cyclic:
            assert not _deadlocks(made, held, seed, 300)
        else:
            deadlocks += _deadlocks(made, held, seed)
    assert counts == {True: 50, False: 50}
    assert deadlocks >= 40
