"""The schedulers of robot:sched in their bench, and what a trace of it is held against."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.scheduling.models import POLICIES, Combined, Scheduler
from tests.cores.sched_trace import Trace, read_trace
from tests.hdl.ghdl import Generic, Library, core_files

BENCH = "firm_sched_trace_tb"
POLICY_CORES = ("queue", "engine", "fixed_priority", "round_robin", "lru", "edf_resources", "edf_latency", "lst")
SEED = 20240503

_WITHOUT_POLICIES = ("axis/package", "axis/axis", "sim/host", "sched/package")


@dataclass(frozen=True)
class PolicyEntity:
    """The entity of a policy, what makes it so, how many requesters it can have, and with how many it is immediate.

    An immediate one chooses in the cycle of a request or of a task's last beat. Those with keys take a cycle more, and
    have times among their generics.
    """

    entity: str
    generics: Mapping[str, Generic] = field(default_factory=dict)
    most_requesters: int = 256
    most_immediate: int = 256
    is_preemptive: bool = False

    @property
    def has_times(self) -> bool:
        return not self.most_immediate


# By their names in policy_t, and in its order.
ENTITIES: Mapping[str, PolicyEntity] = {
    "fixed_priority": PolicyEntity("firm_sched_fixed_priority"),
    "fixed_priority_preemptive": PolicyEntity("firm_sched_fixed_priority", {"PREEMPTIVE": True}, is_preemptive=True),
    "round_robin": PolicyEntity("firm_sched_round_robin"),
    "lru": PolicyEntity("firm_sched_lru", most_immediate=16),
    "edf_resources": PolicyEntity("firm_sched_edf_resources", most_immediate=0, is_preemptive=True),
    "edf_latency": PolicyEntity("firm_sched_edf_latency", most_immediate=0, is_preemptive=True),
    "lst": PolicyEntity("firm_sched_lst", most_immediate=0, is_preemptive=True),
}
NON_PREEMPTIVE = [policy for policy, entity in ENTITIES.items() if not entity.is_preemptive]


def cases(policies: list[str], sizes: tuple[int, ...]) -> list[tuple[str, int]]:
    """Each policy with each number of requesters that it can have."""
    return [(policy, size) for policy in policies for size in sizes if size <= ENTITIES[policy].most_requesters]


def immediate_cases(sizes: tuple[int, ...]) -> list[tuple[str, int]]:
    """Each policy with each number of requesters with which it is immediate."""
    return [(policy, size) for policy, size in cases(list(ENTITIES), sizes) if size <= ENTITIES[policy].most_immediate]


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
        return POLICIES[policy](trace.generics)
    names = list(ENTITIES)
    members, first = [], 0
    for digit, size in zip(groups, trace.head["sizes"], strict=True):
        members.append(POLICIES[names[int(digit)]](trace.generics.part(slice(first, first + size))))
        first += size
    return Combined(members, POLICIES[policy](trace.generics.part(slice(0, len(groups)))))


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
