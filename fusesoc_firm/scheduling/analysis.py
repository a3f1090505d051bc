"""The analysis of policies for a set of tasks: bounds on response and lateness, buffers, and the best policy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from math import floor, inf

from fusesoc_firm.scheduling import area, response
from fusesoc_firm.scheduling.area import Areas
from fusesoc_firm.scheduling.policies import POLICIES, Order
from fusesoc_firm.scheduling.response import Overheads
from fusesoc_firm.scheduling.tasks import Task


class Criterion(StrEnum):
    """The criterion by which the best policy is chosen."""

    LUTS = "luts"
    LATENESS = "lateness"
    FINISH = "finish"


@dataclass(frozen=True)
class Bound:
    """The bounds for a task, in cycles; None means that there is no bound, so the task may never be served.

    `buffer` is the number of bytes that the accelerator may have to store while the task is late (section 6.3.2).
    """

    task: Task
    response: int | None
    buffer: int | None

    @property
    def lateness(self) -> int | None:
        """The longest time in cycles from deadline to end; negative if the task always ends in time (equation 4.5)."""
        return None if self.response is None else self.response - self.task.deadline


@dataclass(frozen=True)
class Analysis:
    """The results of the analysis of a policy; `bounds` are in the order of the tasks.

    `priorities` are the tasks' names, the highest priority first, if the policy has fixed priorities. `lut` is None if
    it is unknown.
    """

    policy: str
    bounds: tuple[Bound, ...]
    priorities: tuple[str, ...] = ()
    lut: int | None = None

    @property
    def all_finish(self) -> bool:
        """Whether no task can starve."""
        return all(bound.response is not None for bound in self.bounds)

    @property
    def is_schedulable(self) -> bool:
        """Whether no task can miss its deadline."""
        return self.worst_lateness <= 0

    @property
    def worst_lateness(self) -> float:
        """The greatest bound on the lateness of any task; infinite if a task may starve."""
        return max(inf if bound.lateness is None else bound.lateness for bound in self.bounds)

    @property
    def latest(self) -> Bound:
        """The bound of the task with the greatest bound on lateness."""
        return max(self.bounds, key=lambda bound: inf if bound.lateness is None else bound.lateness)

    @property
    def buffer(self) -> int | None:
        """The total size of all buffers in bytes; None if a buffer has no bound."""
        sizes = [bound.buffer for bound in self.bounds]
        return None if None in sizes else sum(size for size in sizes if size is not None)


@dataclass(frozen=True)
class Channel:
    """The resource that the tasks share: the bytes in a beat, and the shortest run in beats before an interruption."""

    beat_bytes: int = 1
    shortest_run: int = 1


def utilisation(tasks: Sequence[Task]) -> float:
    """Return the channel's utilisation by the tasks (equation 4.1)."""
    return sum(task.transfer_time / task.period for task in tasks)


def overheads_of(policy: str, requesters: int, shortest_run: int = 1) -> Overheads:
    """Return the overheads of the core of a policy (cores/sched).

    A scheduler that chooses among all requests at once needs one cycle, or two if it compares times. A scheduler with a
    queue needs three, and accepts one request in each cycle. Each request may cause three operations of the queue: the
    request is inserted, the interrupted task is inserted, and the next task is removed. In a heap, each operation takes
    two cycles.
    """
    row = POLICIES[policy]
    # A single task is never interrupted.
    run, resume = (shortest_run, 1) if row.is_preemptive and requesters > 1 else (0, 0)
    if requesters <= row.most_at_once:
        return Overheads(2 if row.has_deadlines else 1, 0, run, resume)
    return Overheads(3, 3 * row.queue_cycles * requesters + 8, run, resume, shortest_service=4)


def analyse(policy: str, tasks: Sequence[Task], channel: Channel = Channel(), *, is_ordered: bool = False) -> Analysis:
    """Return the bounds under a policy; with fixed priorities, under the best known assignment.

    If `is_ordered` is set, the tasks are in the order of their priorities, the highest first.

    The bounds are valid for the cycle-exact models of the cores with a sink that accepts every beat. Tests compare the
    bounds with simulations.
    """
    overheads = overheads_of(policy, len(tasks), channel.shortest_run)
    order: Sequence[Task] = ()
    if POLICIES[policy].order is Order.PRIORITY:
        order = tasks if is_ordered else assign_priorities(policy, tasks, overheads)
        by_name = {
            task.name: _fixed(policy, task, order[:place], order[place + 1 :], overheads)
            for place, task in enumerate(order)
        }
        responses = [by_name[task.name] for task in tasks]
    else:
        responses = _RESPONSES[POLICIES[policy].order](tasks, overheads)
    bounds = tuple(
        Bound(task, found, _buffer(task, found, channel)) for task, found in zip(tasks, responses, strict=True)
    )
    return Analysis(policy, bounds, tuple(task.name for task in order), luts(policy, len(tasks)))


def luts(policy: str, requesters: int) -> int | None:
    """Return the LUTs of a scheduler, plus the Manager's LUTs for bursts if the scheduler is preemptive.

    The values are measured. The result is None if one is missing.
    """
    measured = area.measured()
    scheduler = area.at(measured, policy, requesters)
    bursts = _burst_luts(measured, requesters) if POLICIES[policy].is_preemptive else 0
    return None if scheduler is None or bursts is None else scheduler.lut + bursts


def _burst_luts(measured: Areas, requesters: int) -> int | None:
    """Return the Manager's LUTs for bursts: a difference between two synthesis results, which may be negative."""
    bursts, whole = (area.at(measured, design, requesters) for design in (area.MANAGER_PREEMPTIVE, area.MANAGER))
    return bursts.lut - whole.lut if bursts and whole else None


def _buffer(task: Task, response: int | None, channel: Channel) -> int | None:
    """Return the number of bytes that arrive while a task is late: data of later requests, at most a beat per cycle.

    The result never exceeds the rule of section 6.3.2: one byte for each cycle of the greatest lateness.
    """
    if response is None:
        return None
    late = max(0, response - task.deadline)
    whole, rest = divmod(late, task.period)
    return (whole * task.transfer_time + min(rest, task.transfer_time)) * channel.beat_bytes


# --- Priorities --------------------------------------------------------------------------------------------------


def assign_priorities(policy: str, tasks: Sequence[Task], overheads: Overheads) -> tuple[Task, ...]:
    """Return the tasks in the order of their assigned priorities, the highest first.

    Deadline monotonic is optimal with preemption if no deadline is longer than its period (J. Leung and J. Whitehead,
    1982). Otherwise, priorities are assigned in ascending order: each is assigned to a task that meets its deadline at
    this priority (N. Audsley, 1991). If several tasks meet their deadlines, or none does, the task with the longest
    deadline gets the priority.
    """
    by_deadline = sorted(tasks, key=lambda task: task.deadline)
    if POLICIES[policy].is_preemptive and all(task.deadline <= task.period for task in tasks):
        return tuple(by_deadline)
    left = by_deadline
    assigned: list[Task] = []
    while left:
        lowest = next((task for task in reversed(left) if _meets(policy, task, left, assigned, overheads)), left[-1])
        left = [task for task in left if task is not lowest]
        assigned.append(lowest)
    return tuple(reversed(assigned))


def _meets(policy: str, task: Task, left: Sequence[Task], lower: Sequence[Task], overheads: Overheads) -> bool:
    higher = [other for other in left if other is not task]
    found = _fixed(policy, task, higher, lower, overheads)
    return found is not None and found <= task.deadline


def _fixed(policy: str, task: Task, higher: Sequence[Task], lower: Sequence[Task], overheads: Overheads) -> int | None:
    if POLICIES[policy].is_preemptive:
        return response.fixed_priority_preemptive(task, higher, overheads)
    return response.fixed_priority(task, higher, lower, overheads)


# --- Dynamic priorities ------------------------------------------------------------------------------------------


def _others(task: Task, tasks: Sequence[Task]) -> list[Task]:
    return [other for other in tasks if other is not task]


def _turns(tasks: Sequence[Task], overheads: Overheads) -> list[int | None]:
    return [response.taking_turns(task, _others(task, tasks), overheads) for task in tasks]


def _deadlines(
    by_demand: Callable[[Sequence[Task], Overheads], float],
    by_counting: Callable[[Task, Sequence[Task], Overheads], int],
    tasks: Sequence[Task],
    overheads: Overheads,
) -> list[int | None]:
    lateness = by_demand(tasks, overheads)
    return [_least(task, lateness, by_counting(task, _others(task, tasks), overheads)) for task in tasks]


def _least(task: Task, lateness: float, counted: int) -> int:
    """Return the smaller of a task's two response bounds: one from a bound on any task's `lateness`, and `counted`."""
    return counted if lateness == inf else min(task.deadline + floor(lateness), counted)


_RESPONSES: Mapping[Order, Callable[[Sequence[Task], Overheads], list[int | None]]] = {
    Order.TURNS: _turns,
    Order.DEADLINE: partial(_deadlines, response.edf_by_demand, response.edf_by_counting),
    Order.SLACK: partial(_deadlines, response.lst_by_demand, response.lst_by_counting),
    Order.OTHER: lambda tasks, _: [None] * len(tasks),
}


# --- The choice --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Choice:
    """All analysed policies, the best one first, with the reasons for the choice."""

    criterion: Criterion
    utilisation: float
    analyses: tuple[Analysis, ...]
    reasons: tuple[str, ...]

    @property
    def best(self) -> Analysis:
        """The analysis of the chosen policy."""
        return self.analyses[0]


def choose(
    tasks: Sequence[Task],
    criterion: Criterion = Criterion.LUTS,
    channel: Channel = Channel(),
    *,
    is_ordered: bool = False,
) -> Choice:
    """Choose the best policy, with `is_ordered` as in `analyse`.

    Raise `ValueError` if tasks are missing or share a name.
    """
    if not tasks:
        raise ValueError("at least one task is required")
    if len({task.name for task in tasks}) < len(tasks):
        raise ValueError("task names must be unique")
    analyses = sorted(
        (analyse(policy, tasks, channel, is_ordered=is_ordered) for policy in POLICIES), key=_RANKS[criterion]
    )
    load = utilisation(tasks)
    names = tuple(task.name for task in tasks)
    return Choice(criterion, load, tuple(analyses), tuple(_reasons(analyses, criterion, load, names)))


def _luts_rank(analysis: Analysis) -> float:
    return inf if analysis.lut is None else analysis.lut


# The policies that meet all deadlines precede the policies that finish all tasks; within each group, the criterion
# decides.
_RANKS: Mapping[Criterion, Callable[[Analysis], tuple[float, ...]]] = {
    Criterion.LUTS: lambda each: (
        not each.is_schedulable,
        not each.all_finish,
        _luts_rank(each),
        each.worst_lateness,
    ),
    Criterion.LATENESS: lambda each: (not each.all_finish, each.worst_lateness, _luts_rank(each)),
    Criterion.FINISH: lambda each: (not each.all_finish, _luts_rank(each), each.worst_lateness),
}


def _reasons(analyses: Sequence[Analysis], criterion: Criterion, load: float, names: tuple[str, ...]) -> list[str]:
    best = analyses[0]
    found = [f"The publishers request {100 * load:.1f} % of the channel."]
    if load > 1:
        found[0] += " The channel is overloaded: each sends less often than its period allows."
    holding = [each for each in analyses if each.is_schedulable]
    finishing = [each for each in analyses if each.all_finish]
    if criterion is Criterion.FINISH:
        found.append(f"All publishers finish with {len(finishing)} of {len(analyses)} policies.")
    elif holding:
        found.append(f"All deadlines are met with {len(holding)} of {len(analyses)} policies.")
    else:
        found.append("No policy is guaranteed to meet all deadlines.")
    found.append(f"{best.policy} {_MERITS[criterion](best)}")
    if best.priorities == names:
        found.append("The priorities match the order of the publishers in the specification.")
    elif best.priorities:
        found.append(
            f"List the publishers in the specification in the order of priority: {', '.join(best.priorities)}."
        )
    return found


def _lut_words(analysis: Analysis) -> str:
    if analysis.lut is None:
        return "needs an unknown number of LUTs"
    source = "measured, with the Manager's bursts" if POLICIES[analysis.policy].is_preemptive else "measured"
    return f"needs the fewest LUTs of these policies, {analysis.lut} ({source})"


_MERITS: Mapping[Criterion, Callable[[Analysis], str]] = {
    Criterion.LUTS: lambda best: f"{_lut_words(best)}; {end_of(best)}",
    Criterion.LATENESS: lambda best: f"has the smallest worst lateness: {end_of(best)}",
    Criterion.FINISH: lambda best: f"{_lut_words(best)}; {end_of(best)}",
}


def end_of(analysis: Analysis) -> str:
    """Return a phrase for the greatest lateness relative to the deadline."""
    latest = analysis.latest
    name, lateness = latest.task.name, latest.lateness
    if lateness is None:
        return f"'{name}' may never be served."
    if lateness <= 0:
        return f"'{name}' ends closest to its deadline, {-lateness} cycles early."
    return f"'{name}' may end {lateness} cycles after its deadline."
