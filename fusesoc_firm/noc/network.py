"""Networks on chip: topologies of routers, the ways of flows between endpoints, and cycles of channels (deadlocks).

Endpoints and routers are numbered from 0. A network has only the turns that its flows use. The hardware is wormhole: a
frame holds every channel on its way from its first beat to its last one. Such a network has no deadlock if its channels
do not wait for each other in a cycle (Dally and Seitz, 1987), which `Network.cycle` finds.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import isqrt

CROSSBAR, MESH, CONCENTRATED, CHAIN, TREE, RING, TORUS = (
    "crossbar",
    "mesh",
    "concentrated mesh",
    "chain",
    "tree",
    "ring",
    "torus",
)
KINDS = (CROSSBAR, MESH, CONCENTRATED, CHAIN, TREE, RING, TORUS)
# The endpoints of a router of a concentrated mesh and of a leaf, and the routers below another one in a tree.
_FOLD = 4


@dataclass(frozen=True)
class Flow:
    """Frames from an endpoint to others, each of which receives a copy; `rate` is in beats a cycle."""

    source: int
    sinks: tuple[int, ...]
    rate: float = 1.0

    def __post_init__(self) -> None:
        """Raise `ValueError` for a flow without sinks, with a sink twice, or to its own source."""
        if not self.sinks or len({*self.sinks}) < len(self.sinks) or self.source in self.sinks:
            raise ValueError(f"flow from endpoint {self.source} to {self.sinks}: the sinks must be others, each once")


@dataclass(frozen=True)
class Topology:
    """Routers and how to get from one to another.

    `slots` are the routers of the places for endpoints, `columns` the columns of a grid (else 0), and `steps` has for
    each router the next one on the way to each other one.
    """

    kind: str
    slots: tuple[int, ...]
    steps: tuple[tuple[int, ...], ...]
    columns: int = 0

    @property
    def routers(self) -> int:
        """The number of routers."""
        return len(self.steps)

    @cached_property
    def links(self) -> tuple[tuple[int, int], ...]:
        """The links that ways may use, from one router to another."""
        ends = sorted({*self.slots})
        used = {pair for first in ends for last in ends for pair in pairwise(self.way(first, last))}
        return tuple(sorted(used))

    def next(self, router: int, last: int) -> int:
        """Return the router after `router` on the way to another one, `last`."""
        return self.steps[router][last]

    def way(self, first: int, last: int) -> tuple[int, ...]:
        """Return the routers from `first` to `last`, both included."""
        found = [first]
        while found[-1] != last:
            found.append(self.next(found[-1], last))
        return tuple(found)


def crossbar(endpoints: int) -> Topology:
    """Return one router for all endpoints."""
    return Topology(CROSSBAR, (0,) * endpoints, ((0,),))


def mesh(columns: int, rows: int, *, each: int = 1) -> Topology:
    """Return a grid of routers, row by row, with XY routing: first along the row, then along the column.

    It is concentrated if each router has several endpoints.
    """

    def step(router: int, last: int) -> int:
        away = last % columns - router % columns
        if away:
            return router + (1 if away > 0 else -1)
        return router + (columns if last > router else -columns)

    return _topology(MESH if each == 1 else CONCENTRATED, columns * rows, step, each, columns)


def chain(routers: int) -> Topology:
    """Return routers in a row, linked in both directions."""
    return _topology(CHAIN, routers, lambda router, last: router + (1 if last > router else -1), 1, routers)


def ring(routers: int) -> Topology:
    """Return routers in a circle, linked in one direction."""
    return _topology(RING, routers, lambda router, _: (router + 1) % routers, 1)


def torus(columns: int, rows: int) -> Topology:
    """Return a grid in which each row and each column is a circle, linked in one direction."""

    def step(router: int, last: int) -> int:
        row, column = divmod(router, columns)
        if column != last % columns:
            return row * columns + (column + 1) % columns
        return (row + 1) % rows * columns + column

    return _topology(TORUS, columns * rows, step, 1, columns)


def tree(endpoints: int) -> Topology:
    """Return a tree of routers whose leaves have up to four endpoints each, and the others up to four routers."""
    leaves = -(-endpoints // _FOLD)
    parents: list[int] = []
    first, count = 0, leaves
    while count > 1:
        above = first + count
        parents += [above + place // _FOLD for place in range(count)]
        first, count = above, -(-count // _FOLD)
    slots = tuple(endpoint // _FOLD for endpoint in range(endpoints))
    count = len(parents) + 1
    return Topology(TREE, slots, tuple(tuple(_in_tree(parents, at, to) for to in range(count)) for at in range(count)))


def _in_tree(parents: Sequence[int], router: int, last: int) -> int:
    """Return the next router: down to the subtree of `last`, or else up."""
    way = [last]
    while way[-1] < len(parents):
        way.append(parents[way[-1]])
    if router not in way:
        return parents[router]
    return way[max(0, way.index(router) - 1)]


def _topology(kind: str, routers: int, step: Callable[[int, int], int], each: int, columns: int = 0) -> Topology:
    numbers = range(routers)
    steps = tuple(tuple(at if at == to else step(at, to) for to in numbers) for at in numbers)
    return Topology(kind, tuple(router for router in numbers for _ in range(each)), steps, columns)


def topology(kind: str, endpoints: int) -> Topology:
    """Return the topology of a kind for a number of endpoints; grids are as square as possible and may have more.

    Raises `ValueError` for an unknown kind.
    """
    if kind not in _MAKERS:
        raise ValueError(f"topology '{kind}'; legal: {', '.join(KINDS)}")
    return _MAKERS[kind](endpoints)


def topologies(endpoints: int) -> tuple[Topology, ...]:
    """Return the candidates for a number of endpoints, one of each kind that makes sense."""
    return tuple(topology(kind, endpoints) for kind in KINDS if endpoints >= _LEAST[kind])


def _sides(count: int) -> tuple[int, int]:
    """Return the columns and rows of a nearly square grid with a place for each of `count`."""
    rows = max(1, isqrt(count))
    return -(-count // rows), rows


_MAKERS: Mapping[str, Callable[[int], Topology]] = {
    CROSSBAR: crossbar,
    MESH: lambda endpoints: mesh(*_sides(endpoints)),
    CONCENTRATED: lambda endpoints: mesh(*_sides(-(-endpoints // _FOLD)), each=_FOLD),
    CHAIN: chain,
    TREE: tree,
    RING: ring,
    TORUS: lambda endpoints: torus(*_sides(endpoints)),
}
# The least endpoints for which a topology makes sense; with fewer, a simpler one is the same or better.
_LEAST = {CROSSBAR: 1, MESH: 4, CONCENTRATED: 3 * _FOLD + 1, CHAIN: 2, TREE: 2 * _FOLD + 1, RING: 3, TORUS: 9}


@dataclass(frozen=True)
class Port:
    """A port of a router: to and from an endpoint, or another router."""

    is_endpoint: bool
    number: int


@dataclass(frozen=True)
class Channel:
    """A channel: from an endpoint into a router, from one router to another, or from a router out to an endpoint."""

    source: Port
    sink: Port

    def __str__(self) -> str:
        if self.source.is_endpoint:
            return f"input of endpoint {self.source.number}"
        if self.sink.is_endpoint:
            return f"output to endpoint {self.sink.number}"
        return f"link from router {self.source.number} to router {self.sink.number}"


@dataclass(frozen=True)
class Network:
    """Endpoints at the routers of a topology, and the flows between them; `places` has the router of each endpoint."""

    topology: Topology
    places: tuple[int, ...]
    flows: tuple[Flow, ...]

    def __post_init__(self) -> None:
        """Raise `ValueError` for a place, an endpoint or a copy that the topology does not have."""
        slots = [*self.topology.slots]
        for endpoint, place in enumerate(self.places):
            if place not in slots:
                raise ValueError(f"endpoint {endpoint}: no place is left at router {place}")
            slots.remove(place)
        for flow in self.flows:
            if not {flow.source, *flow.sinks} <= {*range(len(self.places))}:
                raise ValueError(f"flow from endpoint {flow.source} to {flow.sinks}: unknown endpoint")
            if len(flow.sinks) > 1 and self.topology.routers > 1:
                raise ValueError(f"flow from endpoint {flow.source}: only a crossbar copies frames")

    @property
    def endpoints(self) -> int:
        """The number of endpoints."""
        return len(self.places)

    def flows_of(self, source: int) -> tuple[Flow, ...]:
        """Return the flows of an endpoint; the number of one among them is the destination of its frames."""
        return tuple(flow for flow in self.flows if flow.source == source)

    @property
    def destinations(self) -> int:
        """The most destinations of an endpoint."""
        return max((len(self.flows_of(source)) for source in range(self.endpoints)), default=0)

    @cached_property
    def ways(self) -> Mapping[tuple[int, int], tuple[int, ...]]:
        """The routers from each source to each of its sinks."""
        return {
            (flow.source, sink): self.topology.way(self.places[flow.source], self.places[sink])
            for flow in self.flows
            for sink in flow.sinks
        }

    @cached_property
    def ports(self) -> tuple[tuple[Port, ...], ...]:
        """The ports of each router that flows use: those of endpoints first, then those of other routers."""
        found: list[set[Port]] = [set() for _ in range(self.topology.routers)]
        for turns, ports in zip(self._turns, found, strict=True):
            for turn in turns:
                ports.update(turn)
        return tuple(tuple(sorted(ports, key=lambda port: (not port.is_endpoint, port.number))) for ports in found)

    @cached_property
    def turns(self) -> tuple[frozenset[tuple[int, int]], ...]:
        """The turns of each router that flows use, from the place of one of its ports to that of another one."""
        return tuple(
            frozenset((ports.index(first), ports.index(last)) for first, last in turns)
            for ports, turns in zip(self.ports, self._turns, strict=True)
        )

    @cached_property
    def _turns(self) -> tuple[frozenset[tuple[Port, Port]], ...]:
        found: list[set[tuple[Port, Port]]] = [set() for _ in range(self.topology.routers)]
        for source, sink in self.ways:
            for channel, following in pairwise(self.channels(source, sink)):
                found[channel.sink.number].add((channel.source, following.sink))
        return tuple(frozenset(turns) for turns in found)

    def channels(self, source: int, sink: int) -> tuple[Channel, ...]:
        """Return the channels on the way of a flow."""
        way = (Port(True, source), *(Port(False, router) for router in self.ways[source, sink]), Port(True, sink))
        return tuple(Channel(first, last) for first, last in pairwise(way))

    @cached_property
    def hops(self) -> float:
        """The mean number of routers on a way, weighted by the rates of the flows; 0 without flows."""
        rates = sum(flow.rate * len(flow.sinks) for flow in self.flows)
        return self.cost / rates if rates else 0.0

    @property
    def cost(self) -> float:
        """The sum of rate times routers over all ways: the beats in routers in a cycle."""
        return sum(flow.rate * len(self.ways[flow.source, sink]) for flow in self.flows for sink in flow.sinks)

    def cycle(self, held: Collection[tuple[int, int]] = ()) -> tuple[Channel, ...] | None:
        """Return channels that may wait for each other in a cycle, or None: then there is no deadlock.

        For each pair of endpoints in `held`, the first one may hold a frame that it receives until the second one has
        sent a frame.
        """
        found = _cycle(self._waits(held))
        return None if found is None else tuple(node for node in found if isinstance(node, Channel))

    def _waits(self, held: Collection[tuple[int, int]]) -> Mapping[Channel | int, set[Channel | int]]:
        """Return for each channel, and each endpoint as the sink of one, for what it may have to wait."""
        waits: dict[Channel | int, set[Channel | int]] = {}
        for flow in self.flows:
            outputs = []
            for sink in flow.sinks:
                channels = self.channels(flow.source, sink)
                for channel, following in pairwise(channels):
                    waits.setdefault(channel, set()).add(following)
                outputs.append((sink, channels[-1]))
                for holder in (holder for holder, sender in held if sender == flow.source):
                    waits.setdefault(holder, set()).add(channels[0])
            for number, output in outputs:
                # A frame with copies holds the lower outputs while it waits for a higher one, and all of them while it
                # waits for a sink.
                higher = {other for place, other in outputs if place > number}
                waits.setdefault(output, set()).update(higher, (sink for sink, _ in outputs))
        return waits


def _cycle(waits: Mapping[Channel | int, set[Channel | int]]) -> list[Channel | int] | None:
    """Return a cycle of a graph, or None, by a search in depth."""
    done: set[Channel | int] = set()
    for start in waits:
        way: dict[Channel | int, Iterator[Channel | int]] = {}
        node: Channel | int | None = start
        while node is not None and node not in done:
            if node in way:
                nodes = [*way]
                return nodes[nodes.index(node) :]
            way[node] = iter(sorted(waits.get(node, ()), key=str))
            node = _next_of(way, done)
    return None


def _next_of(way: dict[Channel | int, Iterator[Channel | int]], done: set[Channel | int]) -> Channel | int | None:
    """Return the next node after the end of the way, whose exhausted nodes are done; None at its end."""
    while way:
        last = next(reversed(way))
        for node in way[last]:
            if node not in done:
                return node
        del way[last]
        done.add(last)
    return None
