"""Fixed priority (section 4.2.2): the lowest index has the highest priority."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Generics, Ints, Scheduler
from fusesoc_firm.scheduling.models.choosing import ChoosingScheduler


class FixedPriority(ChoosingScheduler):
    """The non-preemptive scheduler, which never interrupts a task that has begun."""

    def _choose(self, eligible: Bools) -> Ints:
        choice: Ints = eligible.argmax(axis=1)
        return choice


class PreemptiveFixedPriority(Scheduler):
    """The preemptive scheduler, which chooses in every cycle.

    A run is a sequence of consecutive beats from one requester. A run cannot be interrupted until it has had
    `shortest_run` beats, the task ends, or the requester pauses.
    """

    def __init__(self, batch: int, requesters: int, shortest_run: int = 1) -> None:
        super().__init__(batch, requesters)
        self._shortest_run = shortest_run
        # The number of beats in the current run, saturating at the shortest run.
        self._beats: Ints = np.zeros(batch, np.int64)

    def step(self, request: Bools, beat: Bools, last: Bools) -> None:
        """See `Scheduler`."""
        finished = beat & last
        eligible = self._without_granted(request, finished)
        beats = np.minimum(self._beats + beat, self._shortest_run)
        kept = (beats > 0) & (beats < self._shortest_run) & self._of_granted(eligible)
        granted = self.grant_select
        self._grant(eligible.argmax(axis=1), eligible.any(axis=1) & ~kept)
        self._beats = np.where(finished | (self.grant_select != granted), 0, beats)


def fixed_priority(generics: Generics) -> Scheduler:
    """Return the model of the non-preemptive scheduler."""
    return FixedPriority(generics.batch, generics.requesters)


def fixed_priority_preemptive(generics: Generics) -> Scheduler:
    """Return the model of the preemptive scheduler."""
    return PreemptiveFixedPriority(generics.batch, generics.requesters, generics.shortest_run)
