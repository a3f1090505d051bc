"""Bounds on the response time of sporadic tasks: from the cycle that first shows a request to the task's last beat.

All times are integers, in cycles. `Overheads` are the costs of the hardware in addition to the transfers. Without
overheads, the bounds are those of the literature:

* fixed priority, preemptive: M. Joseph and P. Pandya, Finding response times in a real-time system, 1986;

* fixed priority, non-preemptive: R. Davis, A. Burns, R. Bril, J. Lukkien, Controller Area Network (CAN) schedulability
analysis: refuted, revisited and revised, 2007;

* EDF: S. Baruah, A. Mok, L. Rosier, Preemptively scheduling hard-real-time sporadic tasks on one processor, 1990.

A requester has one task at a time. Successive requests are at least a period apart, and a request never precedes the
end of the requester's last task. At any load, a task therefore waits for at most one earlier task of each other
requester.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from fusesoc_firm.scheduling.tasks import Task

# The number of deadlines that the processor-demand test examines; a straight line bounds the demand up to later
# deadlines.
_MOST_DEADLINES = 500_000
# The maximum number of steps in a fixed-point iteration; an iteration that needs more steps counts as divergent.
_MOST_STEPS = 10_000


@dataclass(frozen=True)
class Overheads:
    """The costs of a scheduler, in cycles; `analysis.overheads_of` returns the costs of the cores."""

    decision: int = 0
    """The time from a request to the grant if no other requester sends."""
    acceptance: int = 0
    """The time until a scheduler that accepts one request per cycle knows of a request."""
    shortest_run: int = 0
    """The minimum number of beats in a run before another requester may interrupt it."""
    resume: int = 0
    """The number of additional beats at the beginning of each run of a task except the first run."""
    shortest_service: int = 1
    """The minimum number of cycles of a task with any number of beats."""

    def service(self, task: Task) -> int:
        """Return the number of cycles of an uninterrupted task."""
        return max(task.transfer_time, self.shortest_service)

    @property
    def blocking(self) -> int:
        """The longest wait for a run that the task may interrupt; the run may begin while the scheduler decides."""
        return max(self.decision, self.decision - 1 + self.shortest_run + self.resume)


def fixed_priority_preemptive(task: Task, higher: Sequence[Task], overheads: Overheads) -> int | None:
    """Return the bound for a task with lower priority than `higher`, or None if `higher` may block it forever.

    Each request of higher priority may interrupt the task once, which costs a resumption. The blocking run is a run of
    lower priority, or the last run of the same requester's previous task, during which requests of higher priority may
    arrive.
    """
    wait = overheads.blocking + overheads.service(task)
    return _fixed_point(wait, higher, overheads, after=overheads.resume)


def fixed_priority(task: Task, higher: Sequence[Task], lower: Sequence[Task], overheads: Overheads) -> int | None:
    """Return the bound without preemption, or None if there is no bound.

    If the tasks of this priority and of higher priorities do not use the whole channel, the bound is the greatest
    response in a busy period (the revised analysis of CAN). Otherwise, a simpler bound applies, in which the
    requester's previous task may also block.
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
    # Only tasks of higher priority can have waited while the task was served.
    start = _start(max(blocking, service) if higher else blocking, higher, overheads)
    return None if start is None else start + service


def taking_turns(task: Task, others: Sequence[Task], overheads: Overheads) -> int:
    """Return the bound under round robin and LRU, which serve each other requester at most once before the task."""
    waits = overheads.acceptance + overheads.decision + sum(map(overheads.service, others))
    return waits + overheads.service(task)


def edf_by_demand(tasks: Sequence[Task], overheads: Overheads) -> float:
    """Return the greatest lateness of any task under EDF, or infinity if the tasks exceed the channel's capacity.

    Shifting all deadlines by the same time does not change their order. The greatest lateness is therefore the smallest
    shift for which the processor-demand test passes, that is, the greatest excess of the demand over the time.
    Deadlines count from the time at which the scheduler knows of a request. If the scheduler learns of a request late,
    the task becomes later by that time, and requests may seem closer together.
    """
    load = _load(tasks, overheads)
    if load > 1:
        return inf
    late = overheads.acceptance
    services = [overheads.service(task) + overheads.resume for task in tasks]
    shares = [service / task.period for task, service in zip(tasks, services, strict=True)]
    spare = [task.period - task.deadline + late for task in tasks]
    # The demand up to u never exceeds load * u + slope.
    slope = sum(share * max(0, each) for share, each in zip(shares, spare, strict=True))
    least = float(max(service - task.deadline for task, service in zip(tasks, services, strict=True)))
    affordable = _MOST_DEADLINES / sum(1 / task.period for task in tasks)
    needed = (slope - least) / (1 - load) if load < 1 else inf
    horizon = min(affordable, needed)
    most = max(least, _most_excess(tasks, services, late, int(horizon)))
    if needed > horizon:
        # After the latest of the first deadlines, a lower line bounds the demand.
        if horizon >= max(task.deadline for task in tasks):
            slope = sum(share * each for share, each in zip(shares, spare, strict=True))
        most = max(most, slope - (1 - load) * horizon)
    return overheads.blocking + late + most


def _most_excess(tasks: Sequence[Task], services: Sequence[int], late: int, horizon: int) -> float:
    """Return the greatest excess of the demand over the time at the deadlines up to `horizon`."""
    times, demands = [], []
    for task, service in zip(tasks, services, strict=True):
        releases = np.arange(0, horizon - task.deadline + late + 1, task.period)
        times.append(task.deadline + np.maximum(releases - late, 0))
        demands.append(np.full(releases.size, service))
    time, demand = np.concatenate(times), np.concatenate(demands)
    order = np.argsort(time, kind="stable")
    # Among equal deadlines, only the last sum is the demand; the earlier sums are smaller and do not affect the
    # maximum.
    excess = np.cumsum(demand[order]) - time[order]
    return float(excess.max()) if excess.size else -inf


def edf_by_counting(task: Task, others: Sequence[Task], overheads: Overheads) -> int:
    """Return a bound under EDF at any load by counting the other requesters' tasks that may have earlier deadlines.

    For each requester, these are the waiting task, and the tasks that arrive early enough to have a deadline that is
    not later.
    """
    wait = overheads.acceptance + overheads.blocking
    for other in others:
        window = task.deadline - other.deadline + overheads.acceptance
        wait += _requests(window, other.period) * (overheads.service(other) + overheads.resume)
    return wait + overheads.service(task)


def lst_by_counting(task: Task, others: Sequence[Task], overheads: Overheads) -> int:
    """Return a bound under LST at any load, by counting as under EDF.

    The slack of a waiting task decreases in every cycle, so a task that arrives late enough never has less slack. While
    a task is being sent, its slack is constant and the slack of other tasks decreases, which extends the window in
    which other tasks are counted.
    """
    wait = overheads.acceptance + overheads.blocking
    own = _interrupted_service(task, overheads)
    for other in others:
        window = task.deadline - other.deadline + other.transfer_time + own + overheads.acceptance
        wait += _requests(window, other.period) * _interrupted_service(other, overheads)
    return wait + own


def lst_by_demand(tasks: Sequence[Task], overheads: Overheads) -> float:
    """Return the greatest lateness of any task under LST, which is optimal like EDF (A. Mok, 1983).

    Optimality requires that the task with the least slack runs in every cycle. In hardware, a run lasts some cycles
    longer, and each other task may delay the late task by these cycles.
    """
    stretched = [Task(task.name, task.period, _interrupted_service(task, overheads), task.deadline) for task in tasks]
    bare = Overheads(overheads.decision, overheads.acceptance, overheads.shortest_run, 0, overheads.shortest_service)
    too_long = (len(tasks) - 1) * (overheads.blocking + overheads.decision)
    return edf_by_demand(stretched, bare) + overheads.resume + too_long


def _interrupted_service(task: Task, overheads: Overheads) -> int:
    """Return the number of cycles of a task with as many interruptions as possible; each costs a resumption."""
    runs = -(-task.transfer_time // max(1, overheads.shortest_run))
    return overheads.service(task) + (runs - 1) * overheads.resume


def _requests(window: int, period: int) -> int:
    """Return the number of a requester's tasks: a waiting task, and the tasks that arrive in `window` cycles."""
    return 1 + (window // period + 1 if window >= 0 else 0)


def _load(tasks: Sequence[Task], overheads: Overheads) -> float:
    return sum((overheads.service(task) + overheads.resume) / task.period for task in tasks)


def _start(before: int, higher: Sequence[Task], overheads: Overheads) -> int | None:
    """Return the start of a task that cannot be interrupted, even by a request of higher priority in that cycle."""
    return _fixed_point(before, higher, overheads, before=1)


def _fixed_point(
    first: int, tasks: Sequence[Task], overheads: Overheads, before: int = 0, after: int = 0
) -> int | None:
    """Return the least w = first + the service of all requests in w cycles, with simultaneous first requests.

    Further requests follow with their periods. `before` widens the window in which requests count, and `after`
    lengthens each service. The result is None if there is no such w.
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
