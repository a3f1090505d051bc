"""Messages that reach one block on two ways of different lengths: they may wait for each other at a fork.

A fork releases a message when all its sinks have taken it. A block that joins two messages takes the one of the shorter
way when the one of the longer way arrives. If a block on the longer way takes a further message before it answers, the
fork never releases the first one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from fusesoc_firm.system.derived.model import Connection, End

Way = tuple[str, ...]


@dataclass(frozen=True)
class Join:
    """Two ways from one block to another, each with all its blocks; `sink` is the end of the shorter one.

    If the message meets others on one of the ways, `has_merge` is set.
    """

    sink: End
    shorter: Way
    longer: Way
    has_merge: bool = False


def joins(connections: Iterable[Connection], merges: Collection[str] = ()) -> Iterator[Join]:
    """Yield for each pair of inputs of a block the nearest block from which ways lead to both.

    The ways have different lengths, or one of `merges` is on them, which takes the messages of its inputs one by one.
    """
    before: dict[End, list[str]] = {}
    inputs: dict[str, list[End]] = {}
    for connection in connections:
        for sink in connection.sinks:
            before.setdefault(sink, []).append(connection.source.block)
            if sink not in inputs.setdefault(sink.block, []):
                inputs[sink.block].append(sink)
    for block, ends in inputs.items():
        if len(ends) < 2 or block in merges:
            continue
        ways = {end: _ways(block, before[end], inputs, before) for end in ends}
        for one, other in combinations(ways, 2):
            if found := _nearest(ways[one], ways[other]):
                shorter, longer = sorted(found, key=len)
                has_merge = not {*shorter, *longer}.isdisjoint(merges)
                if len(shorter) < len(longer) or has_merge:
                    yield Join(one if shorter == found[0] else other, shorter, longer, has_merge)


def _ways(
    block: str, sources: Sequence[str], inputs: Mapping[str, Sequence[End]], before: Mapping[End, Sequence[str]]
) -> dict[str, Way]:
    """Return the shortest way to a block from each block that leads to it through `sources`."""
    found: dict[str, Way] = {source: (source, block) for source in sources}
    new = deque(found)
    while new:
        name = new.popleft()
        for source in (source for end in inputs.get(name, ()) for source in before[end]):
            if source not in found:
                found[source] = (source, *found[name])
                new.append(source)
    return found


def _nearest(one: Mapping[str, Way], other: Mapping[str, Way]) -> tuple[Way, Way] | None:
    """Return the shortest two ways from the same block."""
    common = [(one[name], other[name]) for name in one if name in other]
    return min(common, key=lambda ways: len(ways[0]) + len(ways[1]), default=None)
