"""The record of a run for its watchers: the latest messages and the counts of each block, in bounded memory.

    watch = Watch()
    watch.saw("camera", payload, time_ns)           # the run; this call never waits for a reader
    news = watch.since(number, 100)                 # any reader, as often as it likes

A reader that is too slow misses messages, and receives their number.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice

_MOST_BYTES, _MOST_MESSAGES = 64 * 2**20, 20_000
# The number of the latest bursts, and of counts of waits.
_MOST_GRANTS, _MOST_WAITS = 5000, 5000
# The number of latencies of a block from which percentiles are computed.
_MOST_LATENCIES = 1000


@dataclass(frozen=True)
class Latency:
    """The latency of a response: its cause, the cycles of clk and the time.

    `cause` is the number of a message in the record. `cycles` last from the cause's first beat to the response's last
    beat, in simulation; `wall_ns` from the cause's arrival at the host.
    """

    cause: int | None = None
    cycles: int | None = None
    wall_ns: int | None = None


@dataclass(frozen=True)
class Seen:
    """A message at a subscriber or publisher; `number` counts all messages of the run.

    `time_ns` is the time since the begin of the record, or in the replayed bag. `cycles` are those of the first and the
    last beat of a response from simulated hardware.
    """

    number: int
    block: str
    time_ns: int
    payload: bytes
    latency: Latency = Latency()
    cycles: tuple[int, int] | None = None


@dataclass(frozen=True)
class Grant:
    """A burst of simulated hardware: the scheduler let a publisher send from the cycle `first` to the cycle `last`."""

    block: str
    first: int
    last: int


@dataclass(frozen=True)
class Waits:
    """The cycles in which each wire of simulated hardware waited, from the cycle `first` to the one before `end`.

    On a waiting wire, a message or a beat is valid, but not accepted. `cycles` is the number of counted cycles.
    """

    first: int
    end: int
    cycles: int
    counts: tuple[int, ...]

    @classmethod
    def of(cls, parts: Sequence[Waits]) -> Waits | None:
        """Return the sum of parts in their order, or None without parts."""
        if not parts:
            return None
        counts = tuple(map(sum, zip(*(part.counts for part in parts), strict=True)))
        return cls(parts[0].first, parts[-1].end, sum(part.cycles for part in parts), counts)


def _coarser(parts: Sequence[Waits]) -> list[Waits]:
    """Return the parts with neighbours of the older half summed, so that a long run keeps the waits of all its cycles.

    Between parts that are not neighbours, nobody watched; they stay apart.
    """
    half = len(parts) // 2
    found: list[Waits] = []
    for first, second in zip(parts[0:half:2], parts[1:half:2], strict=False):
        pair = [first, second]
        total = Waits.of(pair) if first.end == second.first else None
        found += [total] if total else pair
    return [*found, *parts[half // 2 * 2 :]]


@dataclass(frozen=True)
class Load:
    """The load of an input: messages in its queue, of at most `capacity`, and dropped messages."""

    waiting: int
    capacity: int
    dropped: int
    refused: int
    lost: int


@dataclass(frozen=True)
class Percentiles:
    """The median, the 99th percentile and the maximum of the latest latencies."""

    median: int
    most: int
    maximum: int

    @classmethod
    def of(cls, values: Sequence[int]) -> Percentiles | None:
        """Return the percentiles of values, or None without values."""
        found = sorted(values)
        return cls(found[len(found) // 2], found[(len(found) * 99) // 100], found[-1]) if found else None


@dataclass(frozen=True)
class Count:
    """The messages of a block so far, their bytes, and their latencies in cycles of clk and in ns of the wall clock."""

    messages: int
    bytes: int
    cycles: Percentiles | None
    wall_ns: Percentiles | None


@dataclass(frozen=True)
class News:
    """The messages after the reader's last one, of which `skipped` are missing; `last` is the newest number."""

    messages: tuple[Seen, ...]
    skipped: int
    last: int


@dataclass
class _Counting:
    messages: int = 0
    bytes: int = 0
    cycles: deque[int] = field(default_factory=lambda: deque(maxlen=_MOST_LATENCIES))
    wall_ns: deque[int] = field(default_factory=lambda: deque(maxlen=_MOST_LATENCIES))


class Watch:
    """The record; any thread may call its methods. At the bounds, the oldest messages are removed."""

    def __init__(self, most_bytes: int = _MOST_BYTES, most_messages: int = _MOST_MESSAGES) -> None:
        """Keep at most `most_bytes` of payloads, or the newest message, and at most `most_messages`."""
        self._most_bytes, self._most_messages = most_bytes, most_messages
        self._lock = threading.Lock()
        self._messages: deque[Seen] = deque()
        self._bytes = 0
        self._next = 0
        self._counts: dict[str, _Counting] = {}
        self._loads: Callable[[], Mapping[str, Load]] = dict
        self._grants: deque[Grant] = deque(maxlen=_MOST_GRANTS)
        self._waits: deque[Waits] = deque(maxlen=_MOST_WAITS)
        self._waits_of_all: Waits | None = None
        self._first_of_cycles = 0
        self.is_watched: Callable[[], bool] = lambda: False
        """Returns whether the run is watched; expensive counts are made only then."""
        self.status: Mapping[str, int] = {}
        """The counts of the hardware's status at the last read, by texts for the user."""
        self.restart()

    def restart(self) -> None:
        """Count the time from now on: `start_ns` is its begin by the monotonic clock, `epoch_ns` as a date.

        The times of a replay count from another `epoch_ns`.
        """
        self.start_ns, self.epoch_ns = time.monotonic_ns(), time.time_ns()

    def measure(self, loads: Callable[[], Mapping[str, Load]]) -> None:
        """Name the source of the inputs' loads, by block; readers call it."""
        self._loads = loads

    def saw(
        self,
        block: str,
        payload: bytes,
        time_ns: int,
        latency: Latency = Latency(),
        cycles: tuple[int, int] | None = None,
    ) -> int:
        """Record a message, and return its number."""
        with self._lock:
            seen = Seen(self._next, block, time_ns, payload, latency, cycles)
            self._next += 1
            self._messages.append(seen)
            self._bytes += len(payload)
            while len(self._messages) > self._most_messages or (
                self._bytes > self._most_bytes and len(self._messages) > 1
            ):
                self._bytes -= len(self._messages.popleft().payload)
            count = self._counts.setdefault(block, _Counting())
            count.messages += 1
            count.bytes += len(payload)
            if latency.cycles is not None:
                count.cycles.append(latency.cycles)
            if latency.wall_ns is not None:
                count.wall_ns.append(latency.wall_ns)
            return seen.number

    def granted(self, block: str, first: int, last: int) -> None:
        """Record a burst of a publisher."""
        with self._lock:
            self._grants.append(Grant(block, first, last))

    def grants(self, most: int) -> list[Grant]:
        """Return the latest bursts, at most `most`, the oldest first."""
        with self._lock:
            return [*islice(self._grants, max(0, len(self._grants) - most), None)]

    def begin_cycles(self) -> None:
        """Begin a new simulator, whose cycles count from 0: discard the data with cycles of the previous one."""
        with self._lock:
            self._first_of_cycles = self._next
            self._grants.clear()
            self._waits.clear()
            self._waits_of_all = None

    def waited(self, first: int, end: int, counts: Sequence[int]) -> None:
        """Record the cycles in which each wire has waited, from the cycle `first` to the one before `end`."""
        with self._lock:
            if first == end:
                return
            found = Waits(first, end, end - first, tuple(counts))
            if len(self._waits) == _MOST_WAITS:
                self._waits = deque(_coarser([*self._waits]), _MOST_WAITS)
            self._waits.append(found)
            self._waits_of_all = Waits.of([self._waits_of_all, found] if self._waits_of_all else [found])

    @property
    def waits_of_all(self) -> Waits | None:
        """The waits in all counted cycles, or None before the first ones."""
        return self._waits_of_all

    def waits(self, most: int, first: int = 0, last: int | None = None) -> list[Waits]:
        """Return the latest counts of waits, at most `most`, the oldest first; older ones are coarser in a long run.

        Counts that end before the cycle `first` or begin after the cycle `last` are omitted.
        """
        with self._lock:
            latest = reversed(self._waits)
            found = [
                *islice((item for item in latest if item.end > first and (last is None or item.first <= last)), most)
            ]
        return found[::-1]

    def waits_during(self, seen: Seen, most: int) -> Waits | None:
        """Return the waits in the cycles from a response's cause to the response, as far as known.

        At most `most` counts are summed.
        """
        if seen.cycles is None or seen.number < self._first_of_cycles:
            return None
        first, last = seen.cycles
        if seen.latency.cycles is not None:
            first = last - seen.latency.cycles
        return Waits.of(self.waits(most, first, last))

    def since(self, number: int, most: int) -> News:
        """Return the newest messages after the one with this number, at most `most`; -1 is before the first."""
        with self._lock:
            new = self._next - 1 - number
            taken = max(0, min(new, most, len(self._messages)))
            return News(tuple(self._last(taken)), max(0, new - taken), self._next - 1)

    def find(self, number: int) -> Seen | None:
        """Return the message with a number, or None if it is not in the record (any more)."""
        with self._lock:
            return self._messages[number - self.first] if self.first <= number < self._next else None

    def before(self, number: int, most: int) -> list[Seen]:
        """Return the messages of the record before the one with this number, at most `most` of the latest."""
        with self._lock:
            first, end = self.first, min(number, self._next)
            return [self._messages[index - first] for index in range(max(first, end - most), end)]

    def of(self, block: str, most: int, last: int | None = None) -> list[Seen]:
        """Return the latest messages of a block in the record, at most `most`, the oldest first.

        Messages after the number `last` are omitted.
        """
        with self._lock:
            latest = reversed(self._messages)
            own = (seen for seen in latest if seen.block == block and (last is None or seen.number <= last))
            found = [*islice(own, most)]
        return found[::-1]

    @property
    def first(self) -> int:
        """The number of the oldest message in the record."""
        return self._next - len(self._messages)

    def counts(self) -> dict[str, Count]:
        """Return the counts of all blocks with recorded messages."""
        with self._lock:
            found = {block: (item, [*item.cycles], [*item.wall_ns]) for block, item in self._counts.items()}
            return {
                block: Count(item.messages, item.bytes, Percentiles.of(cycles), Percentiles.of(wall_ns))
                for block, (item, cycles, wall_ns) in found.items()
            }

    def loads(self) -> Mapping[str, Load]:
        """Return the loads of the inputs, by block."""
        return self._loads()

    def _last(self, count: int) -> Iterator[Seen]:
        """Yield the newest messages, the oldest of them first; the deque is fast at its ends only."""
        found: list[Seen] = []
        for seen in reversed(self._messages):
            if len(found) == count:
                break
            found.append(seen)
        yield from reversed(found)


class Control:
    """A valve for messages: closed, it lets single messages pass. Any thread may call its methods."""

    def __init__(self) -> None:
        """Begin with the valve open."""
        self._changed = threading.Condition()
        self._is_open, self._is_over = True, False
        self._singles = 0

    @property
    def is_open(self) -> bool:
        """Whether messages pass."""
        return self._is_open

    def passes(self) -> bool:
        """Wait until a message may pass; return False if no more messages may."""
        with self._changed:
            self._changed.wait_for(lambda: self._is_over or self._is_open or self._singles)
            if not self._is_open and self._singles:
                self._singles -= 1
            return not self._is_over

    def wait(self, seconds: float) -> None:
        """Wait for a time, or until the valve is closed or the run ends."""
        with self._changed:
            self._changed.wait_for(lambda: self._is_over or not self._is_open, seconds)

    def pause(self) -> None:
        """Close the valve."""
        self._set(is_open=False)

    def resume(self) -> None:
        """Open the valve."""
        self._set(is_open=True)

    def step(self) -> None:
        """Close the valve, and let one message pass."""
        with self._changed:
            self._singles += 1
        self._set(is_open=False)

    def end(self) -> None:
        """Let no more messages pass."""
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    def _set(self, *, is_open: bool) -> None:
        with self._changed:
            self._is_open = is_open
            if is_open:
                self._singles = 0
            self._changed.notify_all()
