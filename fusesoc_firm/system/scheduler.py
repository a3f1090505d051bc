"""The scheduler's instance at the top level, and the constants with the publishers' times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fusesoc_firm.system.derived import DerivedSystem
from fusesoc_firm.system.maps import port_map
from fusesoc_firm.system.timing import WITH_DEADLINES, WITH_TRANSFER_TIMES

# One entity serves both policies of fixed priorities.
_FIXED_PRIORITY = "fixed_priority"


def scheduler_configuration(system: DerivedSystem) -> dict[str, Any]:
    """The scheduler's entity, its generics, and the constants with the publishers' times that these name."""
    scheduling = system.scheduling
    policy = scheduling.policy
    generics = {"REQUESTERS": str(len(system.publishers))}
    constants = []
    is_fixed = policy.startswith(_FIXED_PRIORITY)
    if is_fixed and scheduling.is_preemptive:
        generics["PREEMPTIVE"] = "true"
    if policy in WITH_DEADLINES:
        deadlines = [item.deadline for item in scheduling.times]
        periods = [item.period or item.deadline for item in scheduling.times]
        constants += [_times("PERIODS", periods, system), _times("DEADLINES", deadlines, system)]
    if policy in WITH_TRANSFER_TIMES:
        constants.append(_times("TRANSFER_TIMES", [item.transfer_time for item in scheduling.times], system))
    generics |= {str(item["name"]): str(item["name"]) for item in constants}
    if constants:
        generics["TIME_BITS"] = str(scheduling.time_bits)
    if scheduling.is_preemptive:
        generics["SHORTEST_RUN"] = str(scheduling.shortest_run)
    return {
        "scheduler": f"firm_sched_{_FIXED_PRIORITY if is_fixed else policy}",
        "scheduler_generics": port_map(generics.items()),
        "is_preemptive": scheduling.is_preemptive,
        "scheduler_times": {"constants": constants} if constants else None,
    }


def _times(name: str, cycles: Sequence[int | None], system: DerivedSystem) -> dict[str, Any]:
    """A constant with one time a publisher."""
    return {
        "name": name,
        "values": [
            {"id": number, "cycles": value, "block": publisher.block}
            for number, (value, publisher) in enumerate(zip(cycles, system.publishers, strict=True))
        ],
    }
