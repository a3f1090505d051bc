"""The schedulers of robot:sched in their bench, and what a trace of it is held against."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from fusesoc_firm.scheduling.models import Combined, Scheduler, make_model
from fusesoc_firm.scheduling.policies import POLICIES
from tests.cores.sched_trace import Trace, read_trace
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

BENCH = "firm_sched_trace_tb"
POLICY_CORES = ("queue", "engine", *dict.fromkeys(policy.core_file for policy in POLICIES.values()))
SEED = seeded(20240503)

_WITHOUT_POLICIES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sched/package")

NON_PREEMPTIVE = [name for name, policy in POLICIES.items() if not policy.is_preemptive]


def preset_generics(policy: str) -> dict[str, Generic]:
    """What makes the entity of a policy so."""
    return {"PREEMPTIVE": True} if "PREEMPTIVE" in POLICIES[policy].generics else {}


def cases(policies: Iterable[str], sizes: tuple[int, ...]) -> list[tuple[str, int]]:
    """Each policy with each number of requesters."""
    return [(policy, size) for policy in policies for size in sizes]


def immediate_cases(sizes: tuple[int, ...]) -> list[tuple[str, int]]:
    """Each policy with each number of requesters with which it is immediate.

    An immediate one chooses in the cycle of a request or of a task's last beat. Those with deadlines take a cycle more.
    """
    untimed = [name for name, policy in POLICIES.items() if not policy.has_deadlines]
    return [(policy, size) for policy, size in cases(untimed, sizes) if size <= POLICIES[policy].most_at_once]


def analysed(folder: Path) -> Library:
    """All schedulers and their bench."""
    library = Library("firm", folder)
    library.analyse(core_files(*_WITHOUT_POLICIES, *(f"sched/{core}" for core in POLICY_CORES)))
    analyse_bench(library)
    return library


def analyse_bench(library: Library, by_policy: Path | None = None, combined: Path | None = None) -> None:
    """What stands above the policies, again if one was replaced.

    `by_policy` is a firm_sched_by_policy to use, `combined` a firm_sched_combined.
    """
    library.analyse(core_files("sched/by_policy") if by_policy is None else [by_policy])
    library.analyse(core_files("sched/combined") if combined is None else [combined])
    library.analyse(core_files("sched/combined", fileset="tb"))


def trace_of(library: Library, folder: Path, **generics: Generic) -> Trace:
    """Run the bench with its files in `folder`; its output, with the seed, is printed."""
    result = library.run(BENCH, {"SEED": SEED, **generics}, directory=folder, seconds=1200)
    print(f"{generics}\n{result.output}")
    assert result.exit_code == 0
    return read_trace(folder / "trace.txt")


def model_of(trace: Trace, policy: str, groups: str = "") -> Scheduler:
    """The model of what the bench makes of its generics POLICY and GROUP_POLICIES."""
    if not groups:
        return make_model(policy, trace.generics)
    names = list(POLICIES)
    members, first = [], 0
    for digit, size in zip(groups, trace.head["sizes"], strict=True):
        members.append(make_model(names[int(digit)], trace.generics.part(slice(first, first + size))))
        first += size
    return Combined(members, make_model(policy, trace.generics.part(slice(0, len(groups)))))


def timed_generics(trace: Trace) -> dict[str, str]:
    """The generics of a policy with deadlines as they are in the trace's bench."""
    is_implicit = trace.head["deadlines"] == [0]
    return {
        "PERIODS": aggregate(trace.head["periods"]),
        "DEADLINES": "IMPLICIT" if is_implicit else aggregate(trace.head["deadlines"]),
        "SHORTEST_RUN": str(trace.head["shortest_run"][0]),
    }


def aggregate(values: Iterable[object]) -> str:
    """An array in VHDL; it may have a single element."""
    return f"({', '.join(f'{place} => {value}' for place, value in enumerate(values))})"


_OWN_GENERICS = {
    "firm_sched_by_policy": """generic (
    POLICY : policy_t; REQUESTERS : integer; PERIODS, TRANSFER_TIMES, DEADLINES : times_t := IMPLICIT;
    TIME_BITS, SHORTEST_RUN : integer := 1);""",
    "firm_sched_combined": """generic (
    REQUESTERS : integer; SIZES : times_t; POLICIES : policies_t; TOP_POLICY : policy_t;
    PERIODS, TRANSFER_TIMES, DEADLINES : times_t := IMPLICIT; TIME_BITS, SHORTEST_RUN : integer := 1);""",
}


def wrapper(name: str, entity: str, requesters: int, generics: Mapping[str, str]) -> str:
    """An entity around a scheduler with its generics.

    One named firm_sched_by_policy or firm_sched_combined has that one's generics, too, and can take its place.
    """
    own_generics = _OWN_GENERICS.get(name, "")
    generic_map = ", ".join(f"{generic} => {value}" for generic, value in generics.items())
    return f"""
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;
entity {name} is
  {own_generics}
  port (
    clk, rst_n : in std_logic;
    request : in std_logic_vector({requesters}-1 downto 0);
    beat, last : in std_logic;
    grant_valid : out std_logic;
    grant_select : out std_logic_vector(index_bits({requesters})-1 downto 0));
end entity {name};
architecture wrapper of {name} is
begin
  u_scheduler : entity firm.{entity}
    {f"generic map ({generic_map})" if generic_map else ""}
    port map (clk => clk, rst_n => rst_n, request => request, beat => beat, last => last,
      grant_valid => grant_valid, grant_select => grant_select);
end architecture wrapper;
"""
