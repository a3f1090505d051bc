"""The metrics of section 4.3, for each set and averaged over the sets of a data set.

The dissertation defines the metrics but not their aggregation. Here the minimum, average and maximum are computed over
the tasks of a set, then averaged over the sets. This aggregation explains why all three columns of tables 4.3 and 4.4
contain fractions, and with it the models of fixed priority and LRU reproduce the tables' values.

The response time covers every granted task, although equation 4.4 refers to completed transactions. The maxima of
table 4.3 are only reproduced if tasks that the end of the simulation cut short are included
(docs/explanation/scheduler-evaluation.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusesoc_firm.scheduling.evaluation.simulation import Trace
from fusesoc_firm.scheduling.evaluation.workloads import Times

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Metrics:
    """All metrics of section 4.3 as arrays of shape (B,), one element for each set.

    An element is NaN if its set has no task to measure.

    Times are in cycles.
    """

    granted: Values
    """The number of accelerators that got the grant at least once (figure 4.6)."""
    finished: Values
    """The number of accelerators that completed at least one transaction (figure 4.6)."""
    completed: Values
    """The number of completed tasks."""
    preemptions: Values
    """Preemptions per completed transaction of an accelerator, averaged over the accelerators that completed a
    transaction (figure 4.7)."""
    response_min: Values
    response_avg: Values
    response_max: Values
    """The response time g - a (equation 4.3) of all granted tasks, completed or not (table 4.3)."""
    lateness_min: Values
    lateness_avg: Values
    lateness_max: Values
    """The lateness f - d of completed transactions (equation 4.5, table 4.4) with implicit deadlines."""
    utilisation: Values
    """Channel utilisation (equation 4.6): the percentage of all cycles in which a beat was accepted."""
    utilisation_requested: Values
    """The percentage of the cycles with a request in which a beat was accepted."""

    def means(self) -> dict[str, float]:
        """Return the mean of each metric over the sets with a value, or NaN if no set has a value."""
        return {each.name: _mean(getattr(self, each.name)) for each in fields(self)}


METRICS = tuple(each.name for each in fields(Metrics))


def measure(trace: Trace) -> Metrics:
    """Return the metrics of a simulation."""
    tasks, sets, requesters = trace.tasks, trace.workload.sets, trace.workload.requesters
    done = tasks.is_finished
    of_set, of_requester = tasks.set[done], tasks.requester[done]
    deadline = tasks.arrival[done] + trace.workload.deadlines[of_set, of_requester]
    response = _Spread(tasks.set, tasks.grant - tasks.arrival, sets)
    lateness = _Spread(of_set, tasks.finish[done] - deadline, sets)
    completed = np.bincount(of_set * requesters + of_requester, minlength=sets * requesters).reshape(sets, requesters)
    return Metrics(
        granted=_distinct(tasks.set, tasks.requester, sets, requesters),
        finished=_distinct(of_set, of_requester, sets, requesters),
        completed=completed.sum(axis=1).astype(float),
        preemptions=_preemptions(trace, completed),
        response_min=response.minimum,
        response_avg=response.average,
        response_max=response.maximum,
        lateness_min=lateness.minimum,
        lateness_avg=lateness.average,
        lateness_max=lateness.maximum,
        utilisation=100 * trace.busy / trace.cycles,
        utilisation_requested=_ratio(100 * trace.busy, trace.requested),
    )


class _Spread:
    """The minimum, average and maximum of the values in each set."""

    def __init__(self, of_set: Times, values: Times, sets: int) -> None:
        counts = np.bincount(of_set, minlength=sets)
        self.average = _ratio(np.bincount(of_set, weights=values, minlength=sets), counts)
        lowest = np.full(sets, np.inf)
        highest = np.full(sets, -np.inf)
        np.minimum.at(lowest, of_set, values)
        np.maximum.at(highest, of_set, values)
        self.minimum = np.where(counts > 0, lowest, np.nan)
        self.maximum = np.where(counts > 0, highest, np.nan)


def _distinct(of_set: Times, of_requester: Times, sets: int, requesters: int) -> Values:
    """Return the number of distinct requesters in each set, shape (B,)."""
    found = np.zeros((sets, requesters), np.bool_)
    found[of_set, of_requester] = True
    return np.asarray(found.sum(axis=1), float)


def _preemptions(trace: Trace, completed: Times) -> Values:
    """Return the preemptions per completed task, averaged over the accelerators that completed a task.

    Preemptions of unfinished tasks are also counted.
    """
    tasks = trace.tasks
    found = np.zeros(completed.shape)
    np.add.at(found, (tasks.set, tasks.requester), tasks.preemptions)
    each = np.where(completed > 0, found / np.maximum(completed, 1), 0.0)
    return _ratio(each.sum(axis=1), (completed > 0).sum(axis=1))


def _ratio(numerator: Any, denominator: Any) -> Values:
    """Return the element-wise quotient, with NaN for a zero denominator."""
    ratio: Values = np.where(denominator > 0, numerator / np.maximum(denominator, 1), np.nan)
    return ratio


def _mean(values: Values) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else math.nan
