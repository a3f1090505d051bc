"""Least recently used (section 4.2.1): who has waited longest since it completed a task goes first."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Ints
from fusesoc_firm.scheduling.models.choosing import ChoosingScheduler

_NEVER = np.iinfo(np.int64).max


class ImmediateLru(ChoosingScheduler):
    """Non-preemptive, for few requesters. After reset the lower index counts as less recently used."""

    MAX_REQUESTERS = 16

    def __init__(self, batch: int, requesters: int) -> None:
        super().__init__(batch, requesters)
        # When each completed its last task, counted in completed tasks.
        self._used: Ints = np.tile(np.arange(requesters), (batch, 1))
        self._now = requesters

    def _note_completed(self, finished: Bools) -> None:
        self._used[self._members[finished], self.grant_select[finished]] = self._now
        self._now += 1

    def _choose(self, eligible: Bools) -> Ints:
        choice: Ints = np.where(eligible, self._used, _NEVER).argmin(axis=1)
        return choice
