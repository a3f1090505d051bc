"""The ways that the topics within the FPGA may take: wires and each exchange, with their cells and cycles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Any, NamedTuple

from fusesoc_firm.exploration.fabric_map import FabricMap
from fusesoc_firm.noc.estimate import delay, merge_lut, routers_lut, sender_lut
from fusesoc_firm.noc.model import Frame, arrivals, merged
from fusesoc_firm.noc.network import Network, topologies
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.derived.exchange import field_bits
from fusesoc_firm.system.derived.model import DerivedSystem, Exchange, Junction
from fusesoc_firm.system.system_core import LoadedSystem, with_keys
from fusesoc_firm.system.written.specification import TOPOLOGIES, WIRED, WIRES
from fusesoc_firm.text.diagnostics import Diagnostics, InputError

# The cycles that the model runs, those of them before messages count, and the seed of random times.
_CYCLES, _WARM, _SEED = 4000, 1000, 1


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
    # Of wires: the sources of each merge.
    merges: tuple[int, ...] = ()

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


def fabric_of(loaded: LoadedSystem) -> str:
    """Return the way that the system uses."""
    written = str(loaded.specification.project.fabric)
    return WIRES if written in WIRED or not loaded.system.exchange else written


def fabrics_data(loaded: LoadedSystem, found: Sequence[Fabric]) -> dict[str, Any]:
    """Return the system's way, the figures of all ways, and the map of its exchange, if it has one, as plain data."""
    exchange = loaded.system.exchange
    drawn = {"map": FabricMap(exchange).data()} if exchange else {}
    return {"fabric": fabric_of(loaded), "ways": [item.data() for item in found], **drawn}


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
    sources = tuple(item.sources for item in merges)
    return Fabric(name, lut=lut, ff=sum(sources), cycles=1 if merges else 0, merges=sources)


def _exchanged(name: str, system: DerivedSystem, exchange: Exchange) -> Fabric:
    width, network = system.width, exchange.network
    topics = {item.block: item for item in system.junctions if item.is_exchanged}
    sent = [topics[end.source.block] for end in exchange.ends if end.source]
    taken = [topics[end.sink.block] for end in exchange.ends if end.sink]
    lut = sum(sender_lut(_bits(item)) for item in sent) + routers_lut(network, width)
    times = [
        (1 + delay(network, flow, sink) + count, count * len(network.flows_of(flow.source)))
        for flow, count in zip(network.flows, _beats(network), strict=True)
        for sink in flow.sinks
    ]
    return Fabric(
        name,
        exchange,
        lut=lut,
        ff=sum(map(_bits, (*sent, *taken))),
        # A message is one cycle in the register of its publisher.
        cycles=max(cycles for cycles, _ in times),
        interval=max(interval for _, interval in times),
    )


def _beats(network: Network) -> list[int]:
    """Return the beats of a message of each flow, which are its rate in an exchange."""
    return [round(flow.rate) for flow in network.flows]


def _bits(junction: Junction) -> int:
    return max(1, field_bits(junction.frame))


@dataclass(frozen=True)
class Traffic:
    """What a way does with much traffic, by its cycle model.

    `rate` is the number of messages in 1,000 cycles from the slowest publisher to its readers, if all publishers always
    have one. `mean` and `worst` are the cycles of a message if each publisher sends half as many, at random times.
    """

    rate: float
    mean: float
    worst: int


def traffic(fabric: Fabric) -> Traffic:
    """Return the traffic of a way for all topics together."""
    network = fabric.network
    if network is None:
        return _wired_traffic(max(fabric.merges, default=1))
    sources = sorted({flow.source for flow in network.flows})
    always = [_Sent(0, source) for source in sources for _ in range(_CYCLES // min(_beats(network)) + 1)]
    ends = _received(network, always)
    counts = dict.fromkeys(sources, 0)
    for number, end in ends.items():
        counts[always[number].source] += end >= _WARM
    rate = min(counts.values()) / (_CYCLES - _WARM)
    random = Random(_SEED)
    some = [_Sent(cycle, source) for cycle in range(_CYCLES) for source in sources if random.random() < rate / 2]
    ends = _received(network, some)
    # The first cycle of a message is that in the register of its publisher, the last one that at its reader.
    waits = [end + 2 - some[number].cycle for number, end in ends.items()]
    return Traffic(1000 * rate, sum(waits) / len(waits) if waits else 0.0, max(waits, default=0))


def _wired_traffic(sources: int) -> Traffic:
    """Return the traffic of the largest merge of wires, on which a message passes in a cycle."""
    always = [range(_CYCLES)] * sources
    counts = Counter(source for source, _, cycle in merged(always, _CYCLES) if cycle >= _WARM)
    rate = min(counts.values()) / (_CYCLES - _WARM)
    random = Random(_SEED)
    some = [[cycle for cycle in range(_CYCLES) if random.random() < rate / 2] for _ in range(sources)]
    waits = [cycle - some[source][number] for source, number, cycle in merged(some, _CYCLES)]
    return Traffic(1000 * rate, sum(waits) / len(waits), max(waits))


class _Sent(NamedTuple):
    """A message of a source that is due in a cycle."""

    cycle: int
    source: int


def _received(network: Network, sent: Sequence[_Sent]) -> dict[int, int]:
    """Return the cycle of the last beat at the last reader of each message that all of its readers receive.

    Without routers that copy, a message is a frame to each of its readers.
    """
    frames: list[tuple[Frame, int]] = []
    sinks = dict.fromkeys({flow.source for flow in network.flows}, 0)
    for place, (flow, beats) in enumerate(zip(network.flows, _beats(network), strict=True)):
        sinks[flow.source] += len(flow.sinks)
        frames += [(Frame(item.cycle, place, beats), n) for n, item in enumerate(sent) if item.source == flow.source]
    frames.sort(key=lambda pair: (pair[0].cycle, pair[1]))
    found: dict[int, list[int]] = {}
    for arrival in arrivals(network, [frame for frame, _ in frames], _CYCLES):
        found.setdefault(frames[arrival.frame][1], []).append(arrival.cycle)
    return {number: max(ends) for number, ends in found.items() if len(ends) == sinks[sent[number].source]}
