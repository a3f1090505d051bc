"""The mapping of endpoints to the slots of a topology: simulated annealing of the sum of rate times routers on the way.

The same seed always gives the same mapping.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from random import Random

from fusesoc_firm.noc.network import Flow, Topology

# Steps for each item, their least number, and the runs, of which the best one counts.
_STEPS, _LEAST_STEPS, _RUNS = 500, 2000, 3
# Sums of rates in another order differ.
_TOLERANCE = 1e-9


def mapped(
    topology: Topology, endpoints: int, flows: Iterable[Flow], *, seed: int = 1, fixed: Mapping[int, int] | None = None
) -> tuple[int, ...]:
    """Return the router of each endpoint, for `Network.places`; `fixed` has those that are given.

    Raises `ValueError` if a slot is missing.
    """
    start = _slots(topology, endpoints, fixed or {})
    movable = [item for item in range(len(start)) if item not in (fixed or {})]
    mapping = _Mapping(topology, [*flows], start, movable)
    runs = [mapping.annealed(Random(f"{seed} {run}")) for run in range(_RUNS)] if len(movable) > 1 else [start]
    best = min(runs, key=mapping.cost)
    return tuple(topology.slots[slot] for slot in best[:endpoints])


def cost(topology: Topology, places: Sequence[int], flows: Iterable[Flow]) -> float:
    """Return the sum of rate times routers on the way over all flows and their sinks."""
    return sum(
        flow.rate * len(topology.way(places[flow.source], places[sink])) for flow in flows for sink in flow.sinks
    )


def _slots(topology: Topology, endpoints: int, fixed: Mapping[int, int]) -> list[int]:
    """Return a slot for each endpoint, those of `fixed` at their routers, and then the slots that are left."""
    if endpoints > len(topology.slots):
        raise ValueError(f"{endpoints} endpoints, but {len(topology.slots)} places")
    left = dict(enumerate(topology.slots))
    found: dict[int, int] = {}
    for endpoint, place in fixed.items():
        slot = next((slot for slot, router in left.items() if router == place), None)
        if slot is None:
            raise ValueError(f"endpoint {endpoint}: no place is left at router {place}")
        del left[slot]
        found[endpoint] = slot
    rest = iter(left)
    return [*(found[number] if number in found else next(rest) for number in range(endpoints)), *rest]


@dataclass
class _Mapping:
    """Items in slots: the endpoints and, after them, an item for each slot that is left; `movable` are not fixed."""

    topology: Topology
    flows: Sequence[Flow]
    start: Sequence[int]
    movable: Sequence[int]
    # For each item: the others to which and from which it has flows, with the sum of their rates.
    _to: list[dict[int, float]] = field(init=False)
    _from: list[dict[int, float]] = field(init=False)
    # The routers on the way from each slot to each other one.
    _lengths: list[list[int]] = field(init=False)

    def __post_init__(self) -> None:
        """Sum the rates of all pairs, and find the lengths of all ways."""
        self._to = [{} for _ in self.start]
        self._from = [{} for _ in self.start]
        for flow in self.flows:
            for sink in flow.sinks:
                self._to[flow.source][sink] = self._to[flow.source].get(sink, 0.0) + flow.rate
                self._from[sink][flow.source] = self._from[sink].get(flow.source, 0.0) + flow.rate
        routers = range(self.topology.routers)
        ways = [[len(self.topology.way(first, last)) for last in routers] for first in routers]
        self._lengths = [[ways[first][last] for last in self.topology.slots] for first in self.topology.slots]

    def cost(self, slots: Sequence[int]) -> float:
        """Return the sum of rate times routers."""
        return sum(
            rate * self._lengths[slots[source]][slots[sink]]
            for source, sinks in enumerate(self._to)
            for sink, rate in sinks.items()
        )

    def annealed(self, random: Random) -> list[int]:
        """Return the slots of all items; from a random start, two items change their slots in each step."""
        slots = [*self.start]
        shuffled = [slots[item] for item in self.movable]
        random.shuffle(shuffled)
        for item, slot in zip(self.movable, shuffled, strict=True):
            slots[item] = slot
        best, least, now = [*slots], math.inf, self.cost(slots)
        steps = max(_LEAST_STEPS, _STEPS * len(self.movable))
        heat = now / max(1, sum(map(len, self._to)))
        for step in range(steps):
            temperature = heat * (1 - step / steps) ** 2
            first, second = random.sample(self.movable, 2)
            gain = self._swap(first, second, slots)
            if gain >= 0 or random.random() < math.exp(gain / max(temperature, _TOLERANCE)):
                now -= gain
                if now < least - _TOLERANCE:
                    best, least = [*slots], now
            else:
                slots[first], slots[second] = slots[second], slots[first]
        return best

    def _swap(self, first: int, second: int, slots: list[int]) -> float:
        """Swap the slots of two items; return by how much the cost falls."""
        before = self._cost_of(first, slots) + self._cost_of(second, slots, first)
        slots[first], slots[second] = slots[second], slots[first]
        return before - self._cost_of(first, slots) - self._cost_of(second, slots, first)

    def _cost_of(self, item: int, slots: Sequence[int], without: int | None = None) -> float:
        """Return the cost of the flows to and from an item, except those to and from another one."""
        here = slots[item]
        away = self._lengths[here]
        found = 0.0
        for other, rate in self._to[item].items():
            if other != without:
                found += rate * away[slots[other]]
        for other, rate in self._from[item].items():
            if other != without:
                found += rate * self._lengths[slots[other]][here]
        return found
