"""Least recently used (section 4.2.1): serve the requester whose last completed task is the oldest."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Generics, Ints, Scheduler
from fusesoc_firm.scheduling.models.choosing import ChoosingScheduler
from fusesoc_firm.scheduling.models.engine import Engine, Heap, Keys, index_bits, rows_and_columns

_NEVER = np.iinfo(np.int64).max


class ImmediateLru(ChoosingScheduler):
    """The non-preemptive scheduler for few requesters; after reset, a lower index counts as less recently used."""

    MAX_REQUESTERS = 16

    def __init__(self, batch: int, requesters: int) -> None:
        super().__init__(batch, requesters)
        # The time of each requester's last completion, counted in completed tasks.
        self._used: Ints = np.tile(np.arange(requesters), (batch, 1))
        self._now = requesters

    def _note_completed(self, finished: Bools) -> None:
        self._used[self._members[finished], self.grant_select[finished]] = self._now
        self._now += 1

    def _choose(self, eligible: Bools) -> Ints:
        choice: Ints = np.where(eligible, self._used, _NEVER).argmin(axis=1)
        return choice


class Stamps(Keys):
    """The model of firm_sched_stamps: the time of each requester's last completion, counted in completions."""

    _QUARTER_BITS = 3  # bits in addition to an index's bits
    _STEPS = 4  # bits of the count for one requester of the sweep

    def __init__(self, batch: int, requesters: int) -> None:
        bits = index_bits(requesters)
        self._size: int = 2**bits
        self._quarter: int = 2 ** (bits + self._QUARTER_BITS)
        self._members = np.arange(batch)
        self._stamps: Ints = np.tile(np.arange(self._size), (batch, 1))
        self._count: Ints = np.full(batch, self._size)
        # The requester that the sweep has reached, its stamp, and whether the stamp has been read.
        self._sweep: Ints = np.zeros(batch, np.int64)
        self._swept: Ints = np.zeros(batch, np.int64)
        self._known: Bools = np.zeros(batch, np.bool_)
        self._steps: Ints = np.zeros(batch, np.int64)
        self._clearing, _ = rows_and_columns(requesters)
        # The completion of the last cycle, which is recorded in this one.
        self._completed: Bools = np.zeros(batch, np.bool_)
        self._completed_id: Ints = np.zeros(batch, np.int64)

    def _reads(self, wanted: Bools) -> Bools:
        is_due: Bools = self._steps == self._STEPS
        return wanted & ~(self._completed | is_due)

    def read(self, wanted: Bools, index: Ints, finished: Bools) -> tuple[Ints, Bools]:
        """See `Keys`."""
        return self._stamps[self._members, index], self._reads(wanted)

    def advance(self, oldest: tuple[tuple[Bools, Ints], ...], is_clearing: bool) -> Bools:
        """See `Keys`; stamps do not depend on time."""
        return np.zeros_like(oldest[0][0])

    def step(self, advance: Bools, wanted: Bools, finished: Bools, finished_id: Ints) -> None:
        """See `Keys`."""
        if self._clearing:
            self._clearing -= 1
            return
        completed, completed_id = self._completed, self._completed_id
        sweeps = ~(completed | self._reads(wanted))
        is_old = self._known & (self._count - self._swept >= self._quarter)
        renews = sweeps & is_old
        moves = self._known & (sweeps | ~is_old)
        self._swept = np.where(self._known, self._swept, self._stamps[self._members, self._sweep])
        self._stamps[self._members[renews], self._sweep[renews]] = (self._count - self._quarter)[renews]
        self._stamps[self._members[completed], completed_id[completed]] = self._count[completed]
        is_lost = completed & (completed_id == self._sweep)
        self._known = (sweeps | self._known) & ~moves & ~is_lost
        counts = completed & (self._steps < self._STEPS)
        self._count = self._count + counts
        self._steps = np.where(moves, 0, self._steps) + counts
        self._sweep = (self._sweep + moves) % self._size
        self._completed, self._completed_id = finished, finished_id


def lru(generics: Generics) -> Scheduler:
    """Return a scheduler that compares few requesters in parallel; with more requesters, tasks wait in a heap."""
    batch, requesters = generics.batch, generics.requesters
    if requesters <= ImmediateLru.MAX_REQUESTERS:
        return ImmediateLru(batch, requesters)
    return Engine(batch, requesters, Heap(batch, requesters), Stamps(batch, requesters))
