"""The model of firm_sched_parallel, for policies with deadlines that compare few requesters in every cycle."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Ints, Scheduler

_NOBODY = np.iinfo(np.int64).min


class Parallel(Scheduler):
    """A scheduler that grants the most urgent task.

    A task's urgency (B, N) is -`offsets` (B, N) when the task arrives, and grows by one in each cycle. All urgencies
    stop growing while any requester's urgency is at least an eighth of the range of `time_bits`.
    """

    MAX_REQUESTERS = 8

    def __init__(
        self, offsets: Ints, time_bits: int | None, *, sends_own_time: bool = False, shortest_run: int = 1
    ) -> None:
        super().__init__(*offsets.shape)
        self._offsets = offsets
        self._overdue = None if time_bits is None else 2 ** (time_bits - 3)
        self._sends_own_time = sends_own_time
        self._shortest_run = shortest_run
        self._known: Bools = np.zeros(offsets.shape, np.bool_)
        self._urgency: Ints = -offsets
        self._beats: Ints = np.zeros(self.batch, np.int64)

    def step(self, request: Bools, beat: Bools, last: Bools) -> None:
        """See `Scheduler`."""
        finished = beat & last
        granted = self.grant_select
        eligible = self._without_granted(self._known, finished)
        beats = np.minimum(self._beats + beat, self._shortest_run)
        kept = (beats > 0) & (beats < self._shortest_run) & self._of_granted(request) & ~finished
        # The urgencies are doubled, so that the granted task can precede tasks of equal urgency.
        ranks = np.where(eligible, 2 * self._urgency, _NOBODY)
        ranks[self._members, granted] += eligible[self._members, granted]
        first: Ints = ranks.argmax(axis=1)
        self._grant(first, eligible.any(axis=1) & ~kept)
        self._beats = np.where(finished | (self.grant_select != granted), 0, beats)

        grows: Bools = np.ones(self._known.shape, np.bool_)
        if self._sends_own_time:
            grows[self._members, granted] = ~beat
        if self._overdue is not None:
            grows &= ~(self._urgency >= self._overdue).any(axis=1, keepdims=True)
        self._urgency = np.where(self._known, self._urgency + grows, -self._offsets)
        self._known = self._known | request
        self._known[self._members, granted] &= ~finished
