"""The entries of a participant's tables: other participants, their writers and readers that match, and samples.

See participant.py. What has a `slot` is at this place of a table in the hardware.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass, field

from fusesoc_firm.fabric.node import Endpoint
from fusesoc_firm.fabric.rtps import (
    PUBLICATIONS_READER,
    PUBLICATIONS_WRITER,
    SUBSCRIPTIONS_READER,
    SUBSCRIPTIONS_WRITER,
)
from tests.fabric.messages import AckNack, Address, DataFrag, Numbers

# The reader of each of the two writers of discovery.
DISCOVERY = {PUBLICATIONS_WRITER: PUBLICATIONS_READER, SUBSCRIPTIONS_WRITER: SUBSCRIPTIONS_READER}
# The numbers that are asked for at once from a writer of discovery.
WINDOW = 2


@dataclass(frozen=True)
class Limits:
    """The sizes of a node's tables: peers, their writers and readers that match, and bytes of a sample.

    `assembled` are those of a sample in fragments; longer ones are skipped. `waiting` are those of the payloads of a
    packet; a sample that finds no room there is treated as one in fragments.
    """

    peers: int = 8
    sources: int = 32
    sinks: int = 32
    longest: int = 65536
    assembled: int = 65536
    waiting: int = 131072


LARGEST = Limits()


@dataclass
class Window:
    """The numbers that have come from a writer of discovery: all below `expected`. Later ones are not kept.

    `asked` is the number after those that were asked for, of which the hardware has the lowest byte.
    """

    expected: int = 1
    last: int = 0
    is_heard: bool = False
    asked: int = 0

    def take(self, number: int) -> bool:
        """Note a number; whether it is the next one."""
        self.last = max(self.last, number)
        is_next = number == self.expected
        self.expected += is_next
        return is_next

    def begin(self, first: int) -> None:
        """All numbers below `first` are gone."""
        self.expected = max(self.expected, first)

    @property
    def is_behind(self) -> bool:
        """Whether numbers are missing."""
        return self.last >= self.expected

    @property
    def has_answer(self) -> bool:
        """Whether all that was asked for has come."""
        return self.asked == self.expected % 256

    @property
    def is_under_way(self) -> bool:
        """Whether something that was asked for has not come."""
        return 1 <= (self.asked - self.expected) % 256 <= WINDOW

    def ask(self) -> Numbers:
        """The numbers to ask for."""
        most = 1 if self.is_under_way else WINDOW
        end = max(self.expected, min(self.last + 1, self.expected + most))
        self.asked = end % 256
        return Numbers.of(range(self.expected, end), self.expected)


@dataclass
class Peer:
    """Another participant: where it listens, the seconds of its lease, and the state of discovery between the two."""

    slot: int
    prefix: bytes
    metatraffic: Address
    user: Address
    lease: int
    left: int
    windows: dict[bytes, Window] = field(default_factory=lambda: {writer: Window() for writer in DISCOVERY})
    acknowledged: set[bytes] = field(default_factory=set)
    next_request: int = 0
    next_heartbeat: int = 0


@dataclass
class Assembly:
    """A sample whose fragments come in order: the next one is `fragment`."""

    source: Source
    number: int
    size: int
    fragment_bytes: int
    touched: int
    data: bytearray = field(default_factory=bytearray)
    fragment: int = 1

    def is_of(self, source: Source, number: int) -> bool:
        """Whether it is the sample of this writer with this number."""
        return self.source is source and self.number == number

    def take(self, item: DataFrag, now: int) -> None:
        """Take fragments that are the next ones, and end with a whole one."""
        if (item.first, item.fragment_bytes, item.size) != (self.fragment, self.fragment_bytes, self.size):
            return
        left = self.size - len(self.data)
        part = item.payload[: min(item.count * item.fragment_bytes, left)]
        count, more = divmod(len(part), self.fragment_bytes)
        if part and (not more or len(part) == left):
            self.data += part
            self.fragment += count + bool(more)
            self.touched = now

    @property
    def is_whole(self) -> bool:
        """Whether all has come."""
        return len(self.data) == self.size

    def missing(self, most: int) -> Numbers:
        """The next fragments."""
        left = -(-(self.size - len(self.data)) // self.fragment_bytes)
        return Numbers.of(range(self.fragment, self.fragment + min(left, most)), self.fragment)


@dataclass
class Match:
    """An endpoint of a peer that one of the node matches."""

    slot: int
    peer: Peer
    entity: bytes

    def is_of(self, peer: Peer, entity: bytes) -> bool:
        """Whether it is this endpoint of a peer."""
        return self.peer is peer and self.entity == entity


@dataclass
class Source(Match):
    """A peer's writer that a reader of the node matches; `expected` is the next number to take."""

    endpoint: Endpoint
    address: Address
    expected: int = 1
    last: int = 0
    is_heard: bool = False
    requested: int = 0
    asked: int = 0  # the fragment after those that were asked for, or 0
    next_request: int = 0
    patience: int = 0  # ms to the next request for the same number
    before: int = 1  # `expected` when the packet began

    @property
    def is_reliable(self) -> bool:
        """Whether the reader asks for what it lacks."""
        return self.endpoint.quality.is_reliable

    def is_next(self, number: int) -> bool:
        """Whether it is known before the end of the packet that the reader takes a sample."""
        return number == self.before if self.is_reliable else number >= self.before

    def advance(self, expected: int) -> None:
        """Expect a higher number."""
        self.expected = max(self.expected, expected)


@dataclass
class History:
    """A writer of the node with its last samples."""

    endpoint: Endpoint
    number: int = 0
    samples: OrderedDict[int, bytes] = field(default_factory=OrderedDict)

    def add(self, payload: bytes) -> None:
        """Keep a sample, and no more than the topic's depth."""
        self.number += 1
        self.samples[self.number] = payload
        while len(self.samples) > self.endpoint.quality.depth:
            self.samples.popitem(last=False)


@dataclass
class Sink(Match):
    """A peer's reader that matches a writer of the node: it gets samples from `start` on, and has those below.

    Until a reader has heard a heartbeat, it may drop all samples, and then skip those that its first heartbeat tells
    of. Cyclone DDS does so. Thus heartbeats tell of no sample until the reader has answered one.
    """

    history: History
    address: Address
    is_reliable: bool
    start: int
    is_heard: bool = False
    acknowledged: int = 0
    next_heartbeat: int = 0
    next_count: int = 0  # the least one of its next request for fragments

    @property
    def endpoint(self) -> Endpoint:
        """The writer that it matches."""
        return self.history.endpoint

    @property
    def first(self) -> int:
        """The first number that it can get."""
        return max(self.start, next(iter(self.history.samples), self.history.number + 1))

    @property
    def told(self) -> tuple[int, int]:
        """The first and the last number in a heartbeat."""
        return (self.first, self.history.number) if self.is_heard else (self.start, self.start - 1)

    @property
    def is_behind(self) -> bool:
        """Whether it has not acknowledged all samples."""
        return not self.is_heard or self.acknowledged <= self.history.number

    def answer(self, item: AckNack) -> None:
        """Note what it has. A request for a heartbeat alone, which comes before the first one, acknowledges nothing."""
        is_request = not item.is_final and not item.missing.size and item.missing.base <= max(1, self.start - 1)
        self.is_heard = self.is_heard or not is_request
        if self.is_heard:
            self.acknowledged = item.missing.base


def free_slot(items: Iterable[Peer | Match]) -> int:
    """The lowest number of an entry that is not used."""
    used = {item.slot for item in items}
    return next(number for number in range(len(used) + 1) if number not in used)
