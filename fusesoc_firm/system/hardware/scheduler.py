"""The scheduler's instance at the top level, and the constants with the publishers' times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.hardware.maps import port_map


def scheduler_configuration(system: DerivedSystem) -> dict[str, Any]:
    """Return the scheduler's entity and generics, with the constants for publishers' times that the generics use."""
    scheduling = system.scheduling
    policy = POLICIES[scheduling.policy]
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
    constants = [_times(name, times[name], system) for name in policy.generics if name in times]
    generics = [(name, values[name]) for name in policy.generics]
    return {
        "scheduler": policy.entity,
        "scheduler_generics": port_map([("REQUESTERS", str(len(system.publishers))), *generics]),
        "is_preemptive": scheduling.is_preemptive,
        "scheduler_times": {"constants": constants} if constants else None,
    }


def _times(name: str, cycles: Sequence[int | None], system: DerivedSystem) -> dict[str, Any]:
    """Return a constant with a time for each publisher."""
    return {
        "name": name,
        "values": [
            {"id": number, "cycles": value, "block": publisher.block}
            for number, (value, publisher) in enumerate(zip(cycles, system.publishers, strict=True))
        ],
    }
