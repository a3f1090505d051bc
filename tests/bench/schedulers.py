"""The schedulers that are measured: each policy's entity, with times spread as in the large data set of section 4.3."""

from __future__ import annotations

from pathlib import Path

from fusesoc_firm.system.specification import SCHEDULERS
from fusesoc_firm.system.timing import WITH_TRANSFER_TIMES
from tests.sim.ghdl import Library, core_files
from tests.sim.schedulers import ENTITIES, POLICY_CORES, wrapper

POLICIES = SCHEDULERS
TIME_BITS = 16
SHORTEST_TIME, LONGEST_TIME = 50, 150

_ENTITY = "measured_scheduler"


def analysed(folder: Path, policy: str, requesters: int) -> tuple[Library, str]:
    """A policy's entity for so many requesters in a library of its own, and what it is called there."""
    firm, work = Library("firm", folder), Library("work", folder)
    firm.analyse(core_files("axis/axis", "sched/package", *(f"sched/{core}" for core in POLICY_CORES)))
    file = folder / f"{_ENTITY}.vhd"
    entity = ENTITIES[policy]
    file.write_text(wrapper(_ENTITY, entity.entity, requesters, _generics(policy, requesters)), encoding="ascii")
    work.analyse([file])
    return work, _ENTITY


def _generics(policy: str, requesters: int) -> dict[str, str]:
    entity = ENTITIES[policy]
    generics = {"REQUESTERS": str(requesters), **{name: str(value).lower() for name, value in entity.generics.items()}}
    if entity.has_times:
        generics |= {"TIME_BITS": str(TIME_BITS), "PERIODS": _times(37, requesters)}
    if policy in WITH_TRANSFER_TIMES:
        generics["TRANSFER_TIMES"] = _times(61, requesters)
    return generics


def _times(step: int, requesters: int) -> str:
    """A time for each requester, which have nothing in common."""
    range_of_times = LONGEST_TIME - SHORTEST_TIME + 1
    times = (SHORTEST_TIME + step * requester % range_of_times for requester in range(requesters))
    return f"({', '.join(f'{requester} => {time}' for requester, time in enumerate(times))})"
