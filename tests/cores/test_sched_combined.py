"""A scheduler of schedulers with groups of any policy: models, netlists, illegal times."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from fusesoc_firm.scheduling.policies import POLICIES
from tests.cores.sched_trace import Trace, first_difference, read_trace
from tests.cores.schedulers import (
    aggregate,
    analyse_bench,
    analysed,
    model_of,
    timed_generics,
    trace_of,
    wrapper,
)
from tests.hdl.ghdl import CORES, Library

ENTITY = "firm_sched_combined"
# Runs are of one beat: where two levels share a part, which longer runs bring about, GHDL's netlist uses it before it
# is there. The policy among the groups, those of the groups by their places in policy_t, and all requesters.
COMBINATIONS = [
    ("lru", "33", 5),
    ("round_robin", "0123", 12),
    ("fixed_priority_preemptive", "56", 9),
    ("lru", "46", 24),
]


@pytest.mark.one_in(4)
@pytest.mark.parametrize(("top", "groups", "requesters"), COMBINATIONS)
def test_the_netlist_does_what_source_and_models_do(tmp_path: Path, top: str, groups: str, requesters: int) -> None:
    def run(library: Library) -> tuple[Trace, str]:
        trace = trace_of(
            library,
            tmp_path,
            POLICY=top,
            GROUP_POLICIES=groups,
            REQUESTERS=requesters,
            CYCLES=2000,
        )
        return trace, (tmp_path / "trace.txt").read_text()

    library = analysed(tmp_path)
    source, text = run(library)
    assert first_difference(source, model_of(source, top, groups)) == ""
    _put(library, "told", ENTITY, requesters, _generics(source, top, groups))
    assert library.latches("told") == []
    library.replace_by_netlist("told")
    combined = _put(library, ENTITY, "told", requesters, {})
    analyse_bench(library, combined=combined)
    assert run(library)[1] == text


def _generics(trace: Trace, top: str, groups: str) -> dict[str, str]:
    """The generics as they are in the trace's bench."""
    names = [name.upper() for name in POLICIES]
    return timed_generics(trace) | {
        "REQUESTERS": str(trace.requesters),
        "SIZES": aggregate(trace.head["sizes"]),
        "POLICIES": aggregate(names[int(digit)] for digit in groups),
        "TOP_POLICY": top.upper(),
        "TRANSFER_TIMES": aggregate(trace.head["transfer_times"]),
    }


@pytest.mark.parametrize(
    ("generics", "message"),
    [
        ({}, "PERIODS has 1 times; legal: one for each of 5 requesters"),
        ({"PERIODS": "(10, 20, 30)"}, "PERIODS has 3 times; legal: one for each of 5 requesters"),
        ({"PERIODS": "(10, 20, 30, 0, 50)"}, "the deadline of requester 3 is 0; legal: 1 or more cycles"),
        (
            {"PERIODS": "(10, 20, 30, 40, 9000)"},
            "TIME_BITS is 16; the deadline 9000 of requester 4 needs 17",
        ),
        (
            {"PERIODS": "(1, 2, 3, 4, 5)", "DEADLINES": "(1, 2)"},
            "DEADLINES has 2 times; legal: one for each of 5 requesters",
        ),
        (
            {"PERIODS": "(1, 2, 3, 4, 5)", "TRANSFER_TIMES": "(1, 2)"},
            "TRANSFER_TIMES has 2 times; legal: one for each of 5 requesters",
        ),
        ({"PERIODS": "(1, 2, 3, 4, 5)", "TIME_BITS": "7"}, "TIME_BITS is 7; legal: 8 to 31"),
        ({"PERIODS": "(1, 2, 3, 4, 5)", "SHORTEST_RUN": "0"}, "SHORTEST_RUN is 0; legal: 1 or more beats"),
    ],
)
def test_illegal_times_are_named(tmp_path: Path, generics: Mapping[str, str], message: str) -> None:
    library = analysed(tmp_path)
    groups = {"REQUESTERS": "5", "SIZES": "(2, 3)", "POLICIES": "(LRU, LST)"}
    _put(library, "refused", ENTITY, 5, {**groups, **generics})
    result = library.run("refused")
    assert result.exit_code != 0
    assert f"{ENTITY}: {message}" in result.output


def test_times_without_a_policy_that_knows_them_are_not_asked_for(tmp_path: Path) -> None:
    library = analysed(tmp_path)
    generics = {"REQUESTERS": "5", "SIZES": "(2, 3)", "POLICIES": "(LRU, ROUND_ROBIN)"}
    _put(library, "accepted", ENTITY, 5, generics)
    assert library.run("accepted").exit_code == 0


def _put(library: Library, name: str, entity: str, requesters: int, generics: Mapping[str, str]) -> Path:
    """Analyse an entity `name` around `entity`; its file."""
    file = library.directory / f"{name}.vhd"
    file.write_text(wrapper(name, entity, requesters, generics))
    library.analyse([file])
    return file


def test_the_trace_that_the_cores_own_bench_expects_is_right() -> None:
    trace = read_trace(CORES / "sched" / "tb" / "data" / "trace_expected.txt")
    assert first_difference(trace, model_of(trace, "round_robin", "01")) == ""
