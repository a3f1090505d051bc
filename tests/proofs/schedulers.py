"""The proofs of schedulers: whom they grant, and that they serve."""

from __future__ import annotations

from collections.abc import Mapping

from tests.proofs.proof import Mutation, Proof

_SIZES = tuple({"REQUESTERS": requesters} for requesters in (2, 3, 4))
_THREE = 1  # the index of the size that is no power of two

# What the harness of a policy has to know: how many ready cycles may pass before a request is served, if nobody is.
_AT_ONCE = {"LATENCY": 1, "IS_PREEMPTIVE": 0}


def _proofs(
    core: str, defines: Mapping[str, object], mutations: Mapping[str, tuple[Mutation, ...]]
) -> tuple[Proof, ...]:
    """A proof for each harness that has mutations."""
    entity = f"firm_sched_{core}"
    return tuple(
        Proof(
            harness,
            entity,
            cores=("axis/axis", f"sched/{core}"),
            sizes=_SIZES,
            depth=4,
            mutations=found,
            defines={"DUT": entity, **defines},
            helpers=entity,
        )
        for harness, found in mutations.items()
    )


def _fixed_priority() -> tuple[Proof, ...]:
    file = "firm_sched_fixed_priority.vhd"
    mutations = {
        "scheduler_grants": (
            Mutation(file, "any(LEAVES+leaf) <= '0';", "any(LEAVES+leaf) <= '1';", ("at_most_one_grant",), _THREE),
            Mutation(file, "<= grant_valid_r or any(1)", "<= '1'", ("no_grant_unasked",)),
            Mutation(file, "<= grant_valid_r or any(1)", "<= any(1)", ("grant_stays_valid",)),
            Mutation(file, "<= not any(2*node)", "<= any(2*node)", ("only_to_a_requester",)),
        ),
        "scheduler_whole_tasks": (
            Mutation(file, "started_r <= '1'", "started_r <= '0'", ("whole_tasks", "only_to_who_has_not_begun")),
            Mutation(file, "<= not any(2*node)", "<= any(2*node)", ("request_is_still_there",)),
        ),
        "scheduler_service": (
            Mutation(file, "finished = '1' or (", "(finished and any(1)) = '1' or (", ("no_deadlock",)),
            Mutation(
                file, "if any(1) = '1' then", "if (any(1) and not finished) = '1' then", ("no_gap_between_tasks",)
            ),
        ),
    }
    return _proofs("fixed_priority", _AT_ONCE, mutations)


PROOFS = _fixed_priority()
