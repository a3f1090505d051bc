"""Response-time analyses of examples from books and papers, with schedulers without overheads."""

from __future__ import annotations

from math import inf

import pytest

from fusesoc_firm.scheduling import response
from fusesoc_firm.scheduling.response import Overheads
from fusesoc_firm.scheduling.tasks import Task

FREE = Overheads()


def task(period: int, transfer_time: int, deadline: int | None = None, name: str = "t") -> Task:
    return Task(name, period, transfer_time, deadline or period)


def test_preemptive_fixed_priority_of_burns_and_wellings() -> None:
    """A. Burns, A. Wellings, Real-Time Systems and Programming Languages, chapter on scheduling: R = 3, 6, 20."""
    tasks = [task(7, 3), task(12, 3), task(20, 5)]
    found = [response.fixed_priority_preemptive(each, tasks[:place], FREE) for place, each in enumerate(tasks)]
    assert found == [3, 6, 20]


def test_non_preemptive_fixed_priority_of_davis() -> None:
    """R. Davis et al., 2007, table 1, in units of 50 us: the second task of the lowest message is the worst one."""
    tasks = [task(50, 20, 50), task(70, 20, 65), task(70, 20, 65)]
    found = [response.fixed_priority(each, tasks[:place], tasks[place + 1 :], FREE) for place, each in enumerate(tasks)]
    assert found == [40, 60, 70]


def test_demand_of_buttazzo() -> None:
    """G. Buttazzo, Hard Real-Time Computing Systems, section 4.6: schedulable, and in 7 units just so."""
    tasks = [task(6, 2, 4), task(8, 2, 5), task(9, 3, 7)]
    assert response.edf_by_demand(tasks, FREE) == 0
    tasks[2] = task(9, 4, 7)
    assert response.edf_by_demand(tasks, FREE) > 0


def test_demand_of_a_full_channel() -> None:
    """Liu and Layland, 1973: with implicit deadlines EDF holds them up to a utilisation of 1 (equation 4.1)."""
    full = [task(2, 1), task(3, 1), task(6, 1)]
    assert response.edf_by_demand(full, FREE) == 0
    assert response.edf_by_demand([*full, task(1000, 1)], FREE) == inf
    # Long deadlines are not missed by much; short ones are by as much as they are shorter.
    assert response.edf_by_demand([task(2, 1, 7), task(2, 1, 9)], FREE) <= -5
    assert response.edf_by_demand([task(4, 3, 1)], FREE) == 2


def test_demand_is_bounded_where_there_are_too_many_deadlines(monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = [task(6, 2, 4), task(8, 2, 5), task(9, 3, 7)]
    monkeypatch.setattr(response, "_MOST_DEADLINES", 1)
    assert 0 <= response.edf_by_demand(tasks, FREE) < 3


def test_fixed_priorities_may_starve() -> None:
    assert response.fixed_priority_preemptive(task(100, 1), [task(4, 2), task(6, 3)], FREE) is None
    assert response.fixed_priority(task(100, 1), [task(4, 2), task(6, 3)], [], FREE) is None
    # Together they are too much, but the higher one alone leaves time: the other one is served, if not often enough.
    # Without preemption its own last task may have kept the higher one waiting.
    assert response.fixed_priority(task(10, 6), [task(10, 5)], [], FREE) == 6 + 2 * 5 + 6
    assert response.fixed_priority_preemptive(task(10, 6), [task(10, 5)], FREE) == 16


def test_everybody_has_a_turn_before() -> None:
    tasks = [task(10, 3), task(10, 5), task(10, 7)]
    assert response.taking_turns(tasks[0], tasks[1:], FREE) == 15
    assert response.taking_turns(tasks[0], tasks[1:], Overheads(decision=1)) == 16


def test_counting_bounds_edf_in_an_overload() -> None:
    others = [task(10, 8, 20), task(10, 8, 100)]
    # Of the first: the one that is there, and those that come in the first 30 - 20 cycles, ends included.
    assert response.edf_by_counting(task(30, 5, 30), others, FREE) == 5 + 3 * 8 + 8


@pytest.mark.parametrize(
    ("overheads", "blocking"),
    [
        (Overheads(), 0),
        (Overheads(decision=1), 1),
        (Overheads(decision=1, shortest_run=4), 4),
        (Overheads(decision=2, shortest_run=4, resume=1), 6),
    ],
)
def test_blocking_by_a_run(overheads: Overheads, blocking: int) -> None:
    assert overheads.blocking == blocking


def test_a_preemption_costs_a_resumption() -> None:
    high, low = task(10, 2), task(100, 10)
    assert response.fixed_priority_preemptive(low, [high], FREE) == 14
    assert response.fixed_priority_preemptive(low, [high], Overheads(resume=1)) == 10 + 2 * 3


@pytest.mark.parametrize("key", ["period", "transfer_time", "deadline"])
def test_a_time_is_a_cycle_at_least(key: str) -> None:
    with pytest.raises(ValueError, match=f"{key} of 'x' is 0; legal: 1 or more cycles"):
        Task("x", *(0 if each == key else 1 for each in ("period", "transfer_time", "deadline")))
