"""A search for the slowest messages of an exchange: sources that always have messages, or pause, and slow readers."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from random import Random

from fusesoc_firm.noc.model import Beat, Model
from fusesoc_firm.noc.worst_case import WorstCase

# A source and one of its sinks, with the most cycles from the message's offer to its last beat.
Found = dict[tuple[int, int], int]
# Of this part of all runs, the behaviour is random; that of the others is changed from one of the worst ones.
_RANDOM_PART = 3


@dataclass
class Behaviour:
    """When each source has its first message, its pauses between messages in turn, and how long sinks are busy."""

    first: dict[int, int]
    pauses: dict[int, tuple[int, ...]]
    holds: dict[int, int]


def worst_found(bounds: WorstCase, seed: int, runs: int = 60, cycles: int = 700) -> Found:
    """Return the slowest messages of a number of runs."""
    chance = Random(seed)
    sources = sorted({flow.source for flow in bounds.network.flows})
    holds = {sink: bounds.holds(sink) for flow in bounds.network.flows for sink in flow.sinks}
    best: Found = {}
    worst: dict[tuple[int, int], Behaviour] = {}
    for run in range(runs):
        if run == 0:
            behaviour = Behaviour(dict.fromkeys(sources, 0), dict.fromkeys(sources, (0,)), holds)
        elif run < runs // _RANDOM_PART:
            behaviour = _random(chance, sources, holds)
        else:
            behaviour = _changed(chance, chance.choice([*worst.values()]), holds)
        for pair, time in times(bounds, behaviour, cycles).items():
            if time > best.get(pair, -1):
                best[pair], worst[pair] = time, behaviour
    return best


def _random(chance: Random, sources: list[int], holds: Mapping[int, int]) -> Behaviour:
    return Behaviour(
        {source: chance.choice((0, chance.randrange(60))) for source in sources},
        {source: chance.choice(((0,), _pauses(chance))) for source in sources},
        {sink: chance.choice((hold, hold, 0, chance.randint(0, hold))) for sink, hold in holds.items()},
    )


def _pauses(chance: Random) -> tuple[int, ...]:
    return tuple(chance.randrange(chance.choice((1, 1, 8, 60, 200))) for _ in range(chance.choice((1, 1, 2, 3))))


def _changed(chance: Random, behaviour: Behaviour, holds: Mapping[int, int]) -> Behaviour:
    found = Behaviour({**behaviour.first}, {**behaviour.pauses}, {**behaviour.holds})
    for _ in range(chance.choice((1, 1, 2, 3))):
        source, sink = chance.choice([*found.first]), chance.choice([*holds])
        kind = chance.randrange(4)
        if kind == 0:
            found.first[source] = chance.randrange(80)
        elif kind == 1:
            found.first[source] = max(0, found.first[source] + chance.randint(-3, 3))
        elif kind == 2:
            found.pauses[source] = _pauses(chance)
        else:
            found.holds[sink] = chance.choice((holds[sink], chance.randint(0, holds[sink])))
    return found


def times(bounds: WorstCase, behaviour: Behaviour, cycles: int) -> Found:
    """Return the most cycles of a message of each source to each of its sinks, from its offer to its last beat."""
    model = Model(bounds.network)
    flows = {
        source: [n for n, flow in enumerate(bounds.network.flows) if flow.source == source]
        for source in behaviour.first
    }
    due = {**behaviour.first}
    sent: dict[int, list[int]] = {source: [] for source in flows}
    left: dict[int, deque[Beat]] = {source: deque() for source in flows}
    free = dict.fromkeys(behaviour.holds, 0)
    found: Found = {}
    for cycle in range(cycles):
        offers = {source: beats[0] for source, beats in left.items() if beats}
        taken, arrived = model.step(offers, lambda sink, now=cycle: free[sink] <= now)  # type: ignore[misc]
        for source in taken:
            left[source].popleft()
        for sink, beat in arrived.items():
            if beat.is_last:
                source = bounds.network.flows[beat.flow].source
                found[source, sink] = max(found.get((source, sink), 0), cycle - sent[source][beat.tag])
                free[sink] = cycle + 1 + behaviour.holds[sink]
        for source, beats in left.items():
            # `firm_message_send` takes a message with the last beat of the one before.
            if not beats and due[source] <= cycle:
                number = len(sent[source])
                sent[source].append(due[source])
                for flow in flows[source]:
                    count = bounds.beats[flow]
                    beats.extend(Beat(flow, place == count - 1, number) for place in range(count))
                pauses = behaviour.pauses[source]
                due[source] = cycle + 1 + pauses[number % len(pauses)]
    return found
