"""The proofs of schedulers: whom they grant, for how long, and that they serve."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tools.proofs.proof import Mutation, Proof, Size

Mutations = Mapping[str, tuple[Mutation, ...]]

_SIZES = tuple({"REQUESTERS": requesters} for requesters in (2, 3, 4))
# What harnesses must know of a policy: here of one that never preempts and decides in a cycle.
_SIMPLE = {"IS_PREEMPTIVE": 0, "WAITS_FOR_PAUSES": 1, "LATENCY": 1, "SHORTEST_RUN": 1}
# Fixed priority that preempts takes the grant from who pauses.
_YIELDS = {"IS_PREEMPTIVE": 1, "WAITS_FOR_PAUSES": 0}
_THREE = 1  # the index of the size that is no power of two
_FOUR = 1  # that of four where three is left out
# Where a number that is no power of two says more than its neighbours do: some indices are nobody's.
_OF_ANY_NUMBER = ("scheduler_grants", "scheduler_fairness")


def _proofs(
    policy: str,
    mutations: Mutations,
    sizes: tuple[Size, ...] = _SIZES,
    *,
    entity: str = "",
    cores: tuple[str, ...] = (),
    sources: tuple[str, ...] = (),
    helpers: str = "",
    variant: str = "",
    behaviour: Mapping[str, int] | None = None,
) -> tuple[Proof, ...]:
    """A proof for each harness that has mutations; `behaviour` is what differs from `_SIMPLE`."""
    entity = entity or f"firm_sched_{policy}"
    defines = {"DUT": entity, **_SIMPLE, **(behaviour or {})}
    return tuple(
        Proof(
            harness,
            entity,
            cores=("axis/package", "axis/axis", "sched/package", *cores, f"sched/{policy}"),
            sizes=sizes if harness in _OF_ANY_NUMBER else tuple(size for size in sizes if size["REQUESTERS"] != 3),
            depth=4,
            mutations=found,
            defines=defines,
            sources=sources,
            helpers=helpers or entity,
            variant=variant,
        )
        for harness, found in mutations.items()
    )


def _grants_of_fixed_priority(file: str) -> Mutations:
    return {
        "scheduler_grants": (
            Mutation(file, "grant_select_r <= choice", "grant_select_r <= not choice", ("only_to_a_requester",)),
            Mutation(
                file, "grant_select_r <= choice", "grant_select_r <= (others => '1')", ("at_most_one_grant",), _THREE
            ),
            Mutation(file, "if moves = '1' then", "if kept = '0' then", ("no_grant_unasked",)),
        ),
        "scheduler_sticky": (
            Mutation(file, "grant_valid_r  <= '1'", "grant_valid_r  <= not finished", ("grant_stays_valid",)),
        ),
    }


def _fixed_priority() -> tuple[Proof, ...]:
    file = "firm_sched_fixed_priority.vhd"
    mutations = {
        **_grants_of_fixed_priority(file),
        "scheduler_whole_tasks": (
            Mutation(file, "started_r or beat;", "beat;", ("whole_tasks", "only_to_who_has_not_begun")),
            Mutation(file, "grant_select_r <= choice", "grant_select_r <= not choice", ("request_is_still_there",)),
        ),
        "scheduler_service": (
            Mutation(file, "kept and not finished and rst_n", "kept and rst_n", ("no_deadlock",)),
            Mutation(file, "is_before or not offered", "is_before", ("no_deadlock",)),
        ),
        "scheduler_gaps": (Mutation(file, "(finished or (", "((", ("no_gap_between_tasks",)),),
        "scheduler_priority": (
            Mutation(file, "is_before or not offered", "not offered", ("lowest_index_first",)),
            Mutation(
                "firm_sched_pkg.vhd",
                "      return lower;\n    end if;\n    return higher;",
                "      return higher;\n    end if;\n    return lower;",
                ("lowest_index_first",),
            ),
        ),
    }
    return _proofs("fixed_priority", mutations)


def _fixed_priority_preemptive() -> tuple[Proof, ...]:
    file = "firm_sched_fixed_priority.vhd"
    mutations = {
        **_grants_of_fixed_priority(file),
        "scheduler_service": (Mutation(file, "    kept <= '0';", "    kept <= not beat;", ("no_deadlock",)),),
        "scheduler_gaps": (Mutation(file, "(finished or (", "((", ("no_gap_between_tasks",)),),
        "scheduler_priority": (Mutation(file, "    kept <= '0';", "    kept <= beat;", ("lowest_index_first",)),),
    }
    sizes = tuple({**size, "PREEMPTIVE": True} for size in _SIZES)
    helpers = "firm_sched_fixed_priority_preemptive"
    return _proofs("fixed_priority", mutations, sizes, helpers=helpers, variant="preemptive", behaviour=_YIELDS)


def _fixed_priority_runs() -> tuple[Proof, ...]:
    file = "firm_sched_fixed_priority.vhd"
    mutations = {
        "scheduler_preemption": (
            Mutation(file, "beats < SHORTEST_RUN else", "beats < SHORTEST_RUN-1 else", ("no_short_run",)),
        ),
        "scheduler_priority": (Mutation(file, "or finished = '1' or moves", "or moves", ("lowest_index_first",)),),
        "scheduler_service": (Mutation(file, "<= offered when", "<= '1' when", ("no_deadlock",)),),
        "scheduler_gaps": (Mutation(file, "(finished or (", "((", ("no_gap_between_tasks",)),),
    }
    sizes = tuple({**size, "PREEMPTIVE": True, "SHORTEST_RUN": 3} for size in _SIZES)
    helpers = "firm_sched_fixed_priority_runs"
    return _proofs("fixed_priority", mutations, sizes, helpers=helpers, variant="runs", behaviour=_YIELDS)


def _round_robin() -> tuple[Proof, ...]:
    file = "firm_sched_round_robin.vhd"
    mutations = {
        "scheduler_grants": (
            Mutation(file, "grant_select_r <= choice", "grant_select_r <= not choice", ("only_to_a_requester",)),
            Mutation(
                file, "grant_select_r <= choice", "grant_select_r <= (others => '1')", ("at_most_one_grant",), _THREE
            ),
            Mutation(file, "found and (finished", "(finished", ("no_grant_unasked",)),
        ),
        "scheduler_sticky": (
            Mutation(file, "grant_valid_r  <= '1'", "grant_valid_r  <= not beat", ("grant_stays_valid",)),
        ),
        "scheduler_whole_tasks": (
            Mutation(file, "(started_r or beat) and", "beat and", ("whole_tasks", "only_to_who_has_not_begun")),
            Mutation(file, "grant_select_r <= choice", "grant_select_r <= not choice", ("request_is_still_there",)),
        ),
        "scheduler_service": (
            Mutation(file, "(started_r or beat) and not finished", "started_r or beat", ("no_deadlock",)),
        ),
        "scheduler_gaps": (Mutation(file, "(finished or not", "(not", ("no_gap_between_tasks",)),),
        "scheduler_fairness": (
            Mutation(
                "firm_sched_following.vhd",
                "later := asking and above(now_at, COUNT);",
                "later := asking;",
                ("after_at_most_all_others",),
            ),
        ),
    }
    return _proofs("round_robin", mutations)


def _lru() -> tuple[Proof, ...]:
    file = "firm_sched_age_matrix.vhd"
    mutations = {
        "scheduler_grants": (
            Mutation(file, "<= index_of(chosen)", "<= not index_of(chosen)", ("only_to_a_requester",)),
            Mutation(file, "<= index_of(chosen)", "<= (others => '1')", ("at_most_one_grant",), _THREE),
            Mutation(file, "goes_on = '0' and any_of(eligible) = '1'", "goes_on = '0'", ("no_grant_unasked",)),
        ),
        "scheduler_sticky": (
            Mutation(file, "grant_valid_r  <= '1'", "grant_valid_r  <= not beat", ("grant_stays_valid",)),
        ),
        "scheduler_whole_tasks": (
            Mutation(file, "(started_r or beat) and", "beat and", ("whole_tasks", "only_to_who_has_not_begun")),
            Mutation(file, "<= index_of(chosen)", "<= not index_of(chosen)", ("request_is_still_there",)),
        ),
        "scheduler_service": (
            Mutation(file, "(started_r or beat) and not (beat and last)", "started_r or beat", ("no_deadlock",)),
        ),
        "scheduler_gaps": (
            Mutation(file, "if goes_on = '0' and", "if (goes_on or beat) = '0' and", ("no_gap_between_tasks",)),
        ),
        "scheduler_fairness": (
            Mutation(
                file, "elsif spent(i) = '1' then", "elsif spent(i) = '1' and i > 0 then", ("after_at_most_all_others",)
            ),
        ),
    }
    return _proofs("lru", mutations, cores=("sched/queue", "sched/engine"))


# Their places in policy_t.
_EDF_RESOURCES, _EDF_LATENCY, _LST = 4, 5, 6
_TIMED_CORES = ("queue", "engine", "fixed_priority", "round_robin", "lru", "edf_resources", "edf_latency", "lst")


def _timed(
    policy: int, name: str, helpers: str, mutations: Mutations, requesters: tuple[int, ...]
) -> tuple[Proof, ...]:
    """A policy with deadlines, in a wrapper that gives it some."""
    return _proofs(
        "by_policy",
        mutations,
        tuple({"REQUESTERS": count, "POLICY": policy, "SHORTEST_RUN": 3} for count in requesters),
        entity="timed_scheduler",
        cores=tuple(f"sched/{core}" for core in _TIMED_CORES),
        sources=("timed_scheduler.vhd",),
        helpers=helpers,
        variant=name,
        behaviour={"IS_PREEMPTIVE": 1, "LATENCY": 2},
    )


def _parallel(policy: int, name: str) -> tuple[Proof, ...]:
    file = "firm_sched_parallel.vhd"
    mutations = {
        "scheduler_grants": (
            Mutation(file, "grant_select_r <= id(1)", "grant_select_r <= not id(1)", ("only_to_a_requester",)),
            Mutation(
                file, "grant_select_r <= id(1)", "grant_select_r <= (others => '1')", ("at_most_one_grant",), _THREE
            ),
            Mutation(file, "elsif valid(1) = '1' and kept = '0' then", "elsif kept = '0' then", ("no_grant_unasked",)),
        ),
        "scheduler_sticky": (
            Mutation(file, "grant_valid_r  <= '1'", "grant_valid_r  <= not beat", ("grant_stays_valid",)),
        ),
        "scheduler_preemption": (
            Mutation(file, "beats < SHORTEST_RUN else", "beats < SHORTEST_RUN-1 else", ("no_short_run",)),
        ),
        "scheduler_service": (
            Mutation(
                file, "not request(leaf)) or (current(leaf) and finished)", "not request(leaf))", ("no_deadlock",)
            ),
        ),
        "scheduler_gaps": (Mutation(file, "and not finished\n", "\n", ("no_gap_between_tasks",)),),
    }
    return _timed(policy, name, f"timed_scheduler_{name}", mutations, (2, 3, 4))


def _edf_resources() -> tuple[Proof, ...]:
    """The engine: tasks that wait lie in memories, of which no short invariant says enough for an induction."""
    file = "firm_sched_engine.vhd"
    mutations = {
        "scheduler_grants": (
            Mutation(
                file,
                "grant_select_r <= next_id",
                "grant_select_r <= not next_id",
                ("only_to_a_requester",),
            ),
            Mutation(
                file,
                "              a_id;",
                "              (others => '1');",
                ("at_most_one_grant",),
                _THREE,
            ),
            Mutation(file, "given_if_paused or (grant_valid_r and (running_r or empty))", "'1'", ("no_grant_unasked",)),
        ),
        "scheduler_preemption": (
            Mutation(
                file,
                "beats = 0 or beats = SHORTEST_RUN",
                "beats = 0 or beats >= SHORTEST_RUN-1",
                ("no_short_run",),
            ),
        ),
        "scheduler_service": (
            Mutation(
                file,
                "given_if_paused or running_r, '1', given_if_ended)",
                "given_if_paused or running_r, '1', '1')",
                ("no_deadlock",),
            ),
        ),
    }
    proofs = _timed(_EDF_RESOURCES, "edf_resources", "unknown", mutations, (2, 3, 4))
    return tuple(
        replace(proof, is_bounded=True, depth=12, trace=14, defines={**proof.defines, "LATENCY": 6}) for proof in proofs
    )


def _combined() -> tuple[Proof, ...]:
    """Round robin among two groups, least recently used in the one and fixed priority in the other."""
    file = "firm_sched_combined.vhd"
    mutations = {
        "scheduler_grants": (
            Mutation(file, ", SELECT_BITS) + FIRST", ", SELECT_BITS) + FIRST + 1", ("at_most_one_grant",), _THREE),
            Mutation(file, ", SELECT_BITS) + FIRST", ", SELECT_BITS) + FIRST + 1", ("only_to_a_requester",)),
            Mutation(file, "<= group_valid(group_index) and offered(0)", "<= '1'", ("no_grant_unasked",)),
        ),
        "scheduler_whole_tasks": (
            Mutation(
                file,
                "<= decode(top_select, beat, GROUPS)",
                "<= (others => '0')",
                ("whole_tasks", "only_to_who_has_not_begun"),
                _FOUR,
            ),
            Mutation(file, ", SELECT_BITS) + FIRST", ", SELECT_BITS) + FIRST + 1", ("request_is_still_there",)),
        ),
        "scheduler_service": (
            Mutation(
                file, "group_valid(group_index) and offered(0)", "offered(0) and not offered(0)", ("no_deadlock",)
            ),
        ),
    }
    proofs = _proofs(
        "combined",
        mutations,
        entity="combined_scheduler",
        cores=tuple(f"sched/{core}" for core in (*_TIMED_CORES, "by_policy")),
        sources=("combined_scheduler.vhd",),
        helpers="unknown",
        behaviour={"LATENCY": 2},
    )
    return tuple(replace(proof, is_bounded=True, depth=12) for proof in proofs)


PROOFS = (
    *_fixed_priority(),
    *_fixed_priority_preemptive(),
    *_fixed_priority_runs(),
    *_round_robin(),
    *_lru(),
    *_parallel(_EDF_LATENCY, "edf_latency"),
    *_parallel(_LST, "lst"),
    *_edf_resources(),
    *_combined(),
)
