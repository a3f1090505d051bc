"""The evaluation of section 4.3 as jobs, each with a data set, a number of accelerators and a scheduler."""

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
    """The settings of all jobs; if `sets` or `cycles` is None, the value of the data set applies.

    Both `shortest_run` and `resume_beats` apply to preemptive policies. `shortest_run` is the number of beats before a
    run may be interrupted, 1 in section 4.3. `resume_beats` is the number of additional cycles for each run of a task
    except the first run: 0 in section 4.3, 1 with the Manager's bursts.
    """

    seed: int = 1
    sets: int | None = None
    cycles: int | None = None
    distribution: Distribution = Distribution.NORMAL
    shortest_run: int = 1
    resume_beats: int = 0

    def sets_of(self, data_set: str) -> int:
        """Return the number of simulated sets of a data set."""
        return self.sets or DATA_SETS[data_set].sets

    def cycles_of(self, data_set: str) -> int:
        """Return the number of simulated cycles for each set."""
        return self.cycles or DATA_SETS[data_set].cycles


@dataclass(frozen=True, order=True)
class Key:
    """The key of an evaluation: the name of a policy or combination, a data set, and a number of accelerators."""

    data_set: str
    policy: str
    requesters: int


@dataclass(frozen=True)
class Job:
    """A self-contained evaluation that needs no files, so that any machine can run it."""

    key: Key
    settings: Settings


@dataclass(frozen=True)
class Outcome:
    """The metrics of a job's sets, with the duration of the job in seconds."""

    key: Key
    metrics: Metrics
    seconds: float


def model_of(policy: str, workload: Workload, shortest_run: int = 1) -> SchedulerModel:
    """Return the model of a policy or a combination for a workload.

    The period of a requester is the minimum time between requests, which is also the implicit deadline.
    """
    generics = Generics(workload.deadlines, workload.transfer_times, shortest_run=shortest_run)
    if policy in COMBINATIONS:
        return combined(COMBINATIONS[policy], generics)
    return make_model(policy, generics)


def evaluate(job: Job) -> Outcome:
    """Run a job and return its outcome; all schedulers get the same workload (section 4.3)."""
    started = time.perf_counter()
    key, settings = job.key, job.settings
    workload = draw(
        DATA_SETS[key.data_set], key.requesters, settings.seed, settings.sets_of(key.data_set), settings.distribution
    )
    model = model_of(key.policy, workload, settings.shortest_run)
    trace = simulate(model, workload, settings.cycles_of(key.data_set), resume_beats=settings.resume_beats)
    return Outcome(key, measure(trace), time.perf_counter() - started)


def jobs(data_sets: Iterable[str], policies: Sequence[str], requesters: Sequence[int], settings: Settings) -> list[Job]:
    """Return a job for each combination, the longest first, so that no worker finishes long after the others.

    The combined schedulers of figure 4.18 are included if all their component policies are.
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
    """Return an iterator over the outcomes of the jobs, in the order of completion."""
    return (outcome for _, outcome in workers.run(evaluate, to_do))
