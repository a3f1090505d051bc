"""The map of an exchange: its routers in a plane, the blocks at each of them, and the links that topics use."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from fusesoc_firm.noc.network import RING, TREE, Topology
from fusesoc_firm.system.derived.model import Exchange
from fusesoc_firm.system.hardware.exchange import described

Place = tuple[float, float]
"""A column and a row, from the upper left."""


@dataclass(frozen=True)
class FabricMap:
    """The map of an exchange."""

    exchange: Exchange

    @property
    def title(self) -> str:
        """The topology with its size."""
        return described(self.exchange)

    @cached_property
    def blocks(self) -> list[list[str]]:
        """The blocks at each router."""
        network = self.exchange.network
        found: list[list[str]] = [[] for _ in range(network.topology.routers)]
        for end, router in zip(self.exchange.ends, network.places, strict=True):
            found[router].append(end.block)
        return found

    @cached_property
    def links(self) -> dict[tuple[int, int], int]:
        """The links from one router to another that topics use, with the beats of a message of each of these topics."""
        network = self.exchange.network
        found: Counter[tuple[int, int]] = Counter()
        for flow in network.flows:
            for sink in flow.sinks:
                for link in pairwise(network.ways[flow.source, sink]):
                    found[link] += round(flow.rate)
        return dict(sorted(found.items()))

    def data(self) -> dict[str, Any]:
        """Return the map as plain data."""
        places = places_of(self.exchange.network.topology)
        return {
            "title": self.title,
            "routers": [{"x": x, "y": y, "blocks": blocks} for (x, y), blocks in zip(places, self.blocks, strict=True)],
            "links": [{"from": first, "to": last, "beats": beats} for (first, last), beats in self.links.items()],
        }


def places_of(topology: Topology) -> list[Place]:
    """Return the column and the row of each router."""
    count = topology.routers
    if topology.kind == TREE:
        return _in_levels(topology)
    if topology.kind == RING:
        # Two rows, so that each router is beside the next one.
        columns = -(-count // 2)
        return [(at, 0) if at < columns else (count - 1 - at, 1) for at in range(count)]
    columns = topology.columns or count
    return [(at % columns, at // columns) for at in range(count)]


def _in_levels(topology: Topology) -> list[Place]:
    """Return the places of a tree: the root, which has the last number, above, and each router above its subtree."""
    root = topology.routers - 1
    ways = [topology.way(router, root) for router in range(topology.routers)]
    leaves = [*dict.fromkeys(topology.slots)]
    found = []
    for router, way in enumerate(ways):
        below = [leaves.index(leaf) for leaf in leaves if router in ways[leaf]]
        found.append((sum(below) / len(below), float(len(way) - 1)))
    return found
