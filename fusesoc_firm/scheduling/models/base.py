"""The common parts of all scheduler models.

A model behaves like its entity in cores/sched, cycle by cycle, for a batch of B schedulers with N requesters each. The
ports are arrays; `step` is a rising edge of the clock.

    scheduler = make_model("lru", Generics(periods))
    while ...:
        granted = scheduler.grant_select[scheduler.grant_valid]
        scheduler.step(request, beat, last)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Generics:
    """The generics of all schedulers' entities; each policy uses the generics that it needs.

    Times are in clock cycles, shape (B, N). If `deadlines` is None, deadlines are implicit (section 4.1). If
    `time_bits` is None, time never wraps around. Raises `ValueError` for arrays of different shapes and for values that
    the entities reject.
    """

    periods: Ints
    transfer_times: Ints | None = None
    deadlines: Ints | None = None
    shortest_run: int = 1
    time_bits: int | None = None

    def __post_init__(self) -> None:
        for name in ("periods", "transfer_times", "deadlines"):
            times = getattr(self, name)
            if times is None:
                continue
            if times.shape != self.periods.shape or times.ndim != 2:
                raise ValueError(
                    f"{name} has the shape {times.shape}; legal: (batch, requesters), the shape of the periods"
                )
            if times.min() < 1:
                raise ValueError(f"a time in {name} is {times.min()}; legal: 1 or more cycles")
        if self.shortest_run < 1:
            raise ValueError(f"shortest_run is {self.shortest_run}; legal: 1 or more beats")

    @property
    def batch(self) -> int:
        """The number of schedulers in the batch, B."""
        return int(self.periods.shape[0])

    @property
    def requesters(self) -> int:
        """The number of requesters of each scheduler, N."""
        return int(self.periods.shape[1])

    @property
    def relative_deadlines(self) -> Ints:
        """The time from a request to its deadline, shape (B, N)."""
        return self.periods if self.deadlines is None else self.deadlines

    def part(self, requesters: slice) -> Generics:
        """Return the generics for a subset of the requesters."""
        deadlines, transfer_times = (
            None if times is None else times[:, requesters] for times in (self.deadlines, self.transfer_times)
        )
        periods = self.periods[:, requesters]
        return replace(self, periods=periods, transfer_times=transfer_times, deadlines=deadlines)


class Scheduler(ABC):
    """A batch of schedulers of one policy, just after reset.

    `grant_valid` and `grant_select`, both of shape (B,), are the registers with the same names in the current cycle.
    """

    MAX_REQUESTERS = 256

    def __init__(self, batch: int, requesters: int) -> None:
        if not 1 <= requesters <= self.MAX_REQUESTERS:
            raise ValueError(f"requesters is {requesters}; legal: 1 to {self.MAX_REQUESTERS}")
        self.batch = batch
        self.requesters = requesters
        self.grant_valid: Bools = np.zeros(batch, np.bool_)
        self.grant_select: Ints = np.zeros(batch, np.int64)
        self._members = np.arange(batch)

    @abstractmethod
    def step(self, request: Bools, beat: Bools, last: Bools) -> None:
        """Simulate a rising edge; `request` (B, N), `beat` (B,) and `last` (B,) are the inputs in the cycle that ends.

        No argument is changed. `beat` may be true only where the grant is valid and the granted requester requests.
        `last` is ignored where `beat` is false.
        """

    def _without_granted(self, request: Bools, without: Bools) -> Bools:
        """Return a copy of `request` (B, N) in which the granted entry is false if `without` (B,) is true."""
        eligible = request.copy()
        eligible[self._members, self.grant_select] &= ~without
        return eligible

    def _of_granted(self, request: Bools) -> Bools:
        """Return whether the granted requester requests, shape (B,)."""
        return request[self._members, self.grant_select]

    def _grant(self, choice: Ints, where: Bools) -> None:
        """Grant the requesters `choice` (B,) where `where` (B,) is true."""
        self.grant_valid = self.grant_valid | where
        self.grant_select = np.where(where, choice, self.grant_select)
