"""Frames to the hardware: a queue for each subscriber, and a policy (docs/reference/host-queues.md).

    queues = SubscriberQueues(subscribers=3, capacity=10)          # least recently used
    queues.put(subscriber, frame)                                  # any thread, a middleware's callback
    for subscriber, frame in queues:                               # the thread that owns the DMA, until `close`
        send(frame)

Section 6.3.3, figure 6.4b. One queue for all, as a middleware has by default, lets a subscriber wait for all that came
before. The policies are those of the hardware's schedulers, non-preemptive, as the host's stream has one order. The
same in C++ is `firm/queues.hpp` in the folder `cpp` beside this file.
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
    """Which subscriber goes next: the one whose first frame has the smallest key, of equal ones the lowest index."""

    @abstractmethod
    def key(self, subscriber: int, arrival: int) -> int:
        """The key of a subscriber whose first frame came at `arrival` (ns)."""

    def served(self, subscriber: int) -> None:  # noqa: B027  (most policies need not know)
        """Hear that a subscriber's frame was handed out."""


class FixedPriority(Policy):
    """The lowest index first."""

    def key(self, subscriber: int, arrival: int) -> int:
        """The index."""
        return subscriber


class RoundRobin(Policy):
    """The next index behind the one served last, cyclic; index 0 at first."""

    def __init__(self, subscribers: int) -> None:
        self._subscribers = subscribers
        self._first = 0

    def key(self, subscriber: int, arrival: int) -> int:
        """How far the index is from the one whose turn it is."""
        return (subscriber - self._first) % self._subscribers

    def served(self, subscriber: int) -> None:
        """The turn goes on."""
        self._first = (subscriber + 1) % self._subscribers


class LeastRecentlyUsed(Policy):
    """The one that was served the longest time ago (section 4.2.1); at first, the lowest index.

    A subscriber waits for at most `subscribers` - 1 others.
    """

    def __init__(self, subscribers: int) -> None:
        self._served_at = [-1] * subscribers
        self._now = 0

    def key(self, subscriber: int, arrival: int) -> int:
        """When it was served last, counted in frames."""
        return self._served_at[subscriber]

    def served(self, subscriber: int) -> None:
        """It is the one used most recently."""
        self._served_at[subscriber] = self._now
        self._now += 1


class EarliestDeadlineFirst(Policy):
    """The one whose first frame has the earliest deadline: its arrival and the subscriber's relative deadline."""

    def __init__(self, deadlines: Sequence[int]) -> None:
        """The relative deadlines, ns."""
        self._deadlines = tuple(deadlines)

    def key(self, subscriber: int, arrival: int) -> int:
        """The absolute deadline."""
        return arrival + self._deadlines[subscriber]


class LeastSlackTime(Policy):
    """The one whose first frame has the least slack: the time until its deadline less the time of its transfer."""

    def __init__(self, deadlines: Sequence[int], transfer_times: Sequence[int]) -> None:
        """The relative deadlines and the times of a transfer, ns; as many of one as of the other."""
        pairs = zip(deadlines, transfer_times, strict=True)
        self._latest_starts = tuple(deadline - transfer for deadline, transfer in pairs)

    def key(self, subscriber: int, arrival: int) -> int:
        """The latest time to start; it is the slack but for the present time, which is everybody's."""
        return arrival + self._latest_starts[subscriber]


class Overflow(Enum):
    """What `put` does with a frame for a queue that is full."""

    DROP_OLDEST = "drop_oldest"  # the queue keeps the latest, as ROS' KEEP_LAST
    DROP_NEWEST = "drop_newest"  # the queue stays as it is
    BLOCK = "block"  # it waits until there is room


class ClosedError(Exception):
    """The queues are closed; to a reader: and empty."""


class EmptyError(Exception):
    """No frame came in the time given."""


class SubscriberQueues(Generic[Item]):
    """Bounded queues, one a subscriber, read as one. Any number of threads may write and read."""

    def __init__(
        self,
        subscribers: int,
        capacity: int,
        policy: Policy | None = None,
        overflow: Overflow = Overflow.DROP_OLDEST,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """`capacity` frames each; `policy` is least recently used if it is None; `clock` gives ns."""
        if subscribers < 1 or capacity < 1:
            raise ValueError(f"subscribers is {subscribers}, capacity is {capacity}; legal: 1 and more")
        self._policy = policy or LeastRecentlyUsed(subscribers)
        self._capacity = capacity
        self._overflow = overflow
        self._clock = clock
        self._queues: list[deque[tuple[int, Item]]] = [deque() for _ in range(subscribers)]
        self._dropped = [0] * subscribers
        self._closed = False
        self._changed = Condition()

    def put(self, subscriber: int, item: Item, timeout: float | None = None) -> bool:
        """Add an item; whether it is in its queue now.

        It is not if it was the newest one to drop, or if there was no room for `timeout` seconds (None: for ever).
        Raises `ClosedError`, also while it waits, and `IndexError` for a subscriber that there is not.
        """
        if not 0 <= subscriber < len(self._queues):
            raise IndexError(f"subscriber is {subscriber}; legal: 0 to {len(self._queues) - 1}")
        queue = self._queues[subscriber]
        with self._changed:
            if self._overflow is Overflow.BLOCK:
                self._changed.wait_for(lambda: self._closed or len(queue) < self._capacity, timeout)
            if self._closed:
                raise ClosedError("the queues are closed")
            if len(queue) == self._capacity:
                self._dropped[subscriber] += self._overflow is not Overflow.BLOCK
                if self._overflow is not Overflow.DROP_OLDEST:
                    return False
                queue.popleft()
            queue.append((self._clock(), item))
            self._changed.notify_all()
            return True

    def get(self, timeout: float | None = None) -> tuple[int, Item]:
        """The subscriber that is next, and its first item; waits at most `timeout` seconds (None: for ever).

        Raises `EmptyError` when the time is over, and `ClosedError` when all is read and nothing can come any more.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._closed or any(self._queues), timeout)
            waiting = [index for index, queue in enumerate(self._queues) if queue]
            if not waiting:
                if self._closed:
                    raise ClosedError("the queues are closed and empty")
                raise EmptyError(f"no frame came in {timeout} s")
            subscriber = min(waiting, key=lambda index: self._policy.key(index, self._queues[index][0][0]))
            _, item = self._queues[subscriber].popleft()
            self._policy.served(subscriber)
            self._changed.notify_all()
            return subscriber, item

    def __iter__(self) -> Iterator[tuple[int, Item]]:
        """What `get` gives, until the queues are closed and all is read."""
        while True:
            try:
                found = self.get()
            except ClosedError:
                return
            yield found

    def close(self) -> None:
        """Take no more; what is there can still be read. Wakes everybody who waits."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def dropped(self, subscriber: int) -> int:
        """How many items of a subscriber were dropped."""
        with self._changed:
            return self._dropped[subscriber]
