"""The model of firm_sched_engine and its parts, for the policies that keep their tasks in a priority queue.

Keys and times are numbers that never wrap around. State that exists once per scheduler is an array of shape (B,). The
simulation of a cycle costs some dozens of operations on such arrays, and one operation on the requests (B, N).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Ints, Scheduler

_NOBODY = np.iinfo(np.int64).max
_SHORTEST_TIME, _LONGEST_TIME = 8, 31  # bits


def index_bits(requesters: int) -> int:
    """Return the number of bits in an index, at least 1, like the function with this name in firm_axis_pkg."""
    return max(1, (requesters - 1).bit_length())


def rows_and_columns(requesters: int) -> tuple[int, int]:
    """Return the numbers of rows and columns of requesters, like the functions in firm_sched_queue_pkg."""
    bits = index_bits(requesters)
    column_bits = max(1, bits // 2)
    rows: int = 2 ** max(1, bits - column_bits)
    return rows, 2**column_bits


class Arrivals:
    """The model of firm_sched_arrivals, which accepts tasks row by row; `valid` and `first` describe the next task."""

    def __init__(self, batch: int, requesters: int) -> None:
        self._rows, self._columns = rows_and_columns(requesters)
        self._requesters = requesters
        self._members = np.arange(batch)
        # The bit of each column in a row, the first column lowest.
        self._known: Ints = np.zeros((batch, self._rows), np.int64)
        self._accepted: Ints = np.zeros(batch, np.int64)
        self._row: Ints = np.full(batch, self._rows - 1, np.int64)
        # The row that is read when all accepted tasks have left, and whether it had a request when it was found.
        self._next_row: Ints = np.zeros(batch, np.int64)
        self._asked: Bools = np.zeros(batch, np.bool_)
        self._clearing = self._rows
        self._weights = 1 << np.arange(self._columns)
        self._lowest = np.array([(value & -value).bit_length() - 1 for value in range(2**self._columns)])
        self._padded: Bools = np.zeros((batch, self._rows * self._columns), np.bool_)

    @property
    def valid(self) -> Bools:
        """Whether an accepted task waits to leave, shape (B,)."""
        valid: Bools = self._accepted != 0
        return valid

    @property
    def first(self) -> Ints:
        """The requester of the next task, shape (B,); arbitrary where `valid` is false."""
        first: Ints = np.where(self.valid, self._row * self._columns + self._lowest[self._accepted], 0)
        return first

    def step(self, request: Bools, leaves: Bools, finished: Bools, finished_id: Ints) -> None:
        """Simulate a rising edge; where `finished` is true, forget the task of requester `finished_id`."""
        finished_row = finished_id // self._columns
        finished_bit = np.where(finished, 1 << (finished_id % self._columns), 0)
        of_row = np.where(self._row == finished_row, finished_bit, 0)
        staying: Ints = np.where(leaves, self._accepted & (self._accepted - 1), self._accepted)
        accepted: Ints = np.bitwise_and(staying, np.invert(of_row))
        self._known[self._members, finished_row] &= ~finished_bit
        if self._clearing:
            self._clearing -= 1
        else:
            self._accept(request, self._accepted == 0, accepted, finished_row, finished_bit)
        self._accepted = accepted

    def _accept(self, request: Bools, where: Bools, accepted: Ints, finished_row: Ints, finished_bit: Ints) -> None:
        """Accept the next row's new requests into `accepted` where no accepted task is left, and find the row after."""
        self._padded[:, : self._requesters] = request
        by_row: Bools = self._padded.reshape((len(request), self._rows, self._columns))
        row = self._next_row
        new = by_row[self._members, row] @ self._weights
        new &= ~self._known[self._members, row]
        # The request of a requester that finishes belongs to the task's last beat.
        new &= ~np.where(row == finished_row, finished_bit, 0)
        self._known[self._members, row] |= np.where(where, new, 0)
        self._row = np.where(where, row, self._row)
        accepted[where] = new[where]
        self._find_row(np.logical_or.reduce(by_row, axis=2), where | ~self._asked)

    def _find_row(self, asks: Bools, where: Bools) -> None:
        """Move to the next row with a request in `asks` (B, rows), if there is one."""
        found = asks.any(axis=1)
        # The rows in cyclic order, starting after the next one.
        order = (self._next_row[:, np.newaxis] + 1 + np.arange(self._rows)) % self._rows
        row = order[self._members, np.take_along_axis(asks, order, axis=1).argmax(axis=1)]
        self._next_row = np.where(where & found, row, self._next_row)
        self._asked = np.where(where, found, self._asked)


class Queue(ABC):
    """A priority queue of items with distinct indices; `root_*` and `ready` apply to the current cycle.

    While the next root is not yet available, `root_id` and `root_key` already describe it, like first_id and first_key
    of the core, and `pop` removes it.

    An entry is a rank, key * size + index: the smallest rank has the smallest key and, among equal keys, the lowest
    index.
    """

    def __init__(self, batch: int, items: int) -> None:
        self._size = items
        self._members = np.arange(batch)
        self._ranks: Ints = np.full((batch, items), _NOBODY)
        self._root: Ints = np.full(batch, _NOBODY)
        self.root_valid: Bools = np.zeros(batch, np.bool_)

    @property
    def root_id(self) -> Ints:
        """The index of the root; arbitrary if there is no root."""
        return self._root % self._size

    @property
    def root_key(self) -> Ints:
        """The key of the root; arbitrary if there is no root."""
        return self._root // self._size

    @property
    @abstractmethod
    def first_valid(self) -> Bools:
        """Whether an item can be popped: the root, or the item that becomes the root in this cycle."""

    @property
    @abstractmethod
    def empty(self) -> Bools:
        """Whether the queue has no item, not even a root that is not yet available."""

    @property
    @abstractmethod
    def clearing(self) -> bool:
        """Whether the reset is still in progress; until it ends, the queue accepts no items."""

    @property
    @abstractmethod
    def ready_with_pop(self) -> bool:
        """Whether an item can enter while another item leaves."""

    @abstractmethod
    def ready(self, pop: Bools) -> Bools:
        """Return whether an item can enter in this cycle."""

    @abstractmethod
    def step(self, insert: Bools, index: Ints, key: Ints, pop: Bools) -> None:
        """Simulate a rising edge; `insert` is legal only where `ready` is true, `pop` where `first_valid` is true."""

    def _insert(self, insert: Bools, index: Ints, key: Ints) -> None:
        rank = key * self._size + index
        self._ranks[self._members[insert], index[insert]] = rank[insert]
        self._root = np.where(insert, np.minimum(self._root, rank), self._root)

    def _pop(self, pop: Bools) -> None:
        if pop.any():
            self._ranks[self._members[pop], self.root_id[pop]] = _NOBODY
            self._root[pop] = self._ranks[pop].min(axis=1)


class Heap(Queue):
    """The model of firm_sched_heap, which replaces the root one cycle after a pop, or two after consecutive pops."""

    def __init__(self, batch: int, items: int) -> None:
        super().__init__(batch, items)
        self._filling: Bools = np.zeros(batch, np.bool_)
        # Whether the item that would have replaced the root was popped in the last cycle.
        self._owing: Bools = np.zeros(batch, np.bool_)
        self._clearing: int = 2 ** (index_bits(items) - 1)

    @property
    def first_valid(self) -> Bools:
        """See `Queue`."""
        first_valid: Bools = self.root_valid | (self._filling & (self._root != _NOBODY))
        return first_valid

    @property
    def empty(self) -> Bools:
        """See `Queue`."""
        return ~(self.root_valid | self._filling | self._owing)

    @property
    def clearing(self) -> bool:
        """See `Queue`."""
        return self._clearing > 0

    @property
    def ready_with_pop(self) -> bool:
        """See `Queue`."""
        return False

    def ready(self, pop: Bools) -> Bools:
        """See `Queue`."""
        return ~(pop | self._filling | self._owing | self.clearing)

    def step(self, insert: Bools, index: Ints, key: Ints, pop: Bools) -> None:
        """See `Queue`."""
        self._insert(insert, index, key)
        self._pop(pop)
        fill = (pop & ~self._filling) | self._owing
        self._owing = pop & self._filling
        self._filling = fill
        self.root_valid = ~(fill | self._owing) & (self._root != _NOBODY)
        self._clearing = max(0, self._clearing - 1)


class SortedQueue(Queue):
    """The model of firm_sched_sorted_queue, whose new root is available in the next cycle."""

    @property
    def first_valid(self) -> Bools:
        """See `Queue`."""
        return self.root_valid

    @property
    def empty(self) -> Bools:
        """See `Queue`."""
        return ~self.root_valid

    @property
    def clearing(self) -> bool:
        """See `Queue`."""
        return False

    @property
    def ready_with_pop(self) -> bool:
        """See `Queue`."""
        return True

    def ready(self, pop: Bools) -> Bools:
        """See `Queue`."""
        return np.ones_like(pop)

    def step(self, insert: Bools, index: Ints, key: Ints, pop: Bools) -> None:
        """See `Queue`."""
        self._pop(pop)
        self._insert(insert, index, key)
        self.root_valid = self._root != _NOBODY


class Keys(ABC):
    """The source of the tasks' keys."""

    @abstractmethod
    def read(self, wanted: Bools, index: Ints, finished: Bools) -> tuple[Ints, Bools]:
        """Return the keys of the tasks that leave the arrivals in this cycle, and whether each key is valid."""

    @abstractmethod
    def advance(self, oldest: tuple[tuple[Bools, Ints], ...], is_clearing: bool) -> Bools:
        """Return whether time advances; `oldest` are (valid, key) pairs of the keys that must not become too old."""

    @abstractmethod
    def step(self, advance: Bools, wanted: Bools, finished: Bools, finished_id: Ints) -> None:
        """Simulate a rising edge."""


def check_times(name: str, times: Ints, time_bits: int | None) -> None:
    """Raise `ValueError` if a time does not fit into the bits; `name` describes the times, such as "deadline"."""
    if time_bits is None:
        return
    if not _SHORTEST_TIME <= time_bits <= _LONGEST_TIME:
        raise ValueError(f"time_bits is {time_bits}; legal: {_SHORTEST_TIME} to {_LONGEST_TIME}")
    longest = int(times.max())
    if longest >= 2 ** (time_bits - 3):
        needed = longest.bit_length() + 3
        raise ValueError(f"time_bits is {time_bits}; legal: {needed} or more for a {name} of {longest} cycles")


class Times(Keys):
    """Keys that are the time at which a task leaves the arrivals plus its requester's offset; offsets are (B, N)."""

    def __init__(self, offsets: Ints, time_bits: int | None) -> None:
        self._offsets = offsets
        self._members = np.arange(len(offsets))
        self._time: Ints = np.zeros(len(offsets), np.int64)
        self._eighth = None if time_bits is None else time_bits - 3

    def read(self, wanted: Bools, index: Ints, finished: Bools) -> tuple[Ints, Bools]:
        """See `Keys`."""
        return self._time + self._offsets[self._members, index], np.ones_like(wanted)

    def advance(self, oldest: tuple[tuple[Bools, Ints], ...], is_clearing: bool) -> Bools:
        """See `Keys`."""
        advance: Bools = np.full(len(self._time), not is_clearing)
        if self._eighth is not None:
            for where, key in oldest:
                advance &= ~(where & is_overdue(key, self._time, self._eighth))
        return advance

    def step(self, advance: Bools, wanted: Bools, finished: Bools, finished_id: Ints) -> None:
        """See `Keys`."""
        self._time += advance


def is_overdue(key: Ints, now: Ints, eighth: int) -> Bools:
    """Return whether keys are two eighths of the range before `now`, both truncated to multiples of 2**`eighth`."""
    overdue: Bools = (now >> eighth) - (key >> eighth) >= 2
    return overdue


@dataclass(frozen=True)
class Preemption:
    """The settings of preemption, including whether each beat adds one to the key of the task being sent."""

    shortest_run: int = 1
    sends_own_time: bool = False


class Engine(Scheduler):
    """The model of firm_sched_engine with a policy's queue and keys; non-preemptive if `preemption` is None."""

    def __init__(
        self, batch: int, requesters: int, queue: Queue, keys: Keys, preemption: Preemption | None = None
    ) -> None:
        super().__init__(batch, requesters)
        self._arrivals = Arrivals(batch, requesters)
        self._queue = queue
        self._keys = keys
        self._is_preemptive = preemption is not None
        self._rules = preemption or Preemption()
        nobody: Bools = np.zeros(batch, np.bool_)
        nothing: Ints = np.zeros(batch, np.int64)
        self._b_valid, self._b_id, self._b_key = nobody, nothing, nothing
        self._running, self._keyed, self._key = nobody, nobody, nothing
        self._beats = nothing

    def step(self, request: Bools, beat: Bools, last: Bools) -> None:
        """See `Scheduler`."""
        queue, arrivals, keys = self._queue, self._arrivals, self._keys
        finished = beat & last
        a_valid, a_id = arrivals.valid, arrivals.first
        a_is_own = a_id == self.grant_select
        a_key, key_ready = keys.read(a_valid, a_id, finished)
        empty, root_valid, root_id, root_key = queue.empty, queue.root_valid, queue.root_id, queue.root_key
        advance = keys.advance(((self._running & self._keyed, self._key), (root_valid, root_key)), queue.clearing)

        choose = finished | ~(self._running | beat)
        # If the task can be preempted after a beat, the grant need not wait for a root that is not yet available.
        gives_way = ~queue.first_valid if self._is_preemptive and self._rules.shortest_run == 1 else empty
        take_root = choose & queue.first_valid
        take_b = choose & gives_way & self._b_valid
        take_a = choose & gives_way & ~self._b_valid & a_valid & ~(finished & a_is_own)
        get_key = a_valid & a_is_own & ~choose
        preempt = self._preempt(request, beat, finished, root_valid, root_key)

        pop = take_root | preempt
        insert = self._b_valid & ~take_b & queue.ready(pop)
        b_is_free = ~self._b_valid | take_b | insert
        a_enters_b = a_valid & b_is_free & key_ready & ~(preempt | take_a | (a_is_own & (finished | ~choose)))
        next_key = self._key + (beat & advance) if self._rules.sends_own_time else self._key

        queue.step(insert, self._b_id, self._b_key, pop)
        arrivals.step(request, take_a | get_key | a_enters_b, finished, self.grant_select)
        keys.step(advance, a_valid, finished, self.grant_select)

        b_id, b_key = self._b_id, self._b_key
        self._b_valid = preempt | a_enters_b | ~b_is_free
        self._b_id = np.where(preempt, self.grant_select, np.where(a_enters_b, a_id, b_id))
        self._b_key = np.where(preempt, next_key, np.where(a_enters_b, a_key, b_key))

        given = take_root | take_b | take_a
        self._key = np.where(take_a | get_key, a_key, next_key)
        self._key = np.where(pop, root_key, np.where(take_b, b_key, self._key))
        self.grant_select = np.where(take_a, a_id, self.grant_select)
        self.grant_select = np.where(pop, root_id, np.where(take_b, b_id, self.grant_select))
        self.grant_valid = given | preempt | (self.grant_valid & ~(choose & ~empty))
        self._running = given | ~choose
        self._keyed = given | (~choose & (self._keyed | get_key))
        self._beats = np.where(choose | preempt, 0, np.minimum(self._beats + beat, self._rules.shortest_run))

    def _preempt(self, request: Bools, beat: Bools, finished: Bools, root_valid: Bools, root_key: Ints) -> Bools:
        """Return where the root preempts an unfinished task, shape (B,)."""
        if not self._is_preemptive:
            return np.zeros(self.batch, np.bool_)
        preempt = self._running & self._keyed & root_valid & (root_key < self._key) & ~finished
        if not self._queue.ready_with_pop:
            preempt &= ~self._b_valid
        if self._rules.shortest_run > 1:
            beats = np.minimum(self._beats + beat, self._rules.shortest_run)
            preempt &= (beats == 0) | (beats == self._rules.shortest_run) | ~self._of_granted(request)
        return preempt
