"""Priorities, buffers and the choice of a policy."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from fusesoc_firm.scheduling import area
from fusesoc_firm.scheduling.analysis import (
    Channel,
    Choice,
    Criterion,
    analyse,
    assign_priorities,
    choose,
    luts,
    overheads_of,
    utilisation,
)
from fusesoc_firm.scheduling.area import Area
from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.scheduling.response import Overheads, fixed_priority, fixed_priority_preemptive
from fusesoc_firm.scheduling.tasks import Task

CAMERA = Task("camera", 100_000, 60_000, 100_000)
IMU = Task("imu", 10_000, 100, 1_000)
ARM = Task("arm", 20_000, 500, 20_000)
ROBOT = (CAMERA, IMU, ARM)


@pytest.fixture
def areas(monkeypatch: pytest.MonkeyPatch) -> None:
    """The LUTs of each policy, and a Manager whose bursts need none."""
    known = dict(zip(POLICIES, (34, 54, 30, 570, 304, 565, 726), strict=True))
    known |= dict.fromkeys((area.MANAGER, area.MANAGER_PREEMPTIVE), 100)
    monkeypatch.setattr(area, "measured", lambda: {(design, 4): Area(lut, 10) for design, lut in known.items()})


def test_utilisation_is_equation_4_1() -> None:
    assert utilisation(ROBOT) == pytest.approx(0.6 + 0.01 + 0.025)


def test_deadline_monotonic_where_it_is_optimal() -> None:
    order = assign_priorities("fixed_priority_preemptive", ROBOT, Overheads(decision=1, shortest_run=1, resume=1))
    assert [task.name for task in order] == ["imu", "arm", "camera"]


def test_audsley_finds_what_deadline_monotonic_does_not() -> None:
    """By deadlines, 'a' stands before 'c' and one of them is late."""
    a, b, c = Task("a", 12, 3, 9), Task("b", 8, 4, 7), Task("c", 11, 2, 9)
    free = Overheads()
    assert assign_priorities("fixed_priority", (a, b, c), free) == (b, c, a)
    assert (fixed_priority(c, [b], [a], free) or 99) <= 9
    assert (fixed_priority(a, [b, c], [], free) or 99) <= 9
    assert (fixed_priority(c, [b, a], [], free) or 99) > 9


def test_audsley_with_preemption_and_long_deadlines() -> None:
    a, b, c = Task("a", 12, 4, 14), Task("b", 12, 1, 17), Task("c", 8, 4, 14)
    free = Overheads()
    assert assign_priorities("fixed_priority_preemptive", (a, b, c), free) == (a, b, c)
    assert (fixed_priority_preemptive(c, [a, b], free) or 99) <= 14
    assert (fixed_priority_preemptive(b, [a, c], free) or 99) > 17


def test_a_long_frame_blocks_who_cannot_interrupt_it(areas: None) -> None:
    blocked = analyse("fixed_priority", ROBOT)
    assert not blocked.is_schedulable and blocked.all_finish
    assert (blocked.latest.task, blocked.latest.lateness) == (IMU, 60_000 + 100 - 1_000)
    interrupting = analyse("fixed_priority_preemptive", ROBOT)
    assert interrupting.is_schedulable
    assert interrupting.priorities == ("imu", "arm", "camera")
    # One run of one beat, its resumption; then its own.
    assert interrupting.bounds[1].response == 2 + 100


def test_the_buffer_holds_what_comes_while_a_task_is_late() -> None:
    camera = Task("camera", 100_000, 59_950, 100_000)
    bound = analyse("fixed_priority", (camera, IMU), Channel(beat_bytes=4)).bounds[1]
    # Five more messages, and one whose beats have all come; behind the end of the period it would be half of it.
    assert bound.lateness == 59_050
    assert bound.buffer == 4 * (5 * 100 + 100)
    assert analyse("fixed_priority_preemptive", ROBOT).buffer == 0


def test_a_buffer_is_never_more_than_the_lateness() -> None:
    tasks = (Task("a", 50, 40, 50), Task("b", 60, 40, 60), Task("c", 70, 40, 70))
    for bound in analyse("lru", tasks).bounds:
        assert bound.lateness is not None and bound.lateness > 0
        assert bound.buffer is not None and 0 < bound.buffer <= bound.lateness


@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy_can_be_analysed(policy: str) -> None:
    for count in (1, 2, 9, 17, 256):
        tasks = [Task(f"t{k}", 100_000 + k, 100 + k, 50_000) for k in range(count)]
        found = analyse(policy, tasks)
        assert [bound.task for bound in found.bounds] == tasks
        assert found.is_schedulable == (found.worst_lateness <= 0)
        # A task cannot be faster than its own beats.
        assert all(bound.response is not None and bound.response > bound.task.transfer_time for bound in found.bounds)


def test_a_queue_takes_requests_in_one_after_the_other() -> None:
    assert overheads_of("edf_latency", 8).acceptance == 0
    assert overheads_of("edf_latency", 9).acceptance > 9
    assert overheads_of("edf_resources", 9).acceptance > overheads_of("edf_latency", 9).acceptance
    assert overheads_of("lru", 16).acceptance == 0 < overheads_of("lru", 17).acceptance
    assert overheads_of("fixed_priority", 256).acceptance == 0


def test_the_cheapest_that_holds_all_deadlines(areas: None) -> None:
    choice = choose(ROBOT)
    assert choice.best.policy == "fixed_priority_preemptive"
    holding = [analysis.policy for analysis in choice.analyses if analysis.is_schedulable]
    assert holding == ["fixed_priority_preemptive", "edf_resources", "edf_latency"]
    assert "All deadlines are met with 3 of 7 policies." in choice.reasons
    assert "the fewest LUTs of these policies, 54 (measured, with the Manager's bursts)" in choice.reasons[2]
    assert choice.reasons[3].startswith(
        "List the publishers in the specification in the order of priority: imu, arm, camera."
    )


def test_lst_needs_longer_runs() -> None:
    """Two tasks of equal slack interrupt each other after every run, and each of these costs a beat."""
    assert not analyse("lst", ROBOT).is_schedulable
    assert analyse("lst", ROBOT, Channel(shortest_run=16)).is_schedulable


def test_the_smallest_worst_lateness(areas: None) -> None:
    tight = (Task("a", 20, 5, 20), Task("b", 30, 9, 30), Task("c", 40, 13, 40))
    choice = choose(tight, Criterion.LATENESS)
    worst = [analysis.worst_lateness for analysis in choice.analyses]
    assert worst == sorted(worst)
    assert "has the smallest worst lateness" in choice.reasons[2]


def test_nobody_may_starve(areas: None) -> None:
    too_much = (Task("a", 10, 8, 10), Task("b", 20, 15, 20), Task("c", 1_000, 10, 1_000))
    choice = choose(too_much, Criterion.FINISH)
    assert choice.reasons[0] == (
        "The publishers request 156.0 % of the channel. The channel is overloaded: each sends less often than its "
        "period allows."
    )
    assert choice.best.all_finish
    assert not choice.analyses[-1].all_finish
    assert {analysis.policy for analysis in choice.analyses if not analysis.all_finish} == {
        "fixed_priority",
        "fixed_priority_preemptive",
    }
    assert choose(too_much).reasons[1] == "No policy is guaranteed to meet all deadlines."


def test_luts_are_those_of_the_next_measured_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(area, "measured", lambda: {("lru", 8): Area(80, 40), ("lru", 256): Area(1600, 360)})
    assert [luts("lru", number) for number in (2, 8, 9)] == [80, 80, 1600]
    assert luts("lru", 257) is None
    assert luts("lst", 8) is None


def test_bursts_count_with_a_policy_that_interrupts(monkeypatch: pytest.MonkeyPatch) -> None:
    areas = {
        ("fixed_priority", 8): Area(20, 5),
        ("fixed_priority_preemptive", 8): Area(14, 4),
        (area.MANAGER, 8): Area(100, 50),
        (area.MANAGER_PREEMPTIVE, 8): Area(123, 70),
    }
    monkeypatch.setattr(area, "measured", lambda: areas)
    assert luts("fixed_priority", 3) == 20
    assert luts("fixed_priority_preemptive", 3) == 14 + 23
    assert "fewest LUTs of these policies, 37 (measured, with the Manager's bursts)" in choose(ROBOT).reasons[2]
    for design in (area.MANAGER, area.MANAGER_PREEMPTIVE):
        others = {key: each for key, each in areas.items() if key[0] != design}
        monkeypatch.setattr(area, "measured", lambda others=others: others)
        assert luts("fixed_priority_preemptive", 3) is None


@pytest.mark.parametrize(
    ("make", "fault"),
    [
        (lambda: choose([]), "at least one task is required"),
        (lambda: choose([IMU, IMU]), "task names must be unique"),
    ],
)
def test_bad_tasks(make: Callable[[], Choice], fault: str) -> None:
    with pytest.raises(ValueError, match=fault):
        make()
