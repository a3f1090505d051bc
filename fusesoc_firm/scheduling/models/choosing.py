"""Non-preemptive schedulers that choose among all requests in a single cycle."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Ints, Scheduler


class ChoosingScheduler(Scheduler):
    """A scheduler that chooses in each cycle without a task in progress.

    It also chooses in the cycle of a task's last beat; that task's requester is then excluded.
    """

    def __init__(self, batch: int, requesters: int) -> None:
        super().__init__(batch, requesters)
        # The granted task has had a beat and needs more.
        self._started: Bools = np.zeros(batch, np.bool_)

    @abstractmethod
    def _choose(self, eligible: Bools) -> Ints:
        """Return the chosen requester, (B,), among those in `eligible` (B, N); arbitrary where none is eligible."""

    def _note_completed(self, finished: Bools) -> None:
        """Note a completed task of the granted requester where `finished` (B,) is true; runs before the choice."""

    def step(self, request: Bools, beat: Bools, last: Bools) -> None:
        """See `Scheduler`."""
        finished = beat & last
        eligible = self._without_granted(request, finished)
        self._note_completed(finished)
        goes_on = (self._started | beat) & ~finished
        self._grant(self._choose(eligible), eligible.any(axis=1) & ~goes_on)
        self._started = goes_on
