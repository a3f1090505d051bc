"""The ways that the topics within the FPGA may take: wires and each exchange, with their cells and cycles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.noc.estimate import delay, merge_lut, routers_lut, sender_lut
from fusesoc_firm.noc.network import Network, topologies
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.derived.exchange import field_bits
from fusesoc_firm.system.derived.model import DerivedSystem, Exchange, Junction
from fusesoc_firm.system.system_core import LoadedSystem, with_keys
from fusesoc_firm.system.written.specification import TOPOLOGIES, WIRES
from fusesoc_firm.text.diagnostics import Diagnostics, InputError


@dataclass(frozen=True)
class Fabric:
    """A way of the topics: its value of the key `fabric`, and what it costs for a system.

    `lut` and `ff` are estimated for an ECP5. `cycles` are those from the message with the most bits at a publisher to
    the same message at a reader, if nothing else is under way, and `interval` those between two such messages. A way
    that is not possible has a `fault`.
    """

    name: str
    exchange: Exchange | None = None
    lut: int = 0
    ff: int = 0
    cycles: int = 0
    interval: int = 1
    fault: str = ""

    @property
    def network(self) -> Network | None:
        """The routers with their endpoints."""
        return self.exchange.network if self.exchange else None

    def data(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        if self.fault:
            return {"fabric": self.name, "fault": self.fault}
        found: dict[str, Any] = {"fabric": self.name, "lut": self.lut, "ff": self.ff}
        if self.network:
            turns = sum(map(len, self.network.turns))
            found |= {"routers": self.network.topology.routers, "turns": turns, "hops": round(self.network.hops, 2)}
        return found | {"cycles": self.cycles, "interval": self.interval}


def fabrics(loaded: LoadedSystem) -> list[Fabric]:
    """Return wires, and each exchange that makes sense for the number of the system's endpoints.

    Without topics of fixed size within the FPGA, there are only wires.
    """
    found = [_with(loaded, WIRES), _with(loaded, TOPOLOGIES[0])]
    if not (exchange := found[1].exchange):
        return found[:1]
    sensible = {item.kind.replace(" ", "_") for item in topologies(len(exchange.ends))}
    names = [name for name in TOPOLOGIES[1:] if name in sensible or name == loaded.specification.project.fabric]
    return [*found, *(_with(loaded, name) for name in names)]


def _with(loaded: LoadedSystem, name: str) -> Fabric:
    """Return a way, for a system with this value of the key `fabric`."""
    specification = with_keys(loaded.specification, {"fabric": name})
    try:
        system = derive(specification, loaded.folder, loaded.libraries, Diagnostics(), needs_sources=False)
    except InputError as error:
        return Fabric(name, fault=error.diagnostics[0].message)
    return _exchanged(name, system, system.exchange) if system.exchange else _wired(name, system)


def _wired(name: str, system: DerivedSystem) -> Fabric:
    """Return wires, with a merge for each topic of several publishers; it may have to turn to the publisher first."""
    merges = [item for item in system.junctions if item.topic and item.sources > 1]
    lut = sum(merge_lut(item.sources, field_bits(item.frame)) for item in merges)
    return Fabric(name, lut=lut, ff=sum(item.sources for item in merges), cycles=1 if merges else 0)


def _exchanged(name: str, system: DerivedSystem, exchange: Exchange) -> Fabric:
    width, network = system.width, exchange.network
    topics = {item.block: item for item in system.junctions if item.is_exchanged}
    sent = [topics[end.source.block] for end in exchange.ends if end.source]
    taken = [topics[end.sink.block] for end in exchange.ends if end.sink]
    lut = sum(sender_lut(_bits(item)) for item in sent) + routers_lut(network, width)
    times = [*_times(exchange, topics, width)]
    return Fabric(
        name,
        exchange,
        lut=lut,
        ff=sum(map(_bits, (*sent, *taken))),
        cycles=max(cycles for cycles, _ in times),
        interval=max(interval for _, interval in times),
    )


def _times(exchange: Exchange, topics: dict[str, Junction], width: int) -> Iterator[tuple[int, int]]:
    """Yield the cycles of a message of each flow, and those between two messages of its publisher.

    A message is one cycle in the register of its publisher.
    """
    network = exchange.network
    for flow in network.flows:
        source = exchange.ends[flow.source].source
        assert source is not None
        beats = -(-_bits(topics[source.block]) // width)
        for sink in flow.sinks:
            yield 1 + delay(network, flow, sink) + beats, beats * len(network.flows_of(flow.source))


def _bits(junction: Junction) -> int:
    return max(1, field_bits(junction.frame))
