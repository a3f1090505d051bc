"""The schedulers of robot:sched: what each promises, whatever its model says; netlists, latches, illegal generics."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.scheduling.policies import POLICIES
from tests.cores.sched_trace import idle_grants, interruptions, most_overtaken
from tests.cores.schedulers import (
    NON_PREEMPTIVE,
    analyse_bench,
    analysed,
    cases,
    immediate_cases,
    preset_generics,
    trace_of,
)
from tests.hdl.ghdl import Generic, Library

REQUESTERS = (1, 2, 3, 5, 16, 256)
FEW_REQUESTERS = (2, 5, 16)

FAIR = ["round_robin", "lru"]
COMBINED = "firm_sched_combined"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return analysed(tmp_path_factory.mktemp("sched"))


@pytest.mark.one_in(4)
@pytest.mark.parametrize(("policy", "requesters"), immediate_cases(REQUESTERS))
def test_no_cycle_is_lost_where_everybody_is_ready(
    library: Library, tmp_path: Path, policy: str, requesters: int
) -> None:
    trace = trace_of(library, tmp_path, POLICY=policy, REQUESTERS=requesters, SATURATED=True)
    # The first request is shown in the first cycle and granted in the second.
    assert not trace.beat[:, 0].any()
    assert trace.beat[:, 1:].all()


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("policy", "requesters"), immediate_cases(FEW_REQUESTERS))
def test_who_asks_does_not_wait_for_who_is_idle(library: Library, tmp_path: Path, policy: str, requesters: int) -> None:
    assert idle_grants(trace_of(library, tmp_path, POLICY=policy, REQUESTERS=requesters)) == 0


@pytest.mark.one_in(4)
@pytest.mark.parametrize(("policy", "requesters"), cases(POLICIES, FEW_REQUESTERS))
def test_only_preemptive_policies_interrupt(library: Library, tmp_path: Path, policy: str, requesters: int) -> None:
    trace = trace_of(library, tmp_path, POLICY=policy, REQUESTERS=requesters)
    assert (interruptions(trace) == 0) == (policy in NON_PREEMPTIVE)


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("policy", "requesters"), cases(FAIR, FEW_REQUESTERS))
@pytest.mark.parametrize("saturated", [False, True])
def test_each_other_goes_first_once_at_most(
    library: Library, tmp_path: Path, policy: str, requesters: int, saturated: bool
) -> None:
    trace = trace_of(library, tmp_path, POLICY=policy, REQUESTERS=requesters, SATURATED=saturated)
    assert 0 < most_overtaken(trace) <= requesters - 1


@pytest.mark.parametrize("groups", ["33", "22", "2323"])
@pytest.mark.parametrize("top", FAIR)
def test_fair_groups_below_a_fair_top_starve_nobody(library: Library, tmp_path: Path, top: str, groups: str) -> None:
    trace = trace_of(library, tmp_path, POLICY=top, GROUP_POLICIES=groups, REQUESTERS=12, SATURATED=True)
    assert trace.beat[:, 2:].all()
    # Each other of the group may go first, and before each of them and oneself each other group.
    largest = max(trace.head["sizes"])
    assert 0 < most_overtaken(trace) <= largest * len(groups) - 1


@pytest.mark.one_in(7)
@pytest.mark.parametrize(("policy", "requesters"), immediate_cases((1, *FEW_REQUESTERS)))
@pytest.mark.parametrize("shortest_run", [1, 3])
def test_the_netlist_does_the_same(
    library: Library, tmp_path: Path, policy: str, requesters: int, shortest_run: int
) -> None:
    bench: dict[str, Generic] = {"POLICY": policy, "REQUESTERS": requesters, "SHORTEST_RUN": shortest_run}
    trace_of(library, tmp_path, **bench)
    source = (tmp_path / "trace.txt").read_text()
    netlists = analysed(tmp_path)
    netlists.replace_by_netlist(POLICIES[policy].entity, generics_of(policy, requesters, shortest_run))
    analyse_bench(netlists)
    trace_of(netlists, tmp_path, **bench)
    assert (tmp_path / "trace.txt").read_text() == source


@pytest.mark.one_in(5)
@pytest.mark.parametrize(("policy", "requesters"), immediate_cases(REQUESTERS))
@pytest.mark.parametrize("shortest_run", [1, 3])
def test_it_is_latch_free(library: Library, policy: str, requesters: int, shortest_run: int) -> None:
    assert library.latches(POLICIES[policy].entity, generics_of(policy, requesters, shortest_run)) == []


def generics_of(policy: str, requesters: int, shortest_run: int) -> dict[str, Generic]:
    """Those of the entity of a policy."""
    own = {"SHORTEST_RUN": shortest_run} if POLICIES[policy].is_preemptive else {}
    return {"REQUESTERS": requesters, **preset_generics(policy), **own}


@pytest.mark.parametrize("policy", [name for name, policy in POLICIES.items() if not policy.has_deadlines])
def test_illegal_numbers_of_requesters_are_named(library: Library, policy: str) -> None:
    entity = POLICIES[policy].entity
    for requesters in (-1, 0, 257):
        result = library.run(entity, {"REQUESTERS": requesters, **preset_generics(policy)})
        assert result.exit_code != 0
        assert f"{entity}: REQUESTERS is {requesters}; legal: 1 to 256" in result.output


@pytest.mark.parametrize("is_preemptive", [False, True])
@pytest.mark.parametrize("shortest_run", [-1, 0])
def test_an_illegal_shortest_run_is_named(library: Library, is_preemptive: bool, shortest_run: int) -> None:
    entity = "firm_sched_fixed_priority"
    result = library.run(entity, {"PREEMPTIVE": is_preemptive, "SHORTEST_RUN": shortest_run})
    assert result.exit_code != 0
    assert f"{entity}: SHORTEST_RUN is {shortest_run}; legal: 1 or more beats" in result.output


@pytest.mark.parametrize(
    ("requesters", "generics", "message"),
    [
        (6, "SIZES => (2, 3)", "the sizes of the groups add up to 5; legal: 6, the number of requesters"),
        (5, "SIZES => (0, 5)", "the size of group 0 is 0; legal: 1 to 256"),
        (6, "SIZES => (1, 2, 3)", "SIZES has 3 groups and POLICIES 2; legal: 1 or more, as many in both"),
        (5, "SIZES => (2, 3), TOP_POLICY => LST", "TOP_POLICY is lst; legal: a policy without deadlines"),
        (257, "SIZES => (2, 255)", "REQUESTERS is 257; legal: 1 to 256"),
    ],
)
def test_illegal_groups_are_named(tmp_path: Path, requesters: int, generics: str, message: str) -> None:
    assert f"{COMBINED}: {message}" in refusal_of(analysed(tmp_path), COMBINED, requesters, generics)


@pytest.mark.parametrize(
    ("times", "fault"),
    [
        ("4, (10, 20, 30), IMPLICIT, 16, 1", "PERIODS has 3 times; legal: one for each of 4 requesters"),
        ("2, (10, 20), (5, 6, 7), 16, 1", "DEADLINES has 3 times; legal: one for each of 2 requesters"),
        ("2, (10, 0), IMPLICIT, 16, 1", "the deadline of requester 1 is 0; legal: 1 or more cycles"),
        ("2, (10, 0), (5, 5), 16, 1", "the period of requester 1 is 0; legal: 1 or more cycles"),
        ("4, (1, 2, 3, 9000), IMPLICIT, 16, 1", "TIME_BITS is 16; the deadline 9000 of requester 3 needs 17"),
        ("2, (1, 8191), IMPLICIT, 16, 1", ""),
        ("2, (1, 8192), IMPLICIT, 16, 1", "TIME_BITS is 16; the deadline 8192 of requester 1 needs 17"),
        ("2, (1, 9000), (8191, 1), 16, 1", ""),
        ("2, (10, 20), IMPLICIT, 7, 1", "TIME_BITS is 7; legal: 8 to 31"),
        ("2, (10, 20), IMPLICIT, 32, 1", "TIME_BITS is 32; legal: 8 to 31"),
        ("0, (10, 20), IMPLICIT, 16, 1", "REQUESTERS is 0; legal: 1 to 256"),
        ("2, (10, 20), IMPLICIT, 16, 0", "SHORTEST_RUN is 0; legal: 1 or more beats"),
    ],
)
def test_faults_of_times_are_found(tmp_path: Path, times: str, fault: str) -> None:
    library = analysed(tmp_path)
    text = f"""
library firm;
use firm.firm_sched_pkg.all;
entity told is
end entity told;
architecture simulation of told is
begin
  assert false report "found <" & fault_of_deadlines({times}) & ">" severity note;
end architecture simulation;
"""
    file = tmp_path / "told.vhd"
    file.write_text(text)
    library.analyse([file])
    assert f"found <{fault}>" in library.run("told").output


def refusal_of(library: Library, entity: str, requesters: int, generics: str) -> str:
    """Return the output of elaborating `entity` with a generic map; it must fail."""
    text = f"""
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_sched_pkg.all;
entity told is
end entity told;
architecture simulation of told is
  signal clk, rst_n, beat, last : std_logic := '0';
  signal request : std_logic_vector({requesters}-1 downto 0) := (others => '0');
begin
  u_told : entity firm.{entity}
    generic map (REQUESTERS => {requesters}, {generics})
    port map (clk => clk, rst_n => rst_n, request => request, beat => beat, last => last,
      grant_valid => open, grant_select => open);
end architecture simulation;
"""
    file = library.directory / "told.vhd"
    file.write_text(text)
    library.analyse([file])
    result = library.run("told")
    assert result.exit_code != 0
    return result.output
