"""The hardware of a network: the data of the template `vhdl/exchange.vhd`, whose routers are `firm_noc_router`.

A frame carries a label beside its beats, which tells the routers its way. In a crossbar, it is the number of the
destination among those of the frame's source; elsewhere, the slot of the sink, so that the labels of a grid consist of
its rows and columns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise

from fusesoc_firm.noc.network import Flow, Network, Port
from fusesoc_firm.text.render import Context

TEMPLATE = "vhdl/exchange.vhd"
WIDTHS = (8, 16, 32, 64, 128, 256, 512)
# The routes in a line of the generated file.
_IN_A_LINE = 4

# A route of a router: input, label and output.
_Route = tuple[int, int, int]


def exchange_configuration(entity: str, network: Network, width: int, *, buffers: int = 2) -> Context:
    """Return the data of the template for an entity with streams of `width` bits.

    The input of each router buffers `buffers` beats, a power of two from 2 on. Raises `ValueError`.
    """
    if width not in WIDTHS:
        raise ValueError(f"streams of {width} bits; legal: {', '.join(map(str, WIDTHS))}")
    if buffers < 2 or buffers & (buffers - 1):
        raise ValueError(f"buffers of {buffers} beats; legal: powers of two")
    if not network.flows:
        raise ValueError("an exchange without flows")
    return _Exchange(entity, network, width, buffers).context()


@dataclass(frozen=True)
class _Exchange:
    entity: str
    network: Network
    width: int
    buffers: int

    def context(self) -> Context:
        """Return the data of the template."""
        return {
            "entity": self.entity,
            "endpoints": self.network.endpoints,
            "kind": self.network.topology.kind,
            "width": self.width,
            "lanes": self.width // 8,
            "dest_bits": self._label_bits,
            "depth": self.buffers,
            "ports": self._first[-1],
            "tdest": self._tdest(),
            "routers": list(self._routers()),
            **self._endpoints(),
            "links": list(self._links()),
            "unfed": [{"port": port} for port in range(self._first[-1]) if port not in self._used[0]],
            "unread": [{"port": port} for port in range(self._first[-1]) if port not in self._used[1]],
        }

    # --- labels ----------------------------------------------------------------------------------------------------

    @property
    def _is_crossbar(self) -> bool:
        return self.network.topology.routers == 1

    @property
    def _tdest_bits(self) -> int:
        return max(1, (self.network.destinations - 1).bit_length())

    @property
    def _label_bits(self) -> int:
        return self._tdest_bits if self._is_crossbar else max(1, (len(self.network.topology.slots) - 1).bit_length())

    @cached_property
    def _slot_of(self) -> tuple[int, ...]:
        """The slot of each endpoint: those of a router are taken in the order of its endpoints."""
        left = [*self.network.topology.slots]
        found = []
        for place in self.network.places:
            slot = left.index(place)
            left[slot] = -1
            found.append(slot)
        return tuple(found)

    def _label(self, flow: Flow) -> int:
        if self._is_crossbar:
            return self.network.flows_of(flow.source).index(flow)
        return self._slot_of[flow.sinks[0]]

    # --- ports -----------------------------------------------------------------------------------------------------

    @cached_property
    def _first(self) -> tuple[int, ...]:
        """The number of each router's first port among those of all routers, and their total."""
        return tuple(accumulate(map(len, self.network.ports), initial=0))

    def _port(self, router: int, port: Port) -> int:
        """Return the number of a port among those of all routers."""
        return self._first[router] + self.network.ports[router].index(port)

    @cached_property
    def _used(self) -> tuple[frozenset[int], frozenset[int]]:
        """The ports that beats enter, and those that they leave."""
        turns = [
            (first + start, last + start)
            for start, turns in zip(self._first, self.network.turns, strict=False)
            for first, last in turns
        ]
        return frozenset(first for first, _ in turns), frozenset(last for _, last in turns)

    # --- parts of the template's data ------------------------------------------------------------------------------

    def _tdest(self) -> Context | None:
        if self.network.destinations < 2:
            return None
        senders = []
        for source in range(self.network.endpoints):
            flows = self.network.flows_of(source)
            destinations = [{"number": number, "sinks": list(flow.sinks)} for number, flow in enumerate(flows)]
            if destinations:
                senders.append({"source": source, "destinations": destinations})
        return {"bits": self._tdest_bits, "senders": senders}

    def _endpoints(self) -> Context:
        """Return the ends of the network's channels at endpoints, and the endpoints without them."""
        sinks = {sink for flow in self.network.flows for sink in flow.sinks}
        sources = {flow.source for flow in self.network.flows}
        numbers = range(self.network.endpoints)
        return {
            "sources": [self._source(number) for number in sorted(sources)],
            "silent": [{"endpoint": number} for number in numbers if number not in sources],
            "sinks": [self._end(number) for number in sorted(sinks)],
            "deaf": [{"endpoint": number} for number in numbers if number not in sinks],
        }

    def _end(self, endpoint: int) -> Context:
        router = self.network.places[endpoint]
        return {"endpoint": endpoint, "router": router, "port": self._port(router, Port(True, endpoint))}

    def _source(self, endpoint: int) -> Context:
        """Return the end of a source, with the label of each of its destinations."""
        flows = self.network.flows_of(endpoint)
        labels: list[Context] = []
        own = self._label(flows[0])
        if len(flows) > 1 and not self._is_crossbar:
            labels = [
                {"number": _bits(number, self._tdest_bits), "label": _bits(self._label(flow), self._label_bits)}
                for number, flow in enumerate(flows)
            ]
            # The label of an illegal destination. The own one makes less logic than others if the destinations are
            # all other endpoints.
            own = self._slot_of[endpoint]
        is_direct = len(flows) > 1 and self._is_crossbar
        return {
            **self._end(endpoint),
            "labels": labels,
            "is_direct": is_direct,
            "label": _bits(own, self._label_bits),
        }

    def _routers(self) -> Iterator[Context]:
        """Yield the routers that flows use, with their routes in lines."""
        for router, routes in enumerate(self._routes):
            if routes:
                items = [
                    {"place": place, "input": input_, "destination": label, "output": output}
                    for place, (input_, label, output) in enumerate(sorted(routes))
                ]
                yield {
                    "number": router,
                    "first": self._first[router],
                    "end": self._first[router + 1],
                    "count": len(self.network.ports[router]),
                    "lines": [
                        {"routes": items[place : place + _IN_A_LINE]} for place in range(0, len(items), _IN_A_LINE)
                    ],
                }

    @cached_property
    def _routes(self) -> tuple[frozenset[_Route], ...]:
        found: list[set[_Route]] = [set() for _ in range(self.network.topology.routers)]
        for flow in self.network.flows:
            for sink in flow.sinks:
                channels = self.network.channels(flow.source, sink)
                for channel, following in pairwise(channels):
                    router = channel.sink.number
                    ports = self.network.ports[router]
                    route = (ports.index(channel.source), self._label(flow), ports.index(following.sink))
                    found[router].add(route)
        return tuple(map(frozenset, found))

    def _links(self) -> Iterator[Context]:
        """Yield the links between routers that flows use."""
        channels = {channel for source, sink in self.network.ways for channel in self.network.channels(source, sink)}
        links = {(item.source.number, item.sink.number) for item in channels if _is_link(item.source, item.sink)}
        for source, sink in sorted(links):
            yield {
                "source": source,
                "sink": sink,
                "output": self._port(source, Port(False, sink)),
                "input": self._port(sink, Port(False, source)),
            }


def _is_link(source: Port, sink: Port) -> bool:
    return not source.is_endpoint and not sink.is_endpoint


def _bits(number: int, bits: int) -> str:
    return f"{number:0{bits}b}"
