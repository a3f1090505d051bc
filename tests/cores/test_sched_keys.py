"""The schedulers of robot:sched that compare keys: what they promise beyond what all do; netlists, illegal generics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fusesoc_firm.scheduling.models.engine import rows_and_columns
from fusesoc_firm.scheduling.policies import POLICIES
from tests.cores.sched_trace import Trace, first_difference, most_overtaken
from tests.cores.schedulers import (
    aggregate,
    analyse_bench,
    analysed,
    model_of,
    timed_generics,
    trace_of,
    wrapper,
)
from tests.hdl.ghdl import Library

TIMED = [policy for policy, entity in POLICIES.items() if entity.has_deadlines]
# Each policy with each way to keep its tasks: in a heap, in a sorted queue, all at once.
LST_IN_HEAP = 20
SIZES = [
    ("edf_resources", 2),
    ("edf_resources", 8),
    ("edf_resources", 20),
    ("edf_latency", 3),
    ("edf_latency", 8),
    ("edf_latency", 20),
    ("lst", 3),
    ("lst", LST_IN_HEAP),
    ("lru", 20),
]
# After reset the heap is cleared.
RESET_CYCLES = 300


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return analysed(tmp_path_factory.mktemp("sched"))


@pytest.mark.one_in(7, 2)
@pytest.mark.parametrize("requesters", [2, 5, 32])
@pytest.mark.parametrize("shortest_run", [2, 7])
@pytest.mark.parametrize("policy", TIMED)
def test_runs_are_those_of_the_model(
    library: Library, tmp_path: Path, policy: str, requesters: int, shortest_run: int
) -> None:
    # Tasks preempt each other seldom where deadlines are far apart, and most seldom after just so many beats.
    trace = trace_of(
        library,
        tmp_path,
        POLICY=policy,
        REQUESTERS=requesters,
        SHORTEST_RUN=shortest_run,
        SEED=1,
        SEGMENTS=10,
        CYCLES=1500,
    )
    assert first_difference(trace, model_of(trace, policy)) == ""
    shortest = _shortest_broken_run(trace)
    assert shortest >= shortest_run
    # Of two, hardly one comes to the other's midst.
    assert shortest == shortest_run or requesters == 2


def _shortest_broken_run(trace: Trace) -> int:
    """The fewest beats in a row after which the grant left a task whose requester showed its next beat."""
    shortest = trace.cycles
    beats = np.zeros(trace.segments, np.int64)
    for cycle in range(trace.cycles - 1):
        beat, select = trace.beat[:, cycle], trace.grant_select[:, cycle]
        beats += beat
        finished = beat & trace.last[:, cycle]
        asks = trace.request(cycle)[np.arange(trace.segments), select]
        left = trace.grant_select[:, cycle + 1] != select
        broken = beats[left & asks & ~finished & (beats > 0)]
        shortest = min(shortest, *broken.tolist(), trace.cycles)
        beats[left | finished] = 0
    return shortest


@pytest.mark.one_in(7, 2)
@pytest.mark.parametrize(("policy", "requesters"), [case for case in SIZES if case[0] in TIMED])
@pytest.mark.parametrize("saturated", [False, True])
def test_time_wraps_around(library: Library, tmp_path: Path, policy: str, requesters: int, saturated: bool) -> None:
    # Hosts stall for up to eight times what the time can count, or everybody has tasks for as long.
    trace = trace_of(
        library,
        tmp_path,
        POLICY=policy,
        REQUESTERS=requesters,
        TIME_BITS=8,
        LONGEST_PERIOD=31,
        LONGEST_STALL=0 if saturated else 2048,
        SATURATED=saturated,
        SEGMENTS=8,
        CYCLES=3000,
    )
    assert trace.beat.any(axis=1).all()
    assert first_difference(trace, model_of(trace, policy)) == ""


@pytest.mark.check
def test_stamps_of_the_idle_do_not_wrap_around(library: Library, tmp_path: Path) -> None:
    # Twenty requesters' stamps wrap around after 1,024 completions. Where a lone one has tasks for 1,500 cycles, it
    # completes more than that, and the others come back with stamps as old.
    trace = trace_of(
        library, tmp_path, POLICY="lru", REQUESTERS=20, TASK_BEATS=1, STRETCH=1500, SEGMENTS=10, CYCLES=8000
    )
    assert _longest_idle(trace) > 1024
    assert first_difference(trace, model_of(trace, "lru")) == ""


def _longest_idle(trace: Trace) -> int:
    """The most tasks of others between two of one requester."""
    longest = 0
    for beat, last, select in zip(trace.beat, trace.last, trace.grant_select, strict=True):
        order = select[beat & last]
        for requester in range(trace.requesters):
            own = np.flatnonzero(order == requester)
            longest = max(longest, int(np.diff(own, prepend=own[:1]).max(initial=0)))
    return longest


@pytest.mark.one_in(3)
@pytest.mark.parametrize("beats", [4, 7])
@pytest.mark.parametrize("saturated", [False, True])
@pytest.mark.parametrize("requesters", [20, 100])
def test_each_other_goes_first_once_at_most(
    library: Library, tmp_path: Path, requesters: int, saturated: bool, beats: int
) -> None:
    trace = trace_of(
        library, tmp_path, POLICY="lru", REQUESTERS=requesters, SATURATED=saturated, TASK_BEATS=beats, CYCLES=4000
    )
    assert 0 < most_overtaken(trace) <= requesters - 1


@pytest.mark.one_in(5)
@pytest.mark.parametrize("beats", [1, 2, 3])
@pytest.mark.parametrize("saturated", [False, True])
@pytest.mark.parametrize("requesters", [20, 100])
def test_short_tasks_pass_by_few(
    library: Library, tmp_path: Path, requesters: int, saturated: bool, beats: int
) -> None:
    trace = trace_of(
        library, tmp_path, POLICY="lru", REQUESTERS=requesters, SATURATED=saturated, TASK_BEATS=beats, CYCLES=4000
    )
    # The heap is busy with tasks as short as these, so that some wait outside, where there is no order of use.
    assert 0 < most_overtaken(trace) <= (1.2 if beats == 3 else 2) * requesters


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("policy", "requesters"), [("lru", 20), ("lru", 256), ("edf_resources", 256)])
def test_reset_is_over_soon(library: Library, tmp_path: Path, policy: str, requesters: int) -> None:
    trace = trace_of(library, tmp_path, POLICY=policy, REQUESTERS=requesters, SATURATED=True, CYCLES=200)
    # Rows of requesters are cleared, one a cycle; then the first of them is accepted and granted.
    rows, _ = rows_and_columns(requesters)
    assert (trace.grant_valid.argmax(axis=1) == rows + 2).all()


@pytest.mark.one_in(6)
@pytest.mark.parametrize(("policy", "requesters"), [*SIZES, ("edf_resources", 256), ("edf_latency", 256), ("lru", 256)])
def test_a_lone_request_is_granted_in_three_cycles(
    library: Library, tmp_path: Path, policy: str, requesters: int
) -> None:
    trace = trace_of(library, tmp_path, POLICY=policy, REQUESTERS=requesters, SEGMENTS=12, CYCLES=1500)
    begun = np.zeros((trace.segments, requesters), np.bool_)
    segments = np.arange(trace.segments)
    found = 0
    before = np.zeros_like(begun)
    for cycle in range(trace.cycles - 3):
        request = trace.request(cycle)
        # Nobody is in a task, nobody asked before, and in the next two cycles still nobody but the lone one does.
        is_lone = ~begun.any(axis=1) & ~before.any(axis=1) & (request.sum(axis=1) == 1)
        is_lone &= (trace.request(cycle + 1) == request).all(axis=1) & ~trace.beat[:, cycle]
        is_lone &= (trace.request(cycle + 2) == request).all(axis=1)
        who = request.argmax(axis=1)
        if cycle > RESET_CYCLES:
            granted = trace.grant_valid[:, cycle + 3] & (trace.grant_select[:, cycle + 3] == who)
            assert granted[is_lone].all(), f"cycle {cycle}"
            found += int(is_lone.sum())
        beat = trace.beat[:, cycle]
        begun[segments[beat], trace.grant_select[beat, cycle]] = ~trace.last[beat, cycle]
        before = request
    assert found > 0


@pytest.mark.one_in(7, 2)
@pytest.mark.parametrize("beats", [1, 2, 4, 7])
@pytest.mark.parametrize(("policy", "requesters"), SIZES)
def test_tasks_follow_each_other(library: Library, tmp_path: Path, policy: str, requesters: int, beats: int) -> None:
    trace = trace_of(
        library, tmp_path, POLICY=policy, REQUESTERS=requesters, SATURATED=True, TASK_BEATS=beats, CYCLES=2000
    )
    share = float(trace.beat[:, RESET_CYCLES:].mean())
    # LST interrupts tasks, so that what is left of several may be single beats, more than the heap hands over in a row.
    assert share >= 0.995 if policy == "lst" and requesters == LST_IN_HEAP else share == 1


@pytest.mark.one_in(7, 2)
@pytest.mark.parametrize("shortest_run", [1, 3])
@pytest.mark.parametrize(("policy", "requesters"), [*SIZES, ("lru", 256), ("lst", 256)])
def test_the_netlist_does_the_same(
    library: Library, tmp_path: Path, policy: str, requesters: int, shortest_run: int
) -> None:
    def run(in_library: Library) -> Trace:
        return trace_of(in_library, tmp_path, POLICY=policy, REQUESTERS=requesters, SHORTEST_RUN=shortest_run)

    source = run(library)
    text = (tmp_path / "trace.txt").read_text()
    netlists = analysed(tmp_path)
    told = netlists.directory / "told.vhd"
    told.write_text(wrapper("told", f"firm_sched_{policy}", requesters, _generics(source, policy)))
    netlists.analyse([told])
    assert netlists.latches("told") == []
    netlists.replace_by_netlist("told")
    by_policy = netlists.directory / "by_policy.vhd"
    by_policy.write_text(wrapper("firm_sched_by_policy", "told", requesters, {}))
    analyse_bench(netlists, by_policy)
    run(netlists)
    assert (tmp_path / "trace.txt").read_text() == text


def _generics(trace: Trace, policy: str) -> dict[str, str]:
    """The generics of a policy's entity as they are in the trace's bench."""
    generics = {"REQUESTERS": str(trace.requesters)}
    if policy in TIMED:
        generics |= timed_generics(trace)
    if policy == "lst":
        generics["TRANSFER_TIMES"] = aggregate(trace.head["transfer_times"])
    return generics


ILLEGAL = [
    (-1, "PERIODS => (10, 20)", "REQUESTERS is -1; legal: 1 to 256"),
    (0, "PERIODS => (10, 20)", "REQUESTERS is 0; legal: 1 to 256"),
    (257, "PERIODS => (10, 20)", "REQUESTERS is 257; legal: 1 to 256"),
    (3, "PERIODS => (10, 20)", "PERIODS has 2 times; legal: one for each of 3 requesters"),
    (2, "PERIODS => (10, 0)", "the deadline of requester 1 is 0; legal: 1 or more cycles"),
    (2, "PERIODS => (10, 9000)", "TIME_BITS is 16; the deadline 9000 of requester 1 needs 17"),
    (2, "PERIODS => (10, 20); TIME_BITS => 7", "TIME_BITS is 7; legal: 8 to 31"),
    (2, "PERIODS => (10, 20); TIME_BITS => -1", "TIME_BITS is -1; legal: 8 to 31"),
    (2, "PERIODS => (10, 20); TIME_BITS => 40", "TIME_BITS is 40; legal: 8 to 31"),
    (20, "PERIODS => (10, 20); SHORTEST_RUN => 0", "SHORTEST_RUN is 0; legal: 1 or more beats"),
    (2, "PERIODS => (10, 20); DEADLINES => (5, 6, 7)", "DEADLINES has 3 times; legal: one for each of 2 requesters"),
]


@pytest.mark.one_in(5)
@pytest.mark.parametrize("policy", TIMED)
@pytest.mark.parametrize(("requesters", "generics", "message"), ILLEGAL)
def test_illegal_generics_are_named(tmp_path: Path, policy: str, requesters: int, generics: str, message: str) -> None:
    if policy == "lst":
        generics += "; TRANSFER_TIMES => (1, 1)"
    entity = POLICIES[policy].entity
    assert f"{entity}: {message}" in _refusal(analysed(tmp_path), entity, requesters, generics)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ("(1, 2, 3)", "TRANSFER_TIMES has 3 times; legal: one for each of 2 requesters"),
        ("(1, 0)", "the transfer time of requester 1 is 0; legal: 1 or more cycles"),
        ("(8192, 1)", "TIME_BITS is 16; the transfer time 8192 of requester 0 needs 17"),
    ],
)
def test_illegal_transfer_times_are_named(tmp_path: Path, times: str, message: str) -> None:
    generics = f"PERIODS => (10, 20); TRANSFER_TIMES => {times}"
    assert f"firm_sched_lst: {message}" in _refusal(analysed(tmp_path), "firm_sched_lst", 2, generics)


def _refusal(library: Library, entity: str, requesters: int, generics: str) -> str:
    """Return the output of elaborating `entity`; it must fail. `generics` are separated by semicolons."""
    file = library.directory / "refused.vhd"
    named = dict(generic.split(" => ") for generic in generics.split("; "))
    file.write_text(wrapper("refused", entity, requesters, {"REQUESTERS": str(requesters), **named}))
    library.analyse([file])
    result = library.run("refused")
    assert result.exit_code != 0
    return result.output
