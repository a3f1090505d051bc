"""Trace each message through a system: record the time of each stage, in simulated time and by the wall clock.

    trace = Trace(path, description)
    ...                                        # the node reports its events
    trace.close()

A row is a message from a subscriber to a publisher. A publisher's n-th message belongs to the n-th message of each
subscriber that feeds the publisher's block; the row describes the latest of these messages. This rule is valid for
accelerators that respond to every message with one message. Steps in software before and after the hardware have
separate rows.
"""

from __future__ import annotations

import csv
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from threading import RLock
from time import monotonic_ns
from typing import TextIO

from fusesoc_firm.node.interface.description import NodeDescription, converter_names
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import check_output

WALL_TIMES = ("received_ns", "queued_ns", "sent_ns", "came_ns", "published_ns")
# The number of messages that wait for a response, if no table is written.
_MOST_PENDING = 10_000
CYCLES = ("first_beat_in_cycle", "last_beat_in_cycle", "first_beat_out_cycle", "last_beat_out_cycle")
COLUMNS = (
    *("message", "subscriber", "publisher", "bytes_in", "bytes_out"),
    *WALL_TIMES,
    *CYCLES,
    *("input_cycles", "accelerator_cycles", "output_cycles", "hardware_ns"),
)


@dataclass
class Entry:
    """A message on its route to the hardware; times are in ns of the system's monotonic clock."""

    subscriber: int
    size: int
    received_ns: int
    queued_ns: int
    sent_ns: int | None = None
    cycles: tuple[int, int] | None = None
    number: int = -1
    is_answered: bool = False
    seen: int | None = None
    """the number in the record of a `Watch`"""


@dataclass
class _Answer:
    """A message from the hardware, with the message that caused the response."""

    entry: Entry | None
    publisher: int
    size: int
    cycles: tuple[int, int] | None
    came_ns: int


@dataclass
class _Ways:
    """Messages in transit: to the hardware, within the hardware to each publisher, and to each topic."""

    untaken: deque[Entry | None] = field(default_factory=deque)
    pending: dict[tuple[int, int], deque[Entry]] = field(default_factory=dict)
    unpublished: dict[int, deque[_Answer]] = field(default_factory=dict)


class Trace:
    """The writer of the table; any thread may report events. Times count from the creation of the `Trace`."""

    def __init__(
        self,
        path: Path | None,
        description: NodeDescription,
        clock: Callable[[], int] = monotonic_ns,
        report: Callable[[str], None] = print,
    ) -> None:
        """Create the file at `path`; `clock` returns the time in ns. May raise `InputError`.

        If the file cannot be written later, such as on a full disk, the trace ends with a message to `report`.

        Without a path, nothing is written, and the messages that wait for a response are bounded: the oldest are
        dropped.
        """
        self._file = _created(path) if path else None
        self._most = None if path else _MOST_PENDING
        self._report = report
        self._write_row(COLUMNS)
        self._description = description
        self._subscribers, self._publishers = converter_names(description)
        self._reached: dict[int, list[int]] = {}
        for publisher, subscribers in enumerate(description.sources):
            for subscriber in subscribers:
                self._reached.setdefault(subscriber, []).append(publisher)
        self._ways = _Ways(deque(maxlen=self._most))
        self._numbers = count()
        self._lock = RLock()
        self._clock = clock
        self._start = clock()

    def sending(self, entry: Entry) -> None:
        """Record that a message is being sent to the hardware."""
        with self._lock:
            entry.number = next(self._numbers)
            self._ways.untaken.append(entry)
            for publisher in self._reached.get(entry.subscriber, ()):
                self._ways.pending.setdefault((entry.subscriber, publisher), deque(maxlen=self._most)).append(entry)

    def sending_other(self) -> None:
        """Record that a frame other than a message is being sent to the hardware."""
        with self._lock:
            self._ways.untaken.append(None)

    def sent(self, entry: Entry) -> None:
        """Record that the hardware, or a bounded buffer before it, has the message."""
        entry.sent_ns = self._clock()

    def taken(self, first_cycle: int, last_cycle: int) -> None:
        """Record that simulated hardware accepted the next sent message."""
        with self._lock:
            entry = self._ways.untaken.popleft() if self._ways.untaken else None
            if entry:
                entry.cycles = (first_cycle, last_cycle)

    def refused(self, subscriber: int) -> None:
        """Record that the hardware rejected the last frame accepted for a subscriber, and will not respond."""
        with self._lock:
            for publisher in self._reached.get(subscriber, ()):
                queue = self._ways.pending.get((subscriber, publisher))
                taken = [entry for entry in queue or () if entry.cycles] or [*(queue or ())][:1]
                if queue and taken:
                    queue.remove(taken[-1])

    def came(self, publisher: int, size: int, cycles: tuple[int, int] | None, *, is_published: bool) -> Entry | None:
        """Record a message from the hardware, which goes to a topic if `is_published` is set, otherwise to software.

        Return the message that caused it, if known.
        """
        with self._lock:
            answer = _Answer(self._cause(publisher), publisher, size, cycles, self._clock())
            if not is_published:
                self._write(answer.entry, answer, None)
            elif self._file:
                self._ways.unpublished.setdefault(publisher, deque()).append(answer)
            return answer.entry

    def published(self, publisher: int, time_ns: int) -> None:
        """Record that the middleware has published the next message of a publisher."""
        with self._lock:
            if answers := self._ways.unpublished.get(publisher):
                answer = answers.popleft()
                self._write(answer.entry, answer, time_ns)

    def forget(self) -> None:
        """Record that the hardware was reset and has lost its messages."""
        with self._lock:
            self._write_rest()
            self._ways = _Ways(deque(maxlen=self._most))

    def close(self) -> None:
        """Write the messages without a response, and close the file."""
        with self._lock:
            self._write_rest()
            if self._file:
                try:
                    self._file.close()
                except OSError as error:
                    self._give_up(error)

    def _cause(self, publisher: int) -> Entry | None:
        queues = [self._ways.pending.get((source, publisher)) for source in self._description.sources[publisher]]
        entries = [queue.popleft() for queue in queues if queue]
        for entry in entries:
            entry.is_answered = True
        return max(entries, key=lambda entry: entry.number, default=None)

    def _write_rest(self) -> None:
        for answers in self._ways.unpublished.values():
            for answer in answers:
                self._write(answer.entry, answer, None)
        rest = {entry.number: entry for queue in self._ways.pending.values() for entry in queue}
        for _, entry in sorted(rest.items()):
            if not entry.is_answered:
                self._write(entry, None, None)

    def _write(self, entry: Entry | None, answer: _Answer | None, published_ns: int | None) -> None:
        if not self._file:
            return
        came = answer.came_ns if answer else None
        times = (entry.received_ns, entry.queued_ns, entry.sent_ns) if entry else (None,) * 3
        inwards = (entry.cycles if entry else None) or (None, None)
        outwards = (answer.cycles if answer else None) or (None, None)
        self._write_row(
            (
                entry.number if entry else None,
                self._subscribers[entry.subscriber] if entry else None,
                self._publishers[answer.publisher] if answer else None,
                entry.size if entry else None,
                answer.size if answer else None,
                *(None if time is None else time - self._start for time in (*times, came, published_ns)),
                *inwards,
                *outwards,
                *self._differences((*inwards, *outwards)),
            )
        )

    def _write_row(self, row: Iterable[object]) -> None:
        if self._file:
            try:
                csv.writer(self._file, lineterminator="\n").writerow(row)
            except OSError as error:
                self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        """Write no more rows, since a node is worth more than its trace."""
        if self._file:
            with suppress(OSError):
                self._file.close()
            self._report(f"the trace ends, since {self._file.name} cannot be written: {error.strerror}")
            self._file = None

    def _differences(self, cycles: Iterable[int | None]) -> tuple[float | None, ...]:
        """Return the cycles between successive beats, and the time from the first beat to the last."""
        first_in, last_in, first_out, last_out = cycles
        whole = _minus(last_out, first_in)
        clock = self._description.clock_hz
        nanoseconds = None if whole is None or not clock else round(whole * 1e9 / clock, 3)
        return _minus(last_in, first_in), _minus(first_out, last_in), _minus(last_out, first_out), nanoseconds


def _created(path: Path) -> TextIO:
    check_output(path)
    try:
        return path.open("w", newline="", encoding="utf-8")
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")


def _minus(later: int | None, earlier: int | None) -> int | None:
    return None if later is None or earlier is None else later - earlier
