"""Round robin: grant the next index, cyclically, after the requester that has the grant."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Generics, Ints, Scheduler
from fusesoc_firm.scheduling.models.choosing import ChoosingScheduler


class RoundRobin(ChoosingScheduler):
    """The non-preemptive scheduler, which begins with index 0 after reset; a granted request keeps the grant."""

    def __init__(self, batch: int, requesters: int) -> None:
        super().__init__(batch, requesters)
        self.grant_select = np.full(batch, requesters - 1, np.int64)
        self._indices = np.arange(requesters)

    def _choose(self, eligible: Bools) -> Ints:
        after = eligible & (self._indices > self.grant_select[:, np.newaxis])
        following = np.where(after.any(axis=1), after.argmax(axis=1), eligible.argmax(axis=1))
        choice: Ints = np.where(self.grant_valid & self._of_granted(eligible), self.grant_select, following)
        return choice


def round_robin(generics: Generics) -> Scheduler:
    """Return a scheduler with as many turns as requesters."""
    return RoundRobin(generics.batch, generics.requesters)
