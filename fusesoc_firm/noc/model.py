"""A model of an exchange, which is `firm_noc_router` beat for beat and cycle for cycle.

`Model` makes one step for each cycle. `arrivals` runs it with frames that become due over time, `throughput` with
sources that always have frames, and `latency` with random frames.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from random import Random
from typing import NamedTuple

from fusesoc_firm.noc.network import Flow, Network, Port


class Beat(NamedTuple):
    """A beat of a frame: the place of its flow in `Network.flows`, whether it is the frame's last one, and any tag."""

    flow: int
    is_last: bool
    tag: int = 0


class Frame(NamedTuple):
    """A frame that is due in a cycle, of so many beats, of a flow by its place in `Network.flows`."""

    cycle: int
    flow: int
    beats: int


class Arrival(NamedTuple):
    """The last beat of a frame, by its number, reaches an endpoint."""

    cycle: int
    sink: int
    frame: int


class _Turn(NamedTuple):
    """A turn: the number of an output, and the place of the input among those of the output."""

    output: int
    place: int


@dataclass
class _Output:
    """An output of a router; `inputs` are those that may go there."""

    inputs: list[int]
    # The endpoint, or else the input of the next router.
    sink: int | None = None
    following: int = 0
    grant: int = 0
    is_busy: bool = False


@dataclass
class _Input:
    """An input of a router, with its beats and, of each flow, the turns in ascending order of outputs."""

    turns: dict[int, list[_Turn]] = field(default_factory=dict)
    beats: deque[Beat] = field(default_factory=deque)
    # Of a frame with copies: the outputs that have taken the first beat, and whether it begins the frame.
    done: set[int] = field(default_factory=set)
    begins: bool = True


class Model:
    """An exchange after its reset; each input of a router buffers so many beats."""

    def __init__(self, network: Network, buffers: int = 2) -> None:
        """Build the routers' inputs and outputs."""
        self._buffers = buffers
        self._inputs: list[_Input] = []
        self._outputs: list[_Output] = []
        self._entries: dict[int, int] = {}
        numbers = _numbers(network)
        for ports, turns in zip(network.ports, network.turns, strict=True):
            first = len(self._inputs)
            for place in range(len(ports)):
                self._inputs.append(_Input())
                self._outputs.append(_Output([first + source for source, sink in sorted(turns) if sink == place]))
        for place, flow in enumerate(network.flows):
            self._route(network, numbers, place, flow)
        self._active: set[int] = set()

    def _route(self, network: Network, numbers: Mapping[tuple[int, Port], int], place: int, flow: Flow) -> None:
        """Enter the turns of a flow."""
        for sink in flow.sinks:
            channels = network.channels(flow.source, sink)
            for channel, following in pairwise(channels):
                router = channel.sink.number
                number, last = numbers[router, channel.source], numbers[router, following.sink]
                output = self._outputs[last]
                if channel.source.is_endpoint:
                    self._entries[flow.source] = number
                if following.sink.is_endpoint:
                    output.sink = sink
                else:
                    output.following = numbers[following.sink.number, Port(False, router)]
                turn = _Turn(last, output.inputs.index(number))
                turns = self._inputs[number].turns.setdefault(place, [])
                if turn not in turns:
                    turns.append(turn)
                    turns.sort()

    def is_ready(self, source: int) -> bool:
        """Return whether an endpoint's beat would be taken in this cycle."""
        return source in self._entries and len(self._inputs[self._entries[source]].beats) < self._buffers

    def offered(self) -> dict[int, Beat]:
        """Return the beats that endpoints are offered in this cycle."""
        found = {}
        for number, places in self._requests().items():
            output = self._outputs[number]
            if output.sink is not None and output.grant in places:
                found[output.sink] = self._inputs[output.inputs[output.grant]].beats[0]
        return found

    def step(self, offers: Mapping[int, Beat], ready: Callable[[int], bool]) -> tuple[list[int], dict[int, Beat]]:
        """Pass a cycle; return the sources whose offered beats were taken, and the beats that endpoints took.

        `offers` has the beats that sources offer; `ready` tells whether an endpoint takes a beat.
        """
        taken = [source for source in offers if self.is_ready(source)]
        moves = [move for number, places in self._requests().items() for move in self._moves(number, places, ready)]
        arrived: dict[int, Beat] = {}
        entering: list[tuple[int, Beat]] = [(self._entries[source], offers[source]) for source in taken]
        for source, number in moves:
            output = self._outputs[number]
            beat = self._inputs[source].beats[0]
            self._inputs[source].done.add(number)
            if output.sink is not None:
                arrived[output.sink] = beat
            else:
                entering.append((output.following, beat))
        for source in {source for source, _ in moves}:
            self._pop(source)
        for source, beat in entering:
            self._inputs[source].beats.append(beat)
            self._active.add(source)
        return taken, arrived

    def _requests(self) -> dict[int, list[int]]:
        """Return for each output the places of the inputs that request it."""
        found: dict[int, list[int]] = {}
        for number in self._active:
            source = self._inputs[number]
            turns = source.turns[source.beats[0].flow]
            if len(turns) > 1:
                turns = [turn for turn in turns if turn.output not in source.done]
                if source.begins:
                    turns = turns[:1]
            for output, place in turns:
                found.setdefault(output, []).append(place)
        return found

    def _moves(self, number: int, places: Sequence[int], ready: Callable[[int], bool]) -> Iterator[tuple[int, int]]:
        """Yield the input from which an output takes a beat, if any, with the output; renew the grant."""
        output = self._outputs[number]
        grant = output.grant
        if grant not in places:
            if not output.is_busy:
                output.grant = next_place(places, grant)
            return
        is_free = (
            len(self._inputs[output.following].beats) < self._buffers if output.sink is None else ready(output.sink)
        )
        if is_free:
            source = output.inputs[grant]
            output.is_busy = not self._inputs[source].beats[0].is_last
            if not output.is_busy:
                output.grant = next_place(places, grant)
            yield source, number

    def _pop(self, number: int) -> None:
        """Remove the first beat of an input if all its outputs have taken it."""
        source = self._inputs[number]
        beat = source.beats[0]
        if len(source.done) == len(source.turns[beat.flow]):
            source.done.clear()
            source.begins = beat.is_last
            source.beats.popleft()
            if not source.beats:
                self._active.discard(number)


def next_place(places: Sequence[int], grant: int) -> int:
    """Return the place after the present one that requests, in a circle, or the present one."""
    higher = [place for place in places if place > grant]
    lower = [place for place in places if place < grant]
    return min(higher or lower or [grant])


def _numbers(network: Network) -> dict[tuple[int, Port], int]:
    """Return the number of each port among those of all routers."""
    ports = [(router, port) for router, ports in enumerate(network.ports) for port in ports]
    return {port: number for number, port in enumerate(ports)}


def arrivals(
    network: Network, frames: Iterable[Frame], cycles: int, *, buffers: int = 2, deaf: Sequence[int] = ()
) -> list[Arrival]:
    """Return the arrivals of frames in so many cycles.

    Frames are in the order of their cycles; each source sends its own in this order, a beat in each cycle if it is
    taken. The endpoints of `deaf` take nothing.
    """
    model = Model(network, buffers)
    waiting: dict[int, deque[Beat]] = {}
    coming = deque(enumerate(frames))
    found = []
    for cycle in range(cycles):
        while coming and coming[0][1].cycle <= cycle:
            number, frame = coming.popleft()
            beats = waiting.setdefault(network.flows[frame.flow].source, deque())
            beats.extend(Beat(frame.flow, place == frame.beats - 1, number) for place in range(frame.beats))
        offers = {source: beats[0] for source, beats in waiting.items() if beats}
        taken, arrived = model.step(offers, lambda sink: sink not in deaf)
        for source in taken:
            waiting[source].popleft()
        found += [Arrival(cycle, sink, beat.tag) for sink, beat in arrived.items() if beat.is_last]
    return found


def merged(dues: Sequence[Sequence[int]], cycles: int) -> Iterator[tuple[int, int, int]]:
    """Yield the source, number and cycle of each message that leaves a merge of wires, whose sink takes it at once.

    `dues` are the cycles in which the messages of each source are due. As in `firm_message_merge`, the turn goes to the
    next source that waits when a message has left, or after a cycle without one.
    """
    turn, left = 0, [deque(enumerate(due)) for due in dues]
    for cycle in range(cycles):
        waiting = [source for source, messages in enumerate(left) if messages and messages[0][1] <= cycle]
        if turn in waiting:
            number, _ = left[turn].popleft()
            yield turn, number, cycle
        turn = next_place(waiting, turn)


def throughput(network: Network, *, buffers: int = 2, beats: int = 8, cycles: int = 4000, seed: int = 1) -> float:
    """Return the beats that all endpoints receive in a cycle if each source always has a frame of so many beats.

    A source chooses its flows at random by their rates. The first fifth of the cycles does not count.
    """
    random = Random(seed)
    model = Model(network, buffers)
    choices = _choices(network)
    sending: dict[int, deque[Beat]] = {source: deque() for source in choices}
    received = 0
    for cycle in range(cycles):
        for source, left in sending.items():
            if not left:
                (flow,) = random.choices(*choices[source])
                left.extend(Beat(flow, place == beats - 1) for place in range(beats))
        taken, arrived = model.step({source: left[0] for source, left in sending.items()}, lambda _: True)
        for source in taken:
            sending[source].popleft()
        received += len(arrived) if cycle >= cycles // 5 else 0
    return received / (cycles - cycles // 5)


def latency(network: Network, load: float, *, buffers: int = 2, beats: int = 8, cycles: int = 4000) -> float:
    """Return the mean cycles from the cycle in which a frame is due to the one in which its last beat arrives.

    `load` is the number of beats that all sources together send in a cycle. Frames that are due in the last fifth of
    the cycles do not count; those that never arrive count as if they arrived at the end.
    """
    frames = random_frames(network, load, beats, cycles)
    counted = [number for number, frame in enumerate(frames) if frame.cycle < cycles - cycles // 5]
    ends = {arrival.frame: arrival.cycle for arrival in arrivals(network, frames, cycles, buffers=buffers)}
    waits = [ends.get(number, cycles) + 1 - frames[number].cycle for number in counted]
    return sum(waits) / len(waits) if waits else 0.0


def random_frames(network: Network, load: float, beats: int, cycles: int, seed: int = 1) -> list[Frame]:
    """Return random frames of all sources, which together send `load` beats in a cycle."""
    random = Random(seed)
    choices = _choices(network)
    chance = load / beats / max(1, len(choices))
    return [
        Frame(cycle, random.choices(flows, rates)[0], beats)
        for cycle in range(cycles)
        for flows, rates in choices.values()
        if random.random() < chance
    ]


def _choices(network: Network) -> dict[int, tuple[list[int], list[float]]]:
    """Return the flows of each source, and their rates."""
    found: dict[int, tuple[list[int], list[float]]] = {}
    for place, flow in enumerate(network.flows):
        flows, rates = found.setdefault(flow.source, ([], []))
        flows.append(place)
        rates.append(flow.rate)
    return found
