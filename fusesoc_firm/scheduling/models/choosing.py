"""Non-preemptive schedulers that choose in a single cycle, among all requests."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Ints, Scheduler


class ChoosingScheduler(Scheduler):
    """Chooses anew in every cycle in which no task goes on, and in that of a task's last beat without its requester."""

    def __init__(self, batch: int, requesters: int) -> None:
        super().__init__(batch, requesters)
        # The granted task has had a beat and needs more.
        self._started: Bools = np.zeros(batch, np.bool_)

    @abstractmethod
    def _choose(self, eligible: Bools) -> Ints:
        """Who goes first, (B,), of those in `eligible` (B, N); any number where nobody is."""

    def _note_completed(self, finished: Bools) -> None:
        """Where `finished` (B,) is true the granted requester completes a task. Comes before the choice."""

    def step(self, request: Bools, beat: Bools, last: Bools) -> None:
        """See `Scheduler`."""
        finished = beat & last
        eligible = self._without_granted(request, finished)
        self._note_completed(finished)
        goes_on = (self._started | beat) & ~finished
        self._grant(self._choose(eligible), eligible.any(axis=1) & ~goes_on)
        self._started = goes_on
