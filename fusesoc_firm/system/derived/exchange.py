"""The exchange: routers between the publishers and readers of topics, with the topology that the specification names.

Each block has an endpoint for each message that it publishes and each one that it reads; one endpoint may have one of
both. Endpoints that exchange many beats are placed near to each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest

from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.noc.mapping import mapped
from fusesoc_firm.noc.network import CROSSBAR, Channel, Flow, Network, Port, Topology, topology
from fusesoc_firm.system.derived.model import Connection, End, Exchange, ExchangeEnd, InnerTopic, Junction, Overflow
from fusesoc_firm.system.written.specification import WIRED, Project
from fusesoc_firm.text.diagnostics import Diagnostics

# The mappings that are tried, in this order, until one has no cycle of waiting messages.
_SEEDS = range(8)


def exchange_of(
    project: Project,
    junctions: Sequence[Junction],
    connections: Sequence[Connection],
    topics: Sequence[InnerTopic],
    faults: Diagnostics,
) -> Exchange | None:
    """Return the exchange of a system, or None if no topic passes it; note faults."""
    exchanged = [item for item in junctions if item.is_exchanged]
    if not exchanged:
        if project.fabric not in WIRED:
            message = f"'fabric: {project.fabric}' has no effect: no topic of fixed size is within the FPGA"
            faults.warn(message, project.place("fabric"), "remove the key")
        return None
    plan = _Plan(project.width, exchanged, {item.block: item for item in junctions}, connections)
    network, cycle = plan.network(topology(str(project.fabric).replace("_", " "), len(plan.ends)))
    if cycle:
        _report(cycle, plan, topics, project, faults)
    return Exchange(network, plan.ends)


def _report(
    cycle: Sequence[Channel], plan: _Plan, topics: Sequence[InnerTopic], project: Project, faults: Diagnostics
) -> None:
    """Note messages that may wait for each other in the routers."""
    way = " -> ".join(plan.name_of(item) for item in (*cycle, cycle[0]))
    readers = [plan.reader_at(item.sink.number, topics) for item in cycle if item.sink.is_endpoint]
    hint = f"use 'fabric: {CROSSBAR}', in which topics share no way"
    if readers:
        hint += f", or add 'queue: 2' and 'overflow: drop_oldest' to '{readers[0]}'"
    faults.error(f"messages may wait for each other in the routers: {way}", project.place("fabric"), hint)


@dataclass(frozen=True)
class _Plan:
    """What an exchange must join: the `exchanged` topics, among all junctions and connections of the system."""

    width: int
    exchanged: Sequence[Junction]
    junctions: Mapping[str, Junction]
    connections: Sequence[Connection]

    @cached_property
    def ends(self) -> tuple[ExchangeEnd, ...]:
        """The endpoints, in the order of their topics: those with a publisher first."""
        given: dict[str, list[End]] = {}
        taken: dict[str, list[End]] = {}
        feeding = {sink: item.source.block for item in self.connections for sink in item.sinks}
        for junction in self.exchanged:
            for side in junction.inputs:
                end = End(junction.block, side.prefix)
                given.setdefault(feeding[end], []).append(end)
            for side in junction.outputs:
                end = End(junction.block, side.prefix)
                taken.setdefault(self._fed(end), []).append(end)
        return tuple(
            ExchangeEnd(block, source, sink)
            for block in dict.fromkeys((*given, *taken))
            for source, sink in zip_longest(given.get(block, ()), taken.get(block, ()))
        )

    @cached_property
    def _sinks(self) -> Mapping[End, tuple[End, ...]]:
        return {item.source: item.sinks for item in self.connections}

    def _fed(self, end: End) -> str:
        """Return the first block that an output feeds, behind merges and queues."""
        block = self._sinks[end][0].block
        while block in self.junctions and not self.junctions[block].is_exchanged:
            block = self._sinks[End(block, self.junctions[block].output.prefix)][0].block
        return block

    @cached_property
    def _source_at(self) -> Mapping[End, int]:
        return {end.source: number for number, end in enumerate(self.ends) if end.source}

    @cached_property
    def _sink_at(self) -> Mapping[End, int]:
        return {end.sink: number for number, end in enumerate(self.ends) if end.sink}

    def network(self, routers: Topology) -> tuple[Network, tuple[Channel, ...] | None]:
        """Return the network with the endpoints at good places, and a cycle of waiting messages if all have one.

        In a crossbar, no topic waits for another one, so its messages wait for each other only if blocks do.
        """
        is_crossbar = routers.kind == CROSSBAR
        flows = tuple(self._flows(has_copies=is_crossbar))
        for seed in _SEEDS:
            network = Network(routers, mapped(routers, len(self.ends), flows, seed=seed), flows)
            if is_crossbar or not (cycle := network.cycle(self._held)):
                return network, None
        return network, cycle

    def _flows(self, *, has_copies: bool) -> Iterator[Flow]:
        """Yield the flows of all topics, with the beats of a message as their rates.

        Routers of a crossbar copy frames; otherwise, a publisher sends a frame to each reader.
        """
        for junction in self.exchanged:
            beats = -(-max(1, field_bits(junction.frame)) // self.width)
            sinks = tuple(self._sink_at[End(junction.block, side.prefix)] for side in junction.outputs)
            for side in junction.inputs:
                source = self._source_at[End(junction.block, side.prefix)]
                yield from (Flow(source, to, float(beats)) for to in ([sinks] if has_copies else ((s,) for s in sinks)))

    @cached_property
    def _held(self) -> frozenset[tuple[int, int]]:
        """The endpoints whose messages may wait for a message from another endpoint to be taken.

        A block may hold its message until its answer is taken. A queue is full at some time, unless it drops messages.
        """
        return frozenset((number, sent) for sink, number in self._sink_at.items() for sent in self._answers(sink))

    def _answers(self, sink: End) -> Iterator[int]:
        """Yield the endpoints to which blocks send when they receive a message at `sink`."""
        ways: dict[str, list[End]] = {}
        for source, sinks in self._sinks.items():
            ways.setdefault(source.block, []).extend(sinks)
        left = [*self._sinks[sink]]
        seen: set[End] = set()
        while left:
            end = left.pop()
            if end in self._source_at:
                yield self._source_at[end]
            elif end not in seen and not self._drops(end.block):
                seen.add(end)
                left += ways.get(end.block, [])

    def _drops(self, block: str) -> bool:
        return block in self.junctions and self.junctions[block].overflow is not Overflow.BLOCK

    def name_of(self, channel: Channel) -> str:
        """Return the name of a channel, with the blocks at its ends."""
        return f"{self._port(channel.source)} to {self._port(channel.sink)}"

    def _port(self, port: Port) -> str:
        return self.ends[port.number].block if port.is_endpoint else f"router {port.number}"

    def reader_at(self, number: int, topics: Sequence[InnerTopic]) -> str:
        """Return the subscriber whose messages leave at an endpoint."""
        sink = self.ends[number].sink
        assert sink is not None
        junction = self.junctions[sink.block]
        place = [side.prefix for side in junction.outputs].index(sink.prefix)
        return next(topic.readers[place] for topic in topics if topic.name == junction.topic)


def field_bits(frame: Frame) -> int:
    """Return the bits of all used fields of a message."""
    return sum(port.width or 1 for port in field_ports(frame))
