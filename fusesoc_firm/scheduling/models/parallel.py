"""firm_sched_parallel: a policy with deadlines for few requesters, all of whose keys are compared in every cycle."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Ints, Scheduler
from fusesoc_firm.scheduling.models.engine import is_overdue

_NOBODY = np.iinfo(np.int64).max


class Parallel(Scheduler):
    """`offsets` (B, N) are from a task's time to its key; see `Engine` for the rest."""

    MAX_REQUESTERS = 8

    def __init__(
        self, offsets: Ints, time_bits: int | None, *, sends_own_time: bool = False, shortest_run: int = 1
    ) -> None:
        super().__init__(*offsets.shape)
        self._offsets = offsets
        self._eighth = None if time_bits is None else time_bits - 3
        self._sends_own_time = sends_own_time
        self._shortest_run = shortest_run
        self._time: Ints = np.zeros(self.batch, np.int64)
        self._known: Bools = np.zeros(offsets.shape, np.bool_)
        self._keys: Ints = offsets.copy()
        self._beats: Ints = np.zeros(self.batch, np.int64)

    def step(self, request: Bools, beat: Bools, last: Bools) -> None:
        """See `Scheduler`."""
        finished = beat & last
        granted = self.grant_select
        eligible = self._without_granted(self._known, finished)
        beats = np.minimum(self._beats + beat, self._shortest_run)
        kept = (beats > 0) & (beats < self._shortest_run) & self._of_granted(request) & ~finished
        # Twice the key, so that the task that has the grant fits in front of equal ones.
        ranks = np.where(eligible, 2 * self._keys + 1, _NOBODY)
        ranks[self._members, granted] -= eligible[self._members, granted]
        first: Ints = ranks.argmin(axis=1)
        is_any = eligible.any(axis=1)
        self._grant(first, is_any & ~kept)
        self._beats = np.where(finished | (self.grant_select != granted), 0, beats)

        advance: Bools = np.ones(self.batch, np.bool_)
        if self._eighth is not None:
            advance = ~(is_any & is_overdue(self._keys[self._members, first], self._time, self._eighth))
        if self._sends_own_time:
            self._keys[self._members, granted] += beat & advance
        self._keys = np.where(self._known, self._keys, self._time[:, np.newaxis] + self._offsets)
        self._known = self._known | request
        self._known[self._members, granted] &= ~finished
        self._time += advance
