"""The evaluation of section 4.3 as jobs: a data set, a number of accelerators and a scheduler each."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from fusesoc_firm.scheduling.evaluation.combinations import COMBINATIONS, COMBINED_REQUESTERS, combined
from fusesoc_firm.scheduling.evaluation.metrics import Metrics, measure
from fusesoc_firm.scheduling.evaluation.simulation import SchedulerModel, simulate
from fusesoc_firm.scheduling.evaluation.workloads import DATA_SETS, Distribution, Workload, draw
from fusesoc_firm.scheduling.models import Generics, make_model
from fusesoc_firm.tools.workers import Workers


@dataclass(frozen=True)
class Settings:
    """What all jobs share; `sets` and `cycles` of None are those of the data set.

    `shortest_run` and `resume_beats` are those of preemptive policies: the beats that a run has before it may be
    interrupted, and the cycles that each run of a task but its first costs beside its beats. Those of section 4.3 are 1
    and 0; the Manager's bursts cost one.
    """

    seed: int = 1
    sets: int | None = None
    cycles: int | None = None
    distribution: Distribution = Distribution.NORMAL
    shortest_run: int = 1
    resume_beats: int = 0

    def sets_of(self, data_set: str) -> int:
        """The sets that are simulated of a data set."""
        return self.sets or DATA_SETS[data_set].sets

    def cycles_of(self, data_set: str) -> int:
        """The cycles that each of them is simulated for."""
        return self.cycles or DATA_SETS[data_set].cycles


@dataclass(frozen=True, order=True)
class Key:
    """What is evaluated: a policy or a combination, by its name, with so many accelerators of a data set."""

    data_set: str
    policy: str
    requesters: int


@dataclass(frozen=True)
class Job:
    """An evaluation; it needs no file, so any machine can do it."""

    key: Key
    settings: Settings


@dataclass(frozen=True)
class Outcome:
    """The metrics of each set, and the seconds that it took."""

    key: Key
    metrics: Metrics
    seconds: float


def model_of(policy: str, workload: Workload, shortest_run: int = 1) -> SchedulerModel:
    """The model of a policy, or of a combination, for a workload.

    The period of a requester is the least time between its requests, that is, its implicit deadline.
    """
    generics = Generics(workload.deadlines, workload.transfer_times, shortest_run=shortest_run)
    if policy in COMBINATIONS:
        return combined(COMBINATIONS[policy], generics)
    return make_model(policy, generics)


def evaluate(job: Job) -> Outcome:
    """Simulate and measure; all schedulers get the same workload (section 4.3)."""
    started = time.perf_counter()
    key, settings = job.key, job.settings
    workload = draw(
        DATA_SETS[key.data_set], key.requesters, settings.seed, settings.sets_of(key.data_set), settings.distribution
    )
    model = model_of(key.policy, workload, settings.shortest_run)
    trace = simulate(model, workload, settings.cycles_of(key.data_set), resume_beats=settings.resume_beats)
    return Outcome(key, measure(trace), time.perf_counter() - started)


def jobs(data_sets: Iterable[str], policies: Sequence[str], requesters: Sequence[int], settings: Settings) -> list[Job]:
    """A job for all of everything; the longest come first, so that no worker is left with one of them at the end.

    The combined schedulers of figure 4.18 join in if all that they consist of takes part.
    """
    data_sets = list(data_sets)
    keys = [Key(data_set, policy, number) for data_set in data_sets for policy in policies for number in requesters]
    if "large" in data_sets and COMBINED_REQUESTERS in requesters:
        keys += [
            Key("large", name, COMBINED_REQUESTERS)
            for name, parts in COMBINATIONS.items()
            if set(parts) <= set(policies)
        ]
    keys.sort(key=lambda key: -key.requesters * settings.cycles_of(key.data_set) * settings.sets_of(key.data_set))
    return [Job(key, settings) for key in keys]


def run(to_do: Iterable[Job], workers: Workers) -> Iterator[Outcome]:
    """The outcome of each job, as they come."""
    return (outcome for _, outcome in workers.run(evaluate, to_do))
