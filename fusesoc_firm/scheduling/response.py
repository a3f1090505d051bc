"""Bounds on the response time of sporadic tasks under each policy: from the first sight of a request to its last beat.

All times are integers, in cycles. What the hardware costs beside the transfers is an `Overheads`; with none of them
these are the analyses of the literature:

* fixed priority, preemptive: M. Joseph and P. Pandya, Finding response times in a real-time system, 1986;
* fixed priority, non-preemptive: R. Davis, A. Burns, R. Bril, J. Lukkien, Controller Area Network (CAN) schedulability
  analysis: refuted, revisited and revised, 2007;
* EDF: S. Baruah, A. Mok, L. Rosier, Preemptively scheduling hard-real-time sporadic tasks on one processor, 1990.

A requester has one task at a time: it asks no sooner than a period after it last asked, and never before its last task
is over. So a task waits for at most one task of another requester that was there before it, however high the load is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from fusesoc_firm.scheduling.tasks import Task

# Deadlines that the processor-demand test looks at; what lies beyond is bounded by a straight line.
_MOST_DEADLINES = 500_000
# Steps of a fixed point; one that has not come to rest by then grows without end, for all that matters.
_MOST_STEPS = 10_000


@dataclass(frozen=True)
class Overheads:
    """What a scheduler costs, in cycles; see `analysis.overheads_of` for those of the cores."""

    decision: int = 0
    """From a request to the grant if nobody sends."""
    acceptance: int = 0
    """Until a scheduler that takes in one request after the other knows of a request."""
    shortest_run: int = 0
    """Beats that a run has at least before another requester may interrupt it."""
    resume: int = 0
    """Beats more that each run but a task's first begins with."""
    shortest_service: int = 1
    """Cycles that a task takes at least, however few beats it has."""

    def service(self, task: Task) -> int:
        """The cycles of a task that is not interrupted."""
        return max(task.transfer_time, self.shortest_service)

    @property
    def blocking(self) -> int:
        """How long a task waits for a run that it may interrupt, which may begin while the decision is made."""
        return max(self.decision, self.decision - 1 + self.shortest_run + self.resume)


def fixed_priority_preemptive(task: Task, higher: Sequence[Task], overheads: Overheads) -> int | None:
    """The bound with these tasks of higher priority; None if there is none, as they may take all the time there is.

    Every request of higher priority may interrupt once, which costs a resumption. The run that blocks is one of a
    lower priority, or the last one of the task before this one, behind which requests of higher priority may wait.
    """
    wait = overheads.blocking + overheads.service(task)
    return _fixed_point(wait, higher, overheads, after=overheads.resume)


def fixed_priority(task: Task, higher: Sequence[Task], lower: Sequence[Task], overheads: Overheads) -> int | None:
    """The bound without preemption; None if there is none.

    Where the tasks of this priority and of higher ones leave some time, it is the greatest response in a busy period
    (the revised analysis of CAN); else the simpler bound, in which the task before this one may block as well.
    """
    blocking = max([overheads.decision, *map(overheads.service, lower)])
    service = overheads.service(task)
    if _load([task, *higher], overheads) < 1:
        busy = _fixed_point(blocking, [task, *higher], overheads)
        if busy is None:
            return None
        responses = []
        for number in range(-(-busy // task.period)):
            start = _start(blocking + number * service, higher, overheads)
            responses.append(None if start is None else start - number * task.period + service)
        known = [response for response in responses if response is not None]
        return max(known) if len(known) == len(responses) else None
    # Only those of higher priority can have waited for it.
    start = _start(max(blocking, service) if higher else blocking, higher, overheads)
    return None if start is None else start + service


def taking_turns(task: Task, others: Sequence[Task], overheads: Overheads) -> int:
    """The bound under round robin and LRU: every other requester goes first at most once."""
    waits = overheads.acceptance + overheads.decision + sum(map(overheads.service, others))
    return waits + overheads.service(task)


def edf_by_demand(tasks: Sequence[Task], overheads: Overheads) -> float:
    """The greatest lateness of any task under EDF; infinite if the tasks are more than the channel can take.

    Later deadlines do not change the order: if all are x cycles later, EDF does the same. So the greatest lateness is
    the least x with which the processor-demand test passes, which is the most that the demand exceeds the time by.
    Deadlines count from when the scheduler knows of a request, so what it learns late is late, and requests may seem
    closer together.
    """
    load = _load(tasks, overheads)
    if load > 1:
        return inf
    late = overheads.acceptance
    services = [overheads.service(task) + overheads.resume for task in tasks]
    shares = [service / task.period for task, service in zip(tasks, services, strict=True)]
    spare = [task.period - task.deadline + late for task in tasks]
    # The demand up to u is never more than load * u + slope.
    slope = sum(share * max(0, each) for share, each in zip(shares, spare, strict=True))
    least = float(max(service - task.deadline for task, service in zip(tasks, services, strict=True)))
    affordable = _MOST_DEADLINES / sum(1 / task.period for task in tasks)
    needed = (slope - least) / (1 - load) if load < 1 else inf
    horizon = min(affordable, needed)
    most = max(least, _most_excess(tasks, services, late, int(horizon)))
    if needed > horizon:
        # From the last of the first deadlines on, the line lies lower.
        if horizon >= max(task.deadline for task in tasks):
            slope = sum(share * each for share, each in zip(shares, spare, strict=True))
        most = max(most, slope - (1 - load) * horizon)
    return overheads.blocking + late + most


def _most_excess(tasks: Sequence[Task], services: Sequence[int], late: int, horizon: int) -> float:
    """The most that the demand of the deadlines up to the horizon exceeds the time by."""
    times, demands = [], []
    for task, service in zip(tasks, services, strict=True):
        releases = np.arange(0, horizon - task.deadline + late + 1, task.period)
        times.append(task.deadline + np.maximum(releases - late, 0))
        demands.append(np.full(releases.size, service))
    time, demand = np.concatenate(times), np.concatenate(demands)
    order = np.argsort(time, kind="stable")
    # At equal deadlines only the last sum is the demand; those before it are less, and do no harm.
    excess = np.cumsum(demand[order]) - time[order]
    return float(excess.max()) if excess.size else -inf


def edf_by_counting(task: Task, others: Sequence[Task], overheads: Overheads) -> int:
    """A bound under EDF at any load: the tasks of others that may have an earlier deadline, counted.

    Of each requester this is the one that is there, and those that come so soon that their deadline is not later.
    """
    wait = overheads.acceptance + overheads.blocking
    for other in others:
        window = task.deadline - other.deadline + overheads.acceptance
        wait += _requests(window, other.period) * (overheads.service(other) + overheads.resume)
    return wait + overheads.service(task)


def lst_by_counting(task: Task, others: Sequence[Task], overheads: Overheads) -> int:
    """A bound under LST at any load, counted alike.

    The slack of a task that waits shrinks with every cycle, so who comes late enough never has less. While the task
    is sent its slack stays and the others' shrinks: they may come that much later.
    """
    wait = overheads.acceptance + overheads.blocking
    own = _interrupted_service(task, overheads)
    for other in others:
        window = task.deadline - other.deadline + other.transfer_time + own + overheads.acceptance
        wait += _requests(window, other.period) * _interrupted_service(other, overheads)
    return wait + own


def lst_by_demand(tasks: Sequence[Task], overheads: Overheads) -> float:
    """The greatest lateness of any task under LST, which is optimal as EDF is (A. Mok, 1983).

    That holds if the least slack runs in every cycle. Here a run lasts some cycles too long, which each of the other
    tasks may do to the one that is late.
    """
    stretched = [Task(task.name, task.period, _interrupted_service(task, overheads), task.deadline) for task in tasks]
    bare = Overheads(overheads.decision, overheads.acceptance, overheads.shortest_run, 0, overheads.shortest_service)
    too_long = (len(tasks) - 1) * (overheads.blocking + overheads.decision)
    return edf_by_demand(stretched, bare) + overheads.resume + too_long


def _interrupted_service(task: Task, overheads: Overheads) -> int:
    """The cycles of a task that is interrupted as often as it may be: each run but the first costs a resumption."""
    runs = -(-task.transfer_time // max(1, overheads.shortest_run))
    return overheads.service(task) + (runs - 1) * overheads.resume


def _requests(window: int, period: int) -> int:
    """Tasks of a requester that count: one that is there, and those that come within the window, if it is open."""
    return 1 + (window // period + 1 if window >= 0 else 0)


def _load(tasks: Sequence[Task], overheads: Overheads) -> float:
    return sum((overheads.service(task) + overheads.resume) / task.period for task in tasks)


def _start(before: int, higher: Sequence[Task], overheads: Overheads) -> int | None:
    """When a task that nobody may interrupt begins: a request of higher priority in that very cycle is too late."""
    return _fixed_point(before, higher, overheads, before=1)


def _fixed_point(
    first: int, tasks: Sequence[Task], overheads: Overheads, before: int = 0, after: int = 0
) -> int | None:
    """The least w = first + the service of all requests in w cycles, if all come at once and then with their periods.

    `before` widens the window, `after` lengthens each service. None if there is none.
    """
    if not tasks:
        return first
    services = np.array([overheads.service(task) + after for task in tasks])
    periods = np.array([task.period for task in tasks])
    if (services / periods).sum() >= 1:
        return None
    window = max(first, 1)
    for _ in range(_MOST_STEPS):
        following = first + int((-(-(window + before) // periods) * services).sum())
        if following == window:
            return window
        window = following
    return None
