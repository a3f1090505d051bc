"""The data sets of section 4.3: the lengths and frequencies of the accelerators' transfers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.int64]

REQUESTERS = (2, 4, 8, 16, 32, 64, 128, 256)
"""The numbers of accelerators in the dissertation's tables."""


class Distribution(StrEnum):
    """The distribution of times around a data set's centre."""

    NORMAL = "normal"
    UNIFORM = "uniform"


@dataclass(frozen=True)
class DataSet:
    """The centre and spread of a data set, and the extent of its simulation. All times are in cycles.

    An accelerator is a pair S = {T, F} (section 4.3): it sends `transfer_time` beats, and has new data `frequency`
    cycles after the last beat.
    """

    name: str
    title: str
    transfer_time: int
    frequency: int
    sigma: int
    sets: int
    cycles: int

    @property
    def formula(self) -> str:
        """The data set in the notation of section 4.3."""
        return f"({{{self.transfer_time}, {self.frequency}}}, {self.sigma})"


DATA_SETS: Mapping[str, DataSet] = MappingProxyType(
    {
        each.name: each
        for each in (
            DataSet("large", "Large data set", 100, 100, 50, 200, 10_000),
            DataSet("cc1", "Corner case 1: short transfers, short pauses", 20, 20, 10, 10, 50_000),
            DataSet("cc2", "Corner case 2: short transfers, long pauses", 20, 180, 10, 10, 50_000),
            DataSet("cc3", "Corner case 3: long transfers, short pauses", 180, 20, 10, 10, 50_000),
            DataSet("cc4", "Corner case 4: long transfers, long pauses", 180, 180, 10, 10, 50_000),
        )
    }
)


@dataclass(frozen=True)
class Workload:
    """The accelerators of B sets, N in each set; the arrays have the shape (B, N) and contain cycles.

    A request occurs at least `frequencies` after the last transmission and `periods` after the last request. If
    `periods` is None, only `frequencies` applies.
    """

    transfer_times: Times
    frequencies: Times
    periods: Times | None = None

    @property
    def sets(self) -> int:
        """B, the number of sets that are simulated in parallel."""
        return int(self.transfer_times.shape[0])

    @property
    def requesters(self) -> int:
        """N, the number of accelerators in a set."""
        return int(self.transfer_times.shape[1])

    @property
    def deadlines(self) -> Times:
        """The implicit deadlines, counted from a request: 'period + length' (note of table 4.4), shape (B, N)."""
        return self.frequencies + self.transfer_times

    @property
    def load(self) -> NDArray[np.float64]:
        """The load of the channel in each set, by equation 4.1 with the period F + T; shape (B,)."""
        return np.asarray((self.transfer_times / self.deadlines).sum(axis=1))


def draw(
    data_set: DataSet,
    requesters: int,
    seed: int,
    sets: int | None = None,
    distribution: Distribution = Distribution.NORMAL,
) -> Workload:
    """Draw a workload from a data set; equal arguments result in equal workloads on every machine.

    Each set has a separate random generator, so a larger number of `sets` leaves the first sets unchanged.
    """
    count = data_set.sets if sets is None else sets
    pairs = np.stack([_pairs(data_set, requesters, [seed, requesters, k], distribution) for k in range(count)])
    return Workload(np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1]))


def _pairs(data_set: DataSet, requesters: int, seed: list[int], distribution: Distribution) -> Times:
    """Return the transfer times and frequencies of a set, shape (2, N)."""
    generator = np.random.default_rng(seed)
    centre = np.array([[data_set.transfer_time], [data_set.frequency]], dtype=float)
    if distribution is Distribution.NORMAL:
        drawn = generator.normal(centre, data_set.sigma, (2, requesters))
    else:
        drawn = generator.uniform(centre - data_set.sigma, centre + data_set.sigma, (2, requesters))
    # This limit cuts off 2 % of a normal distribution whose centre is two sigma above 0.
    return np.maximum(np.rint(drawn), 1).astype(np.int64)
