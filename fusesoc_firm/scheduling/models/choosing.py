"""Non-preemptive schedulers that need only a single cycle to choose among all requests."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Ints, Scheduler


class ChoosingScheduler(Scheduler):
    """A scheduler that chooses a requester in each cycle without a task in progress.

    The scheduler also chooses in the cycle of a task's last beat, when it excludes the requester of that task.
    """

    def __init__(self, batch: int, requesters: int) -> None:
        super().__init__(batch, requesters)
        # Whether the granted task has had a beat and needs further beats.
        self._started: Bools = np.zeros(batch, np.bool_)

    @abstractmethod
    def _choose(self, eligible: Bools) -> Ints:
        """Return the chosen requester (B,) among the `eligible` (B, N).

        The choice is arbitrary where none is eligible.
        """

    def _note_completed(self, finished: Bools) -> None:
        """Record that the granted requester completed a task where `finished` (B,) is true.

        `step` calls this method before the choice.
        """

    def step(self, request: Bools, beat: Bools, last: Bools) -> None:
        """See `Scheduler`."""
        finished = beat & last
        eligible = self._without_granted(request, finished)
        self._note_completed(finished)
        goes_on = (self._started | beat) & ~finished
        self._grant(self._choose(eligible), eligible.any(axis=1) & ~goes_on)
        self._started = goes_on
