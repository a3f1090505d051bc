"""Models of schedulers by hand-made examples; tests/cores/test_sched_models.py compares them with hardware."""

from __future__ import annotations

import numpy as np
import pytest

from fusesoc_firm.scheduling.models import Combined, Generics, Scheduler, make_model
from fusesoc_firm.scheduling.policies import POLICIES


def grants(scheduler: Scheduler, tasks: list[list[int]], cycles: int) -> list[list[int]]:
    """The requester with a beat in each cycle, by member of the batch, or -1. Each has one task: start, beats."""
    starts, beats = np.array(tasks).T
    left = np.tile(beats, (scheduler.batch, 1))
    members = np.arange(scheduler.batch)
    seen = []
    for cycle in range(cycles):
        request = (left > 0) & (cycle >= starts)
        granted = scheduler.grant_select
        beat = scheduler.grant_valid & request[members, granted]
        last = left[members, granted] == 1
        left[members, granted] -= beat
        seen.append(np.where(beat, granted, -1).tolist())
        scheduler.step(request, beat, last)
    return seen


def scheduler_of(policy: str, requesters: int = 2, batch: int = 1, shortest_run: int = 1) -> Scheduler:
    times = np.full((batch, requesters), 100)
    return make_model(policy, Generics(times, transfer_times=times // 2, shortest_run=shortest_run))


@pytest.mark.parametrize(
    ("policy", "shortest_run", "expected"),
    [
        # Figure 4.2: the task of 1 runs, then 0 asks.
        ("fixed_priority", 1, [-1, 1, 1, 1, 1, 1, 1, 0, 0, 0, -1]),
        ("fixed_priority_preemptive", 1, [-1, 1, 1, 1, 0, 0, 0, 1, 1, 1, -1]),
        ("fixed_priority_preemptive", 5, [-1, 1, 1, 1, 1, 1, 0, 0, 0, 1, -1]),
        ("lru", 1, [-1, 1, 1, 1, 1, 1, 1, 0, 0, 0, -1]),
    ],
)
def test_preemption(policy: str, shortest_run: int, expected: list[int]) -> None:
    scheduler = scheduler_of(policy, batch=3, shortest_run=shortest_run)
    assert grants(scheduler, [[3, 3], [0, 6]], 11) == [[granted] * 3 for granted in expected]


def test_least_recently_used_and_next_in_the_round_differ() -> None:
    served: dict[str, list[int]] = {}
    for policy in ("lru", "round_robin"):
        scheduler = scheduler_of(policy, 3)
        # 1 and then 0 are served while nobody else asks; then everybody asks. In the round, 0 still has the grant.
        alone = np.eye(3, dtype=bool)
        for requester in (1, 0):
            request = alone[[requester]]
            scheduler.step(request, np.array([False]), np.array([False]))
            scheduler.step(request, np.array([True]), np.array([True]))
        everybody = np.ones((1, 3), dtype=bool)
        served[policy] = []
        for _ in range(4):
            scheduler.step(everybody, np.array([bool(served[policy])]), np.array([True]))
            served[policy].append(int(scheduler.grant_select[0]))
    assert served == {"lru": [2, 1, 0, 2], "round_robin": [0, 1, 2, 0]}


def test_a_combined_scheduler_takes_turns_between_groups() -> None:
    groups = [scheduler_of("fixed_priority", 2), scheduler_of("fixed_priority", 1)]
    combined = Combined(groups, scheduler_of("round_robin"))
    found = grants(combined, [[0, 1], [0, 1], [0, 1]], 6)
    # A group gives its grant in one cycle and gets its own in the next.
    assert found == [[-1], [-1], [0], [2], [1], [-1]]


def test_input_is_left_as_it_was() -> None:
    request = np.ones((1, 2), dtype=bool)
    for policy in POLICIES:
        scheduler = scheduler_of(policy)
        for _ in range(3):
            scheduler.step(request, scheduler.grant_valid.copy(), np.array([True]))
    assert request.all()


@pytest.mark.parametrize("policy", ["edf_resources", "edf_latency", "lst"])
@pytest.mark.parametrize("requesters", [2, 20])
def test_times_that_do_not_fit_are_named(policy: str, requesters: int) -> None:
    periods = np.full((1, requesters), 32)
    with pytest.raises(ValueError, match="time_bits is 8; legal: 9 or more for a deadline of 32 cycles"):
        make_model(policy, Generics(periods, periods, time_bits=8))
    with pytest.raises(ValueError, match="time_bits is 32; legal: 8 to 31"):
        make_model(policy, Generics(periods, periods, time_bits=32))


def test_least_slack_time_needs_transfer_times() -> None:
    with pytest.raises(ValueError, match="transfer_times is None; legal: the beats of each requester's tasks"):
        make_model("lst", Generics(np.full((1, 2), 10)))


def test_illegal_generics_are_named() -> None:
    periods = np.full((2, 3), 10)
    with pytest.raises(ValueError, match=r"deadlines has the shape \(2, 2\); legal: \(batch, requesters\)"):
        Generics(periods, deadlines=np.full((2, 2), 10))
    with pytest.raises(ValueError, match="a time in transfer_times is 0; legal: 1 or more cycles"):
        Generics(periods, transfer_times=periods * 0)
    with pytest.raises(ValueError, match="shortest_run is 0; legal: 1 or more beats"):
        Generics(periods, shortest_run=0)
    with pytest.raises(ValueError, match="requesters is 257; legal: 1 to 256"):
        scheduler_of("fixed_priority", 257)
    with pytest.raises(
        ValueError,
        match="the scheduler has 3 requesters and 2 groups; legal: one group for each",
    ):
        Combined([scheduler_of("lru"), scheduler_of("lru")], scheduler_of("lru", 3))
