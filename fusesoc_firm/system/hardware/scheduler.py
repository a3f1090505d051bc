"""The scheduler's instance at the top level, and the constants with the publishers' times."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, groupby
from typing import Any

from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.system.derived.model import DerivedSystem, Group, Tree
from fusesoc_firm.system.hardware.maps import port_map

_COMBINED = "firm_sched_combined"


def scheduler_configuration(system: DerivedSystem) -> dict[str, Any]:
    """Return the scheduler's entity and generics, with the constants for publishers' times that the generics use.

    With ids of two bytes, also return the generics of the Manager of Managers, which contains the schedulers.
    """
    scheduling = system.scheduling
    policies = [scheduling.policy, *(group.policy for group in scheduling.groups)]
    used = dict.fromkeys(chain.from_iterable(POLICIES[name].generics for name in policies))
    times = {
        "PERIODS": [item.period or item.deadline for item in scheduling.times],
        "DEADLINES": [item.deadline for item in scheduling.times],
        "TRANSFER_TIMES": [item.transfer_time for item in scheduling.times],
    }
    values = {
        "PREEMPTIVE": "true",
        "TIME_BITS": str(scheduling.time_bits),
        "SHORTEST_RUN": str(scheduling.shortest_run),
        **{name: name for name in times},
    }
    constants = [_times(name, times[name], system) for name in used if name in times]
    generics = [(name, values[name]) for name in used]
    entity = POLICIES[scheduling.policy].entity
    if scheduling.groups:
        entity = _COMBINED
        of_groups = [("SIZES", "SIZES"), ("POLICIES", "POLICIES"), ("TOP_POLICY", _policy(scheduling.policy))]
        generics = [*of_groups, *(item for item in generics if item[0] != "PREEMPTIVE")]
    return {
        "tree": _tree(system.tree, system) if system.tree else None,
        "groups": _groups(scheduling.groups) if scheduling.groups else None,
        "scheduler": entity,
        "scheduler_generics": port_map([("REQUESTERS", str(len(system.publishers))), *generics]),
        "manager_generics": port_map(_manager_generics(system)),
        "scheduler_times": {"constants": constants} if constants else None,
    }


def _manager_generics(system: DerivedSystem) -> Iterator[tuple[str, str]]:
    """Yield the generics of the Manager."""
    yield "WIDTH", str(system.width)
    yield "SUBSCRIBERS", str(len(system.subscribers))
    if system.scheduling.is_preemptive:
        yield "PREEMPTIVE", "true"
    if system.watchdog:
        yield "WATCHDOG", str(system.watchdog)
    yield "PUBLISHERS", str(len(system.publishers))


def _policy(name: str) -> str:
    """Return the name of a policy in VHDL."""
    return f"firm.firm_sched_pkg.{name.upper()}"


def _groups(groups: Sequence[Group]) -> dict[str, Any]:
    """Return the groups of a combined scheduler."""
    members = [
        {
            "place": place,
            "size": len(group.blocks),
            "policy": _policy(group.policy),
            "blocks": " to ".join(dict.fromkeys((group.blocks[0], group.blocks[-1]))),
        }
        for place, group in enumerate(groups)
    ]
    return {"last_group": len(groups) - 1, "members": members}


def _tree(tree: Tree, system: DerivedSystem) -> dict[str, Any]:
    """Return the generics of the Manager of Managers."""
    return {
        "sizes": _runs(len(group) for group in tree.groups),
        "last_group": len(tree.groups) - 1,
        "policy": _policy(tree.policy),
        "top_policy": _policy(tree.top_policy),
        "highs": _runs(number // 256 for group in tree.groups for number in group),
        "watchdog": system.watchdog,
        "has_status": bool(system.status),
    }


def _runs(values: Iterable[int]) -> list[dict[str, int]]:
    """Return the ranges of equal values of an array."""
    runs, first = list[dict[str, int]](), 0
    for value, run in groupby(values):
        runs.append({"first": first, "last": first + len(list(run)) - 1, "value": value})
        first = runs[-1]["last"] + 1
    return runs


def _times(name: str, cycles: Sequence[int | None], system: DerivedSystem) -> dict[str, Any]:
    """Return a constant with a time for each publisher; those of groups that do not need it have any legal one."""
    return {
        "name": name,
        "values": [
            {"id": number, "cycles": value or 1, "block": publisher.block, "is_used": value is not None}
            for number, (value, publisher) in enumerate(zip(cycles, system.publishers, strict=True))
        ],
    }
