"""The reasons in docs/explanation/scheduler-differences.md: the large data set, by other models.

Each claim of the page that rests on an experiment is one here, with the page's seed and all 200 sets.
"""

from __future__ import annotations

import numpy as np
import pytest

from fusesoc_firm.scheduling.evaluation.jobs import model_of
from fusesoc_firm.scheduling.evaluation.metrics import measure
from fusesoc_firm.scheduling.evaluation.simulation import Flags, SchedulerModel, simulate
from fusesoc_firm.scheduling.evaluation.workloads import DATA_SETS, Times, Workload, draw
from fusesoc_firm.scheduling.models import Generics, Scheduler
from tools.dissertation.published import dissertation

pytestmark = pytest.mark.thorough

SEED = 1
LARGE = DATA_SETS["large"]
NEVER = np.iinfo(np.int64).max


class LosingCycles:
    """A scheduler whose grant is seen some cycles later whenever it moves, and after each task."""

    def __init__(self, model: SchedulerModel, cycles: int) -> None:
        self._model = model
        self._cycles = cycles
        self._left = np.full(len(model.grant_valid), cycles)

    @property
    def grant_valid(self) -> Flags:
        is_seen: Flags = self._model.grant_valid & (self._left == 0)
        return is_seen

    @property
    def grant_select(self) -> Times:
        return self._model.grant_select

    def step(self, request: Flags, beat: Flags, last: Flags) -> None:
        was_valid, was_granted = self._model.grant_valid, self._model.grant_select
        self._model.step(request, beat, last)
        begins = (self._model.grant_select != was_granted) | (beat & last) | (self._model.grant_valid & ~was_valid)
        self._left = np.where(begins, self._cycles, np.maximum(self._left - was_valid, 0))


class Ideal(Scheduler):
    """EDF or LST that knows of each request at once and decides in every cycle.

    Of a new request, some can take the grant for some beats whatever their deadline is: `interrupting` is 'nobody',
    'everybody', or 'lower', who has a lower index than who sends.
    """

    BEATS = 2

    def __init__(self, generics: Generics, interrupting: str, *, is_lst: bool) -> None:
        super().__init__(generics.batch, generics.requesters)
        assert generics.transfer_times is not None
        self._offsets = generics.periods - generics.transfer_times * is_lst
        self._is_lst = is_lst
        self._interrupting = interrupting
        self._time = 0
        self._keys = np.full(self._offsets.shape, NEVER)
        self._known = np.zeros(self._offsets.shape, np.bool_)
        self._guest = np.zeros(self.batch, np.int64)
        self._left = np.zeros(self.batch, np.int64)

    def step(self, request: Flags, beat: Flags, last: Flags) -> None:
        granted = self.grant_select
        eligible = self._without_granted(request, beat & last)
        new = eligible & ~self._known
        self._known = eligible
        self._keys = np.where(new, self._time + self._offsets, self._keys)
        self._keys[self._members, granted] += beat & self._is_lst
        self._time += 1
        # Of equal keys, that of who sends is the smaller one.
        ranks = np.where(eligible, 2 * self._keys + 1, NEVER)
        ranks[self._members, granted] -= eligible[self._members, granted]
        choice = np.where(self._is_guest(new, eligible, beat), self._guest, ranks.argmin(axis=1))
        self._grant(choice, np.asarray(eligible.any(axis=1)))

    def _is_guest(self, new: Flags, eligible: Flags, beat: Flags) -> Flags:
        """Where a new request has the grant."""
        self._left = np.maximum(self._left - beat, 0)
        if self._interrupting != "nobody":
            first = new.argmax(axis=1)
            comes = new.any(axis=1) & ((self._interrupting == "everybody") | (first < self.grant_select))
            self._guest = np.where(comes, first, self._guest)
            self._left = np.where(comes, self.BEATS, self._left)
        is_guest: Flags = (self._left > 0) & eligible[self._members, self._guest]
        self._left = np.where(is_guest, self._left, 0)
        return is_guest


def average_response(model: SchedulerModel, workload: Workload) -> float:
    found = measure(simulate(model, workload, LARGE.cycles)).means()["response_avg"]
    print(f"seed {SEED}: {found:.1f}")
    return found


def ideal(requesters: int, policy: str, interrupting: str) -> float:
    workload = draw(LARGE, requesters, SEED)
    generics = Generics(workload.deadlines, workload.transfer_times)
    return average_response(Ideal(generics, interrupting, is_lst=policy == "lst"), workload)


def losing(requesters: int, policy: str, cycles: int) -> float:
    workload = draw(LARGE, requesters, SEED)
    return average_response(LosingCycles(model_of(policy, workload), cycles), workload)


@pytest.mark.parametrize("requesters", [4, 8, 16])
@pytest.mark.parametrize(("policy", "cycles"), [("lru", 4), ("edf_resources", 3)])
def test_cycles_lost_at_each_grant_give_the_dissertations_response(policy: str, cycles: int, requesters: int) -> None:
    theirs = dissertation().response_time[policy][requesters][1]
    assert losing(requesters, policy, cycles) == pytest.approx(theirs, rel=0.03)
    assert losing(requesters, policy, 0) < 0.97 * theirs


@pytest.mark.parametrize(
    ("policy", "requesters"), [("fixed_priority_preemptive", 8), ("fixed_priority_preemptive", 16), ("lst", 256)]
)
def test_all_granted_tasks_give_the_dissertations_greatest_response(policy: str, requesters: int) -> None:
    """With completed tasks alone, as equation 4.4 has it, it is far less."""
    workload = draw(LARGE, requesters, SEED)
    trace = simulate(model_of(policy, workload), workload, LARGE.cycles)
    theirs = dissertation().response_time[policy][requesters][2]
    tasks = trace.tasks
    response = tasks.grant - tasks.arrival
    completed = np.mean([response[tasks.is_finished & (tasks.set == each)].max() for each in range(workload.sets)])
    assert measure(trace).means()["response_max"] == pytest.approx(theirs, rel=0.15)
    assert completed < 0.87 * theirs


@pytest.mark.parametrize("requesters", [4, 8, 16])
@pytest.mark.parametrize("policy", ["edf_latency", "lst"])
def test_some_interrupting_requests_give_the_dissertations_response(policy: str, requesters: int) -> None:
    """Neither none of them nor all."""
    theirs = dissertation().response_time[policy][requesters][1]
    assert ideal(requesters, policy, "nobody") > 1.8 * theirs
    assert ideal(requesters, policy, "lower") == pytest.approx(theirs, rel=0.5)
    assert ideal(requesters, policy, "everybody") < 0.05 * theirs


def test_resources_edf_of_the_dissertation_begins_late_and_is_not_interrupted() -> None:
    """Time from the first grant to the end, lateness - response + mean deadline: ROEDF's is hardly more than a task."""
    facts = dissertation()
    deadline = LARGE.transfer_time + LARGE.frequency
    for policy, least, most in (("edf_resources", 100, 130), ("edf_latency", 220, 800), ("lst", 230, 800)):
        for number in (4, 8, 16):
            after = facts.lateness[policy][number][1] - facts.response_time[policy][number][1] + deadline
            assert least < after < most, (policy, number)
