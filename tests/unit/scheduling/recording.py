"""What a scheduler sees, kept for tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fusesoc_firm.scheduling.simulation import Flags, SchedulerModel
from fusesoc_firm.scheduling.workloads import Times


class Recording:
    """A scheduler that notes request, beat and last of each cycle."""

    def __init__(self, model: SchedulerModel) -> None:
        self.model = model
        self.seen: list[tuple[Flags, Flags, Flags]] = []

    @property
    def grant_valid(self) -> Flags:
        return self.model.grant_valid

    @property
    def grant_select(self) -> NDArray[np.int64]:
        return self.model.grant_select

    def step(self, request: Flags, beat: Flags, last: Flags) -> None:
        self.seen.append((request.copy(), beat.copy(), last.copy()))
        self.model.step(request, beat, last)


def times(*rows: list[int]) -> Times:
    return np.array(rows, np.int64)
