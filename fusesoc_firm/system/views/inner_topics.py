"""The ways of the topics that a system both publishes and subscribes to, as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from fusesoc_firm.system.derived.model import DerivedSystem, Exchange, InnerTopic, Junction, Overflow
from fusesoc_firm.system.hardware.exchange import described


def ways_of_topics(system: DerivedSystem) -> list[str]:
    """Return a line for each topic that the system both publishes and subscribes to, and for each merged input."""
    return [*map(_merged, _merges(system)), *(_way(topic, system) for topic in system.inner_topics)]


def topics_description(system: DerivedSystem) -> dict[str, Any]:
    """Return these topics, and the merges and queues between blocks, as plain data; nothing without them."""
    found: dict[str, Any] = {}
    if system.inner_topics:
        found["Topics"] = [_topic(topic) for topic in system.inner_topics]
    if system.junctions:
        found["Junctions"] = [_junction(item) for item in system.junctions]
    if system.exchange:
        found["Exchange"] = _exchange(system.exchange)
    return found


def _merges(system: DerivedSystem) -> Iterator[tuple[str, list[str]]]:
    """Yield each input that several blocks feed without a topic, with these blocks."""
    for junction in system.junctions:
        if not junction.topic:
            sinks = [
                sink.block for item in system.connections if item.source.block == junction.block for sink in item.sinks
            ]
            yield ", ".join(sinks), _sources(system, junction)


def _sources(system: DerivedSystem, junction: Junction) -> list[str]:
    ends = {end: item.source.block for item in system.connections for end in item.sinks if end.block == junction.block}
    return [ends[end] for end in sorted(ends, key=str)]


def _merged(found: tuple[str, Sequence[str]]) -> str:
    sink, sources = found
    return f"input of {sink}: {', '.join(sources)} by a merge, since each of them provides the whole message"


def _way(topic: InnerTopic, system: DerivedSystem) -> str:
    if not topic.readers:
        return f"topic {topic.name}: by the host, because of {topic.reason}"
    kinds = [_kind(item, system) for item in system.junctions if item.topic == topic.name]
    parts = [f"{', '.join(topic.publishers)} -> {', '.join(topic.readers)} within the FPGA" + _by(kinds)]
    inner = [item for item in topic.publishers if item not in topic.to_host]
    if topic.to_host:
        parts.append(f"{', '.join(topic.to_host)} also to the host")
    if inner:
        parts.append(f"{', '.join(inner)} not to the host ('deliver: fabric')")
    if topic.from_host:
        parts.append(f"{', '.join(topic.from_host)} also from the host ('deliver: both')")
    return f"topic {topic.name}: {'; '.join(parts)}"


def _by(kinds: Sequence[str]) -> str:
    return f" by {', '.join(kinds)}" if kinds else " by wires"


def _kind(junction: Junction, system: DerivedSystem) -> str:
    if junction.is_exchanged and system.exchange:
        return f"the exchange, {described(system.exchange)}"
    if junction.depth:
        return f"a queue of {junction.depth} messages ({junction.block})"
    return f"a merge of {junction.sources} sources ({junction.block})"


def _topic(topic: InnerTopic) -> dict[str, Any]:
    found: dict[str, Any] = {"topic": topic.name}
    for name in ("publishers", "readers", "to_host", "from_host"):
        if blocks := getattr(topic, name):
            found["toHost" if name == "to_host" else "fromHost" if name == "from_host" else name] = [*blocks]
    return found | ({"byHost": topic.reason} if topic.reason else {})


def _exchange(exchange: Exchange) -> dict[str, Any]:
    network = exchange.network
    return {
        "topology": network.topology.kind,
        "routers": network.topology.routers,
        "turns": sum(map(len, network.turns)),
        "endpoints": [
            {
                "block": end.block,
                "router": router,
                **({"sends": end.source.block} if end.source else {}),
                **({"receives": end.sink.block} if end.sink else {}),
            }
            for end, router in zip(exchange.ends, network.places, strict=True)
        ],
    }


def _junction(junction: Junction) -> dict[str, Any]:
    found: dict[str, Any] = {"block": junction.block, "nameMW": str(junction.frame.message)}
    found |= {"topic": junction.topic} if junction.topic else {}
    if not junction.depth:
        return found | {"sources": junction.sources, **({"readers": junction.readers} if junction.readers else {})}
    drops = {} if junction.overflow is Overflow.BLOCK else {"overflow": junction.overflow.value}
    return found | {"queue": junction.depth, **drops}
