"""Round robin: grant the next index, cyclically, after the requester that completed a task last."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Generics, Ints, Scheduler
from fusesoc_firm.scheduling.models.choosing import ChoosingScheduler


class RoundRobin(ChoosingScheduler):
    """The non-preemptive scheduler, which begins with index 0 after reset."""

    def __init__(self, batch: int, requesters: int) -> None:
        super().__init__(batch, requesters)
        self._served: Ints = np.full(batch, requesters - 1, np.int64)
        self._indices = np.arange(requesters)

    def _note_completed(self, finished: Bools) -> None:
        self._served = np.where(finished, self.grant_select, self._served)

    def _choose(self, eligible: Bools) -> Ints:
        after = eligible & (self._indices > self._served[:, np.newaxis])
        choice: Ints = np.where(after.any(axis=1), after.argmax(axis=1), eligible.argmax(axis=1))
        return choice


def round_robin(generics: Generics) -> Scheduler:
    """Return a scheduler with as many turns as requesters."""
    return RoundRobin(generics.batch, generics.requesters)
