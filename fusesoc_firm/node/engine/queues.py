"""Frames to the hardware: a queue for each subscriber, and a policy (docs/reference/host-queues.md).

    queues = SubscriberQueues(subscribers=3, capacity=10)          # least recently used
    queues.put(subscriber, frame)                                  # any thread, such as a callback of the middleware
    for subscriber, frame in queues:                               # the thread that owns the DMA, until `close`
        send(frame)

The source is section 6.3.3, figure 6.4b. With a single queue, the default of a middleware, each subscriber would wait
for all earlier frames. The policies are the same as for the hardware's schedulers, but non-preemptive, because the host
sends whole frames in a single stream. `cpp/firm/queues.hpp` is the C++ version.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from threading import Condition
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Policy(ABC):
    """The rule that chooses the next subscriber: the smallest key wins; among equal keys, the lowest index wins."""

    @abstractmethod
    def key(self, subscriber: int, arrival: int) -> int:
        """Return the key of a subscriber whose first queued frame arrived at `arrival` (in ns)."""

    def served(self, subscriber: int) -> None:  # noqa: B027  (most policies ignore it)
        """Record that a frame of this subscriber was read from its queue."""


class FixedPriority(Policy):
    """A policy that serves the lowest index first."""

    def key(self, subscriber: int, arrival: int) -> int:
        """Return the index."""
        return subscriber


class RoundRobin(Policy):
    """A policy that serves the indices in turn, beginning with index 0."""

    def __init__(self, subscribers: int) -> None:
        self._subscribers = subscribers
        self._first = 0

    def key(self, subscriber: int, arrival: int) -> int:
        """Return the distance from the index whose turn it is to this index."""
        return (subscriber - self._first) % self._subscribers

    def served(self, subscriber: int) -> None:
        """Pass the turn to the next index."""
        self._first = (subscriber + 1) % self._subscribers


class LeastRecentlyUsed(Policy):
    """A policy that serves the subscriber served least recently (section 4.2.1); at first, the lowest index.

    A subscriber waits for at most `subscribers` - 1 others.
    """

    def __init__(self, subscribers: int) -> None:
        self._served_at = [-1] * subscribers
        self._now = 0

    def key(self, subscriber: int, arrival: int) -> int:
        """Return the time when the subscriber was last served, counted in frames."""
        return self._served_at[subscriber]

    def served(self, subscriber: int) -> None:
        """Record the subscriber as the most recently used."""
        self._served_at[subscriber] = self._now
        self._now += 1


class EarliestDeadlineFirst(Policy):
    """A policy that serves the frame with the earliest deadline: its arrival time plus a relative deadline."""

    def __init__(self, deadlines: Sequence[int]) -> None:
        """Set each subscriber's relative deadline, in ns."""
        self._deadlines = tuple(deadlines)

    def key(self, subscriber: int, arrival: int) -> int:
        """Return the absolute deadline."""
        return arrival + self._deadlines[subscriber]


class LeastSlackTime(Policy):
    """A policy that serves the frame with the least slack: the time until the deadline minus the transfer time."""

    def __init__(self, deadlines: Sequence[int], transfer_times: Sequence[int]) -> None:
        """Set each subscriber's relative deadline and transfer time, in ns."""
        pairs = zip(deadlines, transfer_times, strict=True)
        self._latest_starts = tuple(deadline - transfer for deadline, transfer in pairs)

    def key(self, subscriber: int, arrival: int) -> int:
        """Return the latest start time, which orders subscribers like their slack, since all share the current time."""
        return arrival + self._latest_starts[subscriber]


class Overflow(Enum):
    """The action of `put` when a queue is full."""

    DROP_OLDEST = "drop_oldest"  # the queue keeps the latest items, like KEEP_LAST in ROS
    DROP_NEWEST = "drop_newest"  # the queue is unchanged
    BLOCK = "block"  # `put` waits for room


class ClosedError(Exception):
    """The queues are closed; to a reader, they are also empty."""


class EmptyError(Exception):
    """No frame arrived in time."""


class SubscriberQueues(Generic[Item]):
    """Bounded queues, one for each subscriber, that are read like one queue.

    Any number of threads may read and write.
    """

    def __init__(
        self,
        subscribers: int,
        capacity: int | Sequence[int | None],
        policy: Policy | None = None,
        overflow: Overflow = Overflow.DROP_OLDEST,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Create queues; the default `policy` is least recently used; `clock` returns ns.

        `capacity` is the number of frames of each subscriber, or the numbers of all; None: no limit.
        """
        capacities: list[int | None] = [capacity] * subscribers if isinstance(capacity, int) else [*capacity]
        if (
            subscribers < 1
            or len(capacities) != subscribers
            or any(each is not None and each < 1 for each in capacities)
        ):
            raise ValueError(f"subscribers is {subscribers}, capacity is {capacity}; legal: 1 or more")
        self._policy = policy or LeastRecentlyUsed(subscribers)
        self._capacities = capacities
        self._overflow = overflow
        self._clock = clock
        self._shared: dict[int, int] = {}
        # Each item with its arrival and its subscriber.
        self._queues: list[deque[tuple[int, int, Item]]] = [deque() for _ in range(subscribers)]
        self._waiting = [0] * subscribers
        self._dropped = [0] * subscribers
        self._closed = False
        self._changed = Condition()

    def share(self, subscriber: int, other: int) -> None:
        """Let two subscribers share a queue, so that their items are read in the order of arrival.

        Each of them keeps its own capacity. This is called before the first item.
        """
        self._shared[subscriber] = other

    def put(self, subscriber: int, item: Item, timeout: float | None = None) -> bool:
        """Add an item; return whether it is queued.

        The item is not queued if a full queue drops the newest item, or stays full for `timeout` seconds (None: no
        limit). Raise `ClosedError` if the queues are closed, even during the wait, and `IndexError` for an unknown
        subscriber.
        """
        if not 0 <= subscriber < len(self._queues):
            raise IndexError(f"subscriber is {subscriber}; legal: 0 to {len(self._queues) - 1}")
        queue, capacity = self._queues[self._queue_of(subscriber)], self._capacities[subscriber]
        with self._changed:
            if self._overflow is Overflow.BLOCK:
                self._changed.wait_for(lambda: self._closed or self._waiting[subscriber] != capacity, timeout)
            if self._closed:
                raise ClosedError("the queues are closed")
            if self._waiting[subscriber] == capacity:
                self._dropped[subscriber] += self._overflow is not Overflow.BLOCK
                if self._overflow is not Overflow.DROP_OLDEST:
                    return False
                del queue[next(place for place, (_, owner, _) in enumerate(queue) if owner == subscriber)]
                self._waiting[subscriber] -= 1
            queue.append((self._clock(), subscriber, item))
            self._waiting[subscriber] += 1
            self._changed.notify_all()
            return True

    def get(self, timeout: float | None = None) -> tuple[int, Item]:
        """Return the next subscriber and its first item; wait at most `timeout` seconds (None: no limit).

        Raise `EmptyError` on timeout, and `ClosedError` when the queues are closed and empty.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._closed or any(self._queues), timeout)
            waiting = [index for index, queue in enumerate(self._queues) if queue]
            if not waiting:
                if self._closed:
                    raise ClosedError("the queues are closed and empty")
                raise EmptyError(f"no frame arrived in {timeout} s")
            served = min(waiting, key=lambda index: self._policy.key(index, self._queues[index][0][0]))
            _, subscriber, item = self._queues[served].popleft()
            self._waiting[subscriber] -= 1
            self._policy.served(served)
            self._changed.notify_all()
            return subscriber, item

    def __iter__(self) -> Iterator[tuple[int, Item]]:
        """Yield the results of `get` until the queues are closed and empty."""
        while True:
            try:
                found = self.get()
            except ClosedError:
                return
            yield found

    def close(self) -> None:
        """Accept no more items, and wake all waiting threads; queued items can still be read."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def pass_by(self, subscriber: int) -> None:
        """Record that an item of a subscriber was served without a queue."""
        with self._changed:
            self._policy.served(self._queue_of(subscriber))

    def dropped_by_first(self, subscribers: int) -> int:
        """Return the number of items of the first subscribers that were dropped together."""
        with self._changed:
            return sum(self._dropped[:subscribers])

    def waiting(self, subscriber: int) -> int:
        """Return the number of a subscriber's items that wait."""
        with self._changed:
            return self._waiting[subscriber]

    def dropped(self, subscriber: int) -> int:
        """Return the number of a subscriber's items that were dropped."""
        with self._changed:
            return self._dropped[subscriber]

    def _queue_of(self, subscriber: int) -> int:
        return self._shared.get(subscriber, subscriber)
