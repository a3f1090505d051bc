"""The schedulers of robot:sched and their models in Python do the same, cycle by cycle."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.scheduling.policies import POLICIES
from tests.cores.sched_trace import first_difference
from tests.cores.schedulers import analysed, cases, model_of, trace_of
from tests.hdl.ghdl import Library

REQUESTERS = (1, 2, 3, 5, 8, 16, 32, 100, 256)
MANY_REQUESTERS = (2, 3, 5, 8, 32, 100, 256)

# Policies of the groups by their places in policy_t, below one among the groups.
COMBINATIONS = [
    ("lru", "33", 5),
    ("lru", "03", 12),
    ("round_robin", "0123", 20),
    ("fixed_priority", "33", 9),
    ("fixed_priority_preemptive", "1203", 11),
    ("lru", "3", 4),
    ("lru", "2222222222222222", 256),
]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return analysed(tmp_path_factory.mktemp("sched"))


@pytest.mark.one_in(8, 2)
@pytest.mark.parametrize(("policy", "requesters"), cases(POLICIES, REQUESTERS))
def test_grants_are_those_of_the_model(library: Library, tmp_path: Path, policy: str, requesters: int) -> None:
    trace = trace_of(library, tmp_path, POLICY=policy, REQUESTERS=requesters, SEGMENTS=10, CYCLES=2000)
    assert trace.beat.any()
    assert first_difference(trace, model_of(trace, policy)) == ""


@pytest.mark.one_in(2)
@pytest.mark.parametrize("shortest_run", [2, 7])
@pytest.mark.parametrize("requesters", [2, 5, 32])
def test_runs_are_those_of_the_model(library: Library, tmp_path: Path, requesters: int, shortest_run: int) -> None:
    policy = "fixed_priority_preemptive"
    trace = trace_of(
        library, tmp_path, POLICY=policy, REQUESTERS=requesters, SHORTEST_RUN=shortest_run, SEGMENTS=10, CYCLES=2000
    )
    assert first_difference(trace, model_of(trace, policy)) == ""


@pytest.mark.one_in(4)
@pytest.mark.parametrize(("top", "groups", "requesters"), COMBINATIONS)
def test_combined_grants_are_those_of_the_models(
    library: Library, tmp_path: Path, top: str, groups: str, requesters: int
) -> None:
    trace = trace_of(
        library,
        tmp_path,
        POLICY=top,
        GROUP_POLICIES=groups,
        REQUESTERS=requesters,
        SHORTEST_RUN=3,
        SEGMENTS=10,
        CYCLES=2000,
    )
    assert first_difference(trace, model_of(trace, top, groups)) == ""


@pytest.mark.thorough
@pytest.mark.parametrize(("policy", "requesters"), cases(POLICIES, MANY_REQUESTERS))
def test_a_million_grants_are_those_of_the_model(
    library: Library, tmp_path: Path, policy: str, requesters: int
) -> None:
    trace = trace_of(library, tmp_path, POLICY=policy, REQUESTERS=requesters, SEGMENTS=50, CYCLES=20_000)
    assert first_difference(trace, model_of(trace, policy)) == ""
