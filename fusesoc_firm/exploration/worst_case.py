"""Bounds on the time of messages from block to block: converters, accelerators, junctions, the exchange, the Manager.

Each block is a server of one message at a time, which waits while the next block is taken. A message that is accepted
by a block finds the one before it at the next blocks, so these are free at the latest when that one has left them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import product
from typing import Any, NamedTuple

from fusesoc_firm.compiler.schedule import RELEASE
from fusesoc_firm.exploration.report import Report
from fusesoc_firm.noc.worst_case import WorstCase
from fusesoc_firm.system.derived.exchange import field_bits
from fusesoc_firm.system.derived.model import (
    AcceleratorBlock,
    Converter,
    DerivedSystem,
    End,
    InnerTopic,
    Junction,
    Overflow,
)
from fusesoc_firm.system.derived.timing import responses_of
from fusesoc_firm.system.hardware.compiled import schedule_of
from fusesoc_firm.system.system_core import LoadedSystem

# The cycles from the last beat of a frame to its message, and from a message at a publisher to the request.
_RECEIVED, _REQUESTED = 1, 1


@dataclass(frozen=True)
class WorstTime:
    """The most cycles of a message from a block to another one, or None for a `reason`.

    Of a `topic` within the FPGA, they are those from the message at its publisher to the message at its reader.
    Otherwise, they are those from the last beat at a subscriber to the last beat at a publisher.
    """

    source: str
    sink: str
    topic: str = ""
    cycles: int | None = None
    reason: str = ""

    def data(self) -> dict[str, Any]:
        """Return the bound as plain data."""
        found: dict[str, Any] = {"topic": self.topic} if self.topic else {}
        found |= {"from": self.source, "to": self.sink, "cycles": self.cycles}
        return found | ({"reason": self.reason} if self.reason else {})


def worst_times(loaded: LoadedSystem, responses: Mapping[str, int] | None = None) -> list[WorstTime]:
    """Return the bounds of topics within the FPGA and, from a subscriber to a publisher, of messages of the host.

    `responses` are the bounds of another scheduler than the system's, by publisher.
    """
    times = WorstTimes(loaded, responses_of(loaded.system) if responses is None else responses)
    return [*times.topics(), *times.ways()]


class _UnboundedError(Exception):
    """There is no bound, for a reason."""


class _Pace(NamedTuple):
    """The cycles from a message of an accelerator to its answer, and after this one is taken to its next message.

    It holds its message until its answer is taken, or has it in registers and takes the next one before.
    """

    latency: int
    release: int = RELEASE
    is_holding: bool = True


class _Entry(NamedTuple):
    """When an end accepts a message: `wait` cycles after it is offered, or `interval` cycles after its last one."""

    wait: int
    interval: int

    @property
    def between(self) -> int:
        """The most cycles between messages that always wait for the end."""
        return max(self.interval, self.wait + 1)

    def after(self, offered: int) -> int:
        """Return the cycle of the acceptance if the message is offered in a cycle, and the last one was taken in 0."""
        return max(offered + self.wait, self.interval)


@dataclass
class WorstTimes:
    """The bounds of a system, with those of its publishers' `responses`, from a request to the last beat.

    Each accelerator has one message at a time, and the messages of its other inputs before the one that is followed.
    The host takes each beat at once.
    """

    loaded: LoadedSystem
    responses: Mapping[str, int]
    _entries: dict[End, _Entry | _UnboundedError] = field(default_factory=dict)
    # The sources on the way that is followed.
    _followed: list[End] = field(default_factory=list)

    def topics(self) -> Iterator[WorstTime]:
        """Yield the bounds of topics within the FPGA."""
        for topic in self._system.inner_topics:
            for publisher, reader in product(range(len(topic.publishers)), range(len(topic.readers))):
                found = WorstTime(topic.publishers[publisher], topic.readers[reader], topic.name)
                yield _bounded(found, partial(self._transfer, topic, publisher, reader))

    def ways(self) -> Iterator[WorstTime]:
        """Yield the bounds from subscribers to publishers."""
        for subscriber in self._system.subscribers:
            for publisher in self._system.publishers:
                if publisher.block in self._reached(End(subscriber.block)):
                    found = WorstTime(subscriber.block, publisher.block)
                    yield _bounded(found, partial(self._way, subscriber, publisher.block))

    # --- the system --------------------------------------------------------------------------------------------------

    @property
    def _system(self) -> DerivedSystem:
        return self.loaded.system

    @cached_property
    def _sinks(self) -> dict[End, tuple[End, ...]]:
        return {item.source: item.sinks for item in self._system.connections}

    @cached_property
    def _junctions(self) -> dict[str, Junction]:
        return {item.block: item for item in self._system.junctions}

    @cached_property
    def _accelerators(self) -> dict[str, AcceleratorBlock]:
        return {item.block: item for item in self._system.accelerators}

    @cached_property
    def _endpoints(self) -> dict[End, int]:
        """The endpoint of each input and output of the exchange."""
        ends = enumerate(self._system.exchange.ends) if self._system.exchange else ()
        return {end: number for number, item in ends for end in (item.source, item.sink) if end}

    @cached_property
    def _beats(self) -> dict[End, int]:
        """The beats of a frame at each input and output of the exchange."""
        bits = {name: max(1, field_bits(item.frame)) for name, item in self._junctions.items() if item.is_exchanged}
        return {end: -(-bits[end.block] // self._system.width) for end in self._endpoints}

    @cached_property
    def exchange(self) -> WorstCase:
        """The bounds within the exchange of the system."""
        assert self._system.exchange
        network = self._system.exchange.network
        beats = {number: self._beats[end] for end, number in self._endpoints.items()}
        return WorstCase(network, [beats[flow.source] for flow in network.flows], self._hold)

    def _hold(self, endpoint: int) -> int:
        """Return the most cycles in which a reader's message waits for its blocks."""
        sink = self._sink_at(endpoint)
        entry = self._fork(sink)
        return max(entry.wait, entry.interval - self._beats[sink], 0)

    def _sink_at(self, endpoint: int) -> End:
        assert self._system.exchange
        sink = self._system.exchange.ends[endpoint].sink
        assert sink
        return sink

    def _outputs(self, block: str) -> list[End]:
        """Return the outputs of a block."""
        return [end for end in self._sinks if end.block == block]

    def _reached(self, source: End) -> set[str]:
        """Return the blocks that messages of a source, or the answers to them, reach."""
        found: set[str] = set()
        left = [*self._sinks.get(source, ())]
        while left:
            block = left.pop().block
            if block not in found:
                found.add(block)
                left += [sink for end in self._outputs(block) for sink in self._sinks[end]]
        return found

    # --- acceptance --------------------------------------------------------------------------------------------------

    def _fork(self, source: End) -> _Entry:
        """Return when all sinks of a source have accepted a message."""
        entries = [self._entry(sink) for sink in self._sinks.get(source, ())]
        return _Entry(
            max((item.wait for item in entries), default=0), max((item.interval for item in entries), default=1)
        )

    def _entry(self, end: End) -> _Entry:
        """Return when an end accepts messages; raise `_UnboundedError`."""
        if end not in self._entries:
            self._entries[end] = _UnboundedError(f"messages wait for each other at '{end.block}'")
            try:
                self._entries[end] = self._computed(end)
            except _UnboundedError as error:
                self._entries[end] = error
        found = self._entries[end]
        if isinstance(found, _UnboundedError):
            raise found
        return found

    def _computed(self, end: End) -> _Entry:
        if end.block in self._accelerators:
            busy = self._busy(end.block)
            return _Entry(busy, 1) if self._pace(end.block).is_holding else _Entry(0, busy)
        junction = self._junctions.get(end.block)
        if junction is None:
            return _Entry(_REQUESTED + self._response(end.block), 1)
        if junction.is_exchanged:
            return _Entry(0, self.exchange.acceptance(self._endpoints[end]))
        if junction.overflow is not Overflow.BLOCK:
            return _Entry(0, 1)
        between = self._between(junction)
        return _Entry(0, between) if junction.depth else _Entry(junction.sources * between, 1)

    def _between(self, junction: Junction) -> int:
        """Return the most cycles between messages at the output of a merge or a queue, if they wait there."""
        return self._fork(End(junction.block, junction.output.prefix)).between

    def _busy(self, block: str) -> int:
        """Return the most cycles from a message of an accelerator to its next message."""
        pace = self._pace(block)
        taken = (self._fork(output).after(pace.latency) for output in self._outputs(block))
        return max(taken, default=pace.latency) + pace.release

    def _response(self, publisher: str) -> int:
        if publisher not in self.responses:
            raise _UnboundedError(f"the scheduler has no bound for '{publisher}': add 'period' and 'wcet'")
        return self.responses[publisher]

    def _pace(self, block: str) -> _Pace:
        """Return the pace of an accelerator that has one message at a time, or raise `_UnboundedError`."""
        item = self._accelerators[block]
        type_, declared = item.type, item.type.accelerator
        if item.clock:
            raise _UnboundedError(f"'{block}' has another clock")
        if declared.is_compiled and not type_.inner:
            if not all(side.frame.is_fixed_size for side in (*type_.inputs, *type_.outputs)):
                raise _UnboundedError(f"a message of '{block}' has a variable size")
            return _Pace(Report(schedule_of(type_, self.loaded.folder)).longest)
        latency, interval = declared.latency, declared.interval
        if latency is None:
            raise _UnboundedError(f"'{declared.name}' has no 'latency'")
        if interval is None:
            return _Pace(latency)
        if interval < latency:
            raise _UnboundedError(f"'{declared.name}' has several messages at a time")
        return _Pace(latency, interval - latency, is_holding=False)

    # --- times -------------------------------------------------------------------------------------------------------

    def _transfer(self, topic: InnerTopic, publisher: int, reader: int) -> int:
        """Return the most cycles from a message at a publisher to it at a reader, before the reader's queue."""
        junction = next((item for item in self._junctions.values() if item.topic == topic.name), None)
        if junction is None or not (junction.is_exchanged or len(topic.publishers) > 1):
            return 0
        end = End(junction.block, junction.inputs[publisher].prefix)
        if not junction.is_exchanged:
            return self._entry(end).wait
        return (
            self._entry(end).interval - 1 + self._delivered(end, End(junction.block, junction.outputs[reader].prefix))
        )

    def _delivered(self, end: End, output: End) -> int:
        return self.exchange.delivery(self._endpoints[end], self._endpoints[output]) + _RECEIVED

    def _way(self, subscriber: Converter, publisher: str) -> int:
        """Return the most cycles from the last beat of a frame at a subscriber to a publisher's last beat.

        A subscriber of fixed size takes the beats of the fields when the message before is taken.
        """
        beats = field_bits(subscriber.frame) // self._system.width if subscriber.frame.is_fixed_size else 0
        return self._following(End(subscriber.block), publisher, beats + _RECEIVED) - beats

    def _following(self, source: End, publisher: str, offered: int) -> int:
        """Return the most cycles to the last beat at a publisher, if a message is offered in a cycle.

        The sinks have taken the last one by cycle 0.
        """
        if source in self._followed:
            raise _UnboundedError(f"messages return to '{source.block}'")
        self._followed.append(source)
        try:
            return max(self._through(sink, publisher, offered) for sink in self._leading(source, publisher))
        finally:
            self._followed.pop()

    def _leading(self, source: End, publisher: str) -> list[End]:
        """Return the sinks of a source from which a publisher is reached."""

        def leads(sink: End) -> bool:
            return publisher == sink.block or any(publisher in self._reached(end) for end in self._outputs(sink.block))

        return [sink for sink in self._sinks[source] if leads(sink)]

    def _through(self, end: End, publisher: str, offered: int) -> int:
        if end.block == publisher:
            return offered + _REQUESTED + self._response(publisher)
        outputs = [output for output in self._outputs(end.block) if publisher in self._reached(output)]
        junction = self._junctions.get(end.block)
        entry = self._entry(end)
        if junction is None:
            pace = self._pace(end.block)
            if pace.is_holding:
                return max(self._following(output, publisher, offered + pace.latency) for output in outputs)
            # The accelerator may still have the message before, whose answer is taken first.
            return entry.after(offered) + max(self._following(output, publisher, pace.latency) for output in outputs)
        if junction.is_exchanged:
            return max(self._after_exchange(end, output, publisher, entry.after(offered)) for output in outputs)
        between = self._between(junction)
        if junction.depth:
            # All messages before this one in the queue leave.
            left = entry.after(offered) + (junction.depth - 1) * between
            return left + self._following(outputs[0], publisher, 1)
        turn = offered + max(1, (junction.sources - 1) * between)
        return turn + self._following(outputs[0], publisher, 0)

    def _after_exchange(self, end: End, output: End, publisher: str, accepted: int) -> int:
        """Return the most cycles to a publisher's last beat after the exchange has accepted a message.

        The reader's blocks have taken the message before when the first beat arrives.
        """
        beats = self._beats[output]
        return accepted + self._delivered(end, output) - beats + self._following(output, publisher, beats)


def _bounded(found: WorstTime, compute: Callable[[], int]) -> WorstTime:
    try:
        return replace(found, cycles=compute())
    except _UnboundedError as error:
        return replace(found, reason=str(error))
