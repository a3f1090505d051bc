"""Bounds on the time of messages in an exchange, for any traffic of its other publishers.

A frame waits at an output for at most one frame of each other input (round robin), each of which holds the output until
its last beat has left. This is the recursion of T. Ferrandiz, F. Frances and C. Fraboul (A method of computation for
worst-case delay analysis on SpaceWire networks, 2009), with the buffers of the routers: a frame leaves a router as soon
as it fits into the buffers on its way, where it may be in the way of the next one.

Endpoints take the beats of a frame without a pause. Channels must not wait for each other in a cycle (`Network.cycle`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from fusesoc_firm.noc.network import Channel, Network

# The beats in the buffer of a router's input.
_DEPTH = 2


class _Turn(NamedTuple):
    """A flow at the router `hop`, counted from 1, on its way to the sink `copy`, in the order of outputs."""

    flow: int
    hop: int
    copy: int = 0


@dataclass
class WorstCase:
    """The bounds of an exchange, in cycles; `beats` are those of a frame of each flow.

    `holds` returns the most cycles in which an endpoint takes nothing after a frame. It may ask for other bounds of
    this exchange, as far as channels do not wait for each other.
    """

    network: Network
    beats: Sequence[int]
    holds: Callable[[int], int]
    # The channels of each flow to each of its sinks, in the order in which the outputs are acquired.
    _ways: list[list[tuple[Channel, ...]]] = field(init=False)
    # For each output, the turns to it from each input; for each buffer, by the channel to it, the turns from it.
    _to: dict[Channel, dict[Channel, list[_Turn]]] = field(init=False)
    _from: dict[Channel, list[_Turn]] = field(init=False)
    _known: dict[tuple[object, ...], int] = field(init=False)

    def __post_init__(self) -> None:
        """Find the turns."""
        self._ways = [
            sorted((self.network.channels(flow.source, sink) for sink in flow.sinks), key=self._place)
            for flow in self.network.flows
        ]
        self._to, self._from, self._known = {}, {}, {}
        for flow, ways in enumerate(self._ways):
            for copy, way in enumerate(ways):
                for hop, (source, sink) in enumerate(pairwise(way), 1):
                    turn = _Turn(flow, hop, copy)
                    self._to.setdefault(sink, {}).setdefault(source, []).append(turn)
                    self._from.setdefault(source, []).append(turn)

    def _place(self, way: Sequence[Channel]) -> int:
        return self.network.ports[way[-1].source.number].index(way[-1].sink)

    # --- messages ----------------------------------------------------------------------------------------------------
    #
    # A message is one frame of each flow of its source. The holds of the sinks of these flows pass at the same time, so
    # a message either waits for the rest of one hold, and then without a hold, or for each hold in turn.

    def acceptance(self, source: int) -> int:
        """Return the most cycles from the acceptance of an endpoint's message to the possible one of its next message.

        The frames enter the first router as others leave it.
        """
        flows = self._flows_of(source)
        free = [self._served(flow, is_held=False) for flow in flows]
        after = [self._freed(flow) + sum(free[place:]) for place, flow in enumerate(flows)]
        return min(sum(self._served(flow) for flow in flows), max(sum(free), *after))

    def delivery(self, source: int, sink: int) -> int:
        """Return the most cycles from the acceptance of a message to the one in which its last beat is taken."""
        flows = self._flows_of(source)
        flow = next(flow for flow in flows if sink in self.network.flows[flow].sinks)
        before = flows[: flows.index(flow)]
        # The last frames of the message before it may still be in the first buffer.
        first = range(self._frames(self._ways[flow][0][0]))
        start = sum(self._leaving(_Turn(flows[-1 - place % len(flows)], 1)) for place in first)
        rest, free_rest = self._passing(flow), self._passing(flow, is_held=False)
        free = [self._served(other, is_held=False) for other in before]
        after = [self._freed(other) + sum(free[place:]) + free_rest for place, other in enumerate(before)]
        after.append(self._freed(flow) + self._unhindered(flow))
        held = start + sum(self._served(other) for other in before) + rest
        return min(held, max(start + sum(free) + free_rest, *after))

    def _flows_of(self, source: int) -> list[int]:
        return [place for place, flow in enumerate(self.network.flows) if flow.source == source]

    def _hops(self, flow: int) -> int:
        return len(self._ways[flow][0]) - 1

    def _unhindered(self, flow: int) -> int:
        return self._hops(flow) + self.beats[flow]

    def _passing(self, flow: int, *, is_held: bool = True) -> int:
        """Return the most cycles of a frame that is the first one at the first router, up to its last beat."""
        return self._unhindered(flow) + self._waits(flow, 1, is_held=is_held)

    def _waits(self, flow: int, first: int, *, is_held: bool = True) -> int:
        """Return the most cycles in which the first beat of a frame waits, from a router on."""
        hops = range(first, self._hops(flow) + 1)
        behind = sum(self._behind(self._ways[flow][0][hop - 1]) for hop in hops if hop > 1)
        return behind + sum(self._wait(_Turn(flow, hop), is_held=is_held) for hop in hops)

    def _served(self, flow: int, *, is_held: bool = True) -> int:
        """Return the most cycles that a frame is the first one at the first router."""
        turn = _Turn(flow, 1)
        rest = self._holding(turn, is_held=is_held) if self._hops(flow) > 1 else self.beats[flow]
        return self._wait(turn, is_held=is_held) + rest

    def _freed(self, flow: int) -> int:
        """Return the most cycles from the acceptance of a message until the sink of a flow without others is ready.

        The frame of the message before may still be on its way there.
        """
        if not self._is_alone(flow):
            return 0
        passed = self._passed(flow)
        rest = self._waits(flow, passed + -(-self.beats[flow] // _DEPTH)) + _DEPTH * (self._hops(flow) - passed)
        return rest + self.holds(self.network.flows[flow].sinks[0])

    def _passed(self, flow: int) -> int:
        """Return the buffers that a frame has left if its message has left the publisher: the first one, or none."""
        flows = self._flows_of(self.network.flows[flow].source)
        return int(sum(self.beats[other] for other in flows[flows.index(flow) + 1 :]) >= _DEPTH)

    def _is_alone(self, flow: int) -> bool:
        """Return whether only this flow leads to its sink, with at most one frame on its way as a message is taken."""
        way, *copies = self._ways[flow]
        turns = [turn for turns in self._to[way[-1]].values() for turn in turns]
        return not copies and len(turns) == 1 and self.beats[flow] >= _DEPTH * (self._hops(flow) - self._passed(flow))

    # --- frames ------------------------------------------------------------------------------------------------------

    def _wait(self, turn: _Turn, *, is_held: bool = True) -> int:
        """Return the most cycles before a frame gets its output; at the last router, before all sinks have begun it.

        Without `is_held`, the hold of a sink to which only this flow leads does not count.
        """
        if turn.hop == self._hops(turn.flow):
            return self._acquired(turn.flow, 0, is_held=is_held) - 1
        return self._others(turn)

    def _acquired(self, flow: int, first: int, *, is_held: bool = True) -> int:
        """Return the most cycles until the outputs to sinks from a copy on have taken the first beat, one by one."""
        total = 0
        is_counted = is_held or not self._is_alone(flow)
        for copy, way in enumerate(self._ways[flow][first:], first):
            others = self._others(_Turn(flow, len(way) - 1, copy))
            hold = self.holds(way[-1].sink.number) if is_counted else 0
            # The hold begins with the frame before, which is an earlier one of this input unless there are others.
            total = (total + others + hold if others else max(total, hold)) + 1
        return total

    def _others(self, turn: _Turn) -> int:
        """Return the most cycles in which one frame of each other input holds an output."""
        way = self._ways[turn.flow][turn.copy]
        inputs = self._to[way[turn.hop]].items()
        return sum(max(map(self._holding, turns)) for channel, turns in inputs if channel != way[turn.hop - 1])

    def _holding(self, turn: _Turn, *, is_held: bool = True) -> int:
        """Return the most cycles from the grant of an output to a frame until its last beat has left."""
        return self._once(
            ("holding", turn, is_held), lambda: self.beats[turn.flow] + self._stalls(turn, is_held=is_held)
        )

    def _stalls(self, turn: _Turn, *, is_held: bool) -> int:
        """Return the most cycles in which a frame holds an output without sending a beat."""
        flow, first, copy = turn
        way, beats, hops = self._ways[flow][copy], self.beats[flow], self._hops(flow)
        if first == hops:
            return self.holds(way[-1].sink.number) + self._acquired(flow, copy + 1)
        total = 0
        for hop in range(first + 1, hops + 1):
            if beats <= _DEPTH * (hop - first):
                # The rest of the frame fits into this buffer.
                return total + self._room(way[hop - 1], beats)
            total += self._behind(way[hop - 1]) + self._wait(_Turn(flow, hop, copy), is_held=is_held)
        return total

    # --- buffers -----------------------------------------------------------------------------------------------------

    def _behind(self, channel: Channel) -> int:
        """Return the most cycles that a frame is in a buffer, but behind others that entered before."""
        return self._frames(channel) * max(map(self._leaving, self._from[channel]))

    def _room(self, channel: Channel, beats: int) -> int:
        """Return the most cycles until a buffer has room for some beats."""
        return min(beats, self._frames(channel)) * max(map(self._leaving, self._from[channel]))

    def _frames(self, channel: Channel) -> int:
        """Return the most frames whose last beats may be in a buffer together."""
        return _DEPTH if any(self.beats[turn.flow] == 1 for turn in self._from[channel]) else 1

    def _leaving(self, turn: _Turn) -> int:
        """Return the most cycles that a frame stays in a buffer after its last beat has entered, beside its beats."""
        return self._once(("leaving", turn), lambda: self._left(turn))

    def _left(self, turn: _Turn) -> int:
        flow, hop, _ = turn
        way, beats = self._ways[flow][0], self.beats[flow]
        # The router at which the first beat is, unless it has passed there.
        reached = hop - 1 + -(-beats // _DEPTH)
        if reached > self._hops(flow):
            return 0
        total = self._wait(_Turn(flow, reached))
        if beats % _DEPTH and reached > hop:
            total += self._behind(way[reached - 1])
        return total + (self._room(way[reached], beats) if reached < self._hops(flow) else 0)

    def _once(self, key: tuple[object, ...], compute: Callable[[], int]) -> int:
        """Return a bound that many others need, which is computed once."""
        if key not in self._known:
            self._known[key] = compute()
        return self._known[key]
