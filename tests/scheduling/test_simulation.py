"""Requesters and sink around a scheduler, in cases worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fusesoc_firm.scheduling.evaluation.simulation import Trace, simulate
from fusesoc_firm.scheduling.evaluation.workloads import Times, Workload
from fusesoc_firm.scheduling.models import Generics, make_model
from tests.scheduling.numbers import times
from tools.dissertation.timeline import Recorder


def run(
    transfers: Times,
    pauses: Times,
    cycles: int,
    first: Times | None = None,
    is_preemptive: bool = False,
    resume_beats: int = 0,
) -> Trace:
    workload = Workload(transfers, pauses)
    policy = "fixed_priority_preemptive" if is_preemptive else "fixed_priority"
    model = make_model(policy, Generics(workload.deadlines))
    return simulate(model, workload, cycles, first, resume_beats)


def rows(trace: Trace) -> list[tuple[int, ...]]:
    """(set, requester, arrival, grant, finish, preemptions) of each task."""
    tasks = trace.tasks
    columns = (tasks.set, tasks.requester, tasks.arrival, tasks.grant, tasks.finish, tasks.preemptions)
    return [tuple(int(value) for value in row) for row in zip(*columns, strict=True)]


def test_a_lone_requester_pauses_between_its_tasks() -> None:
    # Request in cycle 4, granted from 5 on, beats in 5 to 7; the next request 4 cycles after edge 8, granted at once.
    trace = run(times([3]), times([4]), 20)
    assert rows(trace) == [(0, 0, 4, 5, 8, 0), (0, 0, 12, 12, 15, 0), (0, 0, 19, 19, -1, 0)]
    assert trace.busy.tolist() == [7]
    # 4 to 7, 12 to 14, 19.
    assert trace.requested.tolist() == [8]


def test_requesters_wait_for_each_other() -> None:
    # Both ask in cycle 0; 1 is granted in the cycle after 0's last beat, in 1 + 3.
    trace = run(times([3, 2]), times([10, 10]), 8, times([0, 0]))
    assert rows(trace) == [(0, 0, 0, 1, 4, 0), (0, 1, 0, 4, 6, 0)]


def test_a_request_that_is_never_granted_is_no_task() -> None:
    trace = run(times([9, 2]), times([1, 1]), 8, times([0, 0]))
    assert rows(trace) == [(0, 0, 0, 1, -1, 0)]


def test_preemption_is_counted_once_for_each_interruption() -> None:
    # 1 begins in cycle 1; 0 asks in 3 and 8, sends in 4, 5 and 8, 9 (its grant came in time); 1 goes on in 6 and 7.
    trace = run(times([2, 8]), times([2, 50]), 20, times([3, 0]), is_preemptive=True)
    assert rows(trace)[0] == (0, 0, 3, 4, 6, 0)
    assert rows(trace)[1] == (0, 0, 8, 9, 11, 0)
    (low,) = [row for row in rows(trace) if row[1] == 1]
    # Beats of 1: cycles 1 to 3, 6 to 8, 11, 12.
    assert low == (0, 1, 0, 1, 13, 2)


def test_a_resumed_run_costs_more_beats() -> None:
    trace = run(times([2, 8]), times([50, 50]), 20, times([3, 0]), is_preemptive=True, resume_beats=3)
    # Beats of 1: 1 to 3; 6, 7, 8 are lost; 9 to 13.
    assert rows(trace) == [(0, 0, 3, 4, 6, 0), (0, 1, 0, 1, 14, 1)]
    assert trace.busy.tolist() == [10]


def test_sets_do_not_touch_each_other() -> None:
    generator = np.random.default_rng(7)
    transfers, pauses = generator.integers(1, 9, (2, 5, 3))
    together = run(transfers, pauses, 300, is_preemptive=True)
    for each in range(5):
        alone = run(transfers[each : each + 1], pauses[each : each + 1], 300, is_preemptive=True)
        assert [row[1:] for row in rows(alone)] == [row[1:] for row in rows(together) if row[0] == each]
        assert alone.busy[0] == together.busy[each]


def test_the_scheduler_sees_requests_that_stay_until_the_last_beat() -> None:
    workload = Workload(times([3, 2]), times([4, 4]))
    model = Recorder(make_model("fixed_priority", Generics(workload.deadlines)))
    simulate(model, workload, 12, times([0, 1]))
    request = "".join("-01b"[int(r[0, 0]) * 1 + int(r[0, 1]) * 2] for r in model.request)
    assert request == "0bbb11--00bb"
    lasts = [cycle for cycle, last in enumerate(model.last) if last[0]]
    assert lasts == [3, 5, 11]
    assert [cycle for cycle, beat in enumerate(model.beat) if beat[0]] == [1, 2, 3, 4, 5, 9, 10, 11]


@pytest.mark.parametrize("cycles", [1, 7])
def test_nothing_is_noted_behind_the_end(cycles: int) -> None:
    trace = run(times([3]), times([1]), cycles)
    assert trace.cycles == cycles
    assert (trace.tasks.finish <= cycles).all()
