"""The schedulers that are measured: each policy's entity with constant times."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusesoc_firm.render import render
from fusesoc_firm.system.specification import SCHEDULERS
from fusesoc_firm.system.timing import PREEMPTIVE, WITH_DEADLINES, WITH_TRANSFER_TIMES
from tests.sim.ghdl import Library, core_files
from tests.sim.schedulers import POLICY_CORES

POLICIES = SCHEDULERS
TIME_BITS = 16

_ENTITY = "measured_scheduler"
# Times that have nothing in common, so that no table of them folds to a formula.
_LONGEST_PERIOD, _LONGEST_TRANSFER_TIME = 8000, 200


def analysed(folder: Path, policy: str, requesters: int) -> tuple[Library, str]:
    """A policy's entity for so many requesters in a library of its own, and what it is called there."""
    firm, work = Library("firm", folder), Library("work", folder)
    firm.analyse(core_files("axis/axis", "sched/package", *(f"sched/{core}" for core in POLICY_CORES)))
    file = folder / f"{_ENTITY}.vhd"
    file.write_text(render("scheduler.vhd", _configuration(policy, requesters), Path(__file__).parent), "ascii")
    work.analyse([file])
    return work, _ENTITY


def _configuration(policy: str, requesters: int) -> dict[str, Any]:
    generics = {"REQUESTERS": str(requesters)}
    constants = []
    if policy.startswith("fixed_priority"):
        generics["PREEMPTIVE"] = str(policy in PREEMPTIVE).lower()
    if policy in WITH_DEADLINES:
        generics["TIME_BITS"] = str(TIME_BITS)
        constants.append(_times("PERIODS", [_LONGEST_PERIOD - 29 * number for number in range(requesters)]))
    if policy in WITH_TRANSFER_TIMES:
        times = [1 + 7 * number % _LONGEST_TRANSFER_TIME for number in range(requesters)]
        constants.append(_times("TRANSFER_TIMES", times))
    generics |= {item["name"]: item["name"] for item in constants}
    return {
        "entity": _ENTITY,
        "scheduler": f"firm_sched_{policy.removesuffix('_preemptive')}",
        "request_high": requesters - 1,
        "select_high": max(1, (requesters - 1).bit_length()) - 1,
        "constants": constants,
        "generics": [
            {"formal": name, "actual": actual, "comma": "," if number < len(generics) else ""}
            for number, (name, actual) in enumerate(generics.items(), start=1)
        ],
    }


def _times(name: str, cycles: Sequence[int]) -> dict[str, Any]:
    values = [
        {"id": number, "cycles": value, "comma": "," if number < len(cycles) - 1 else ""}
        for number, value in enumerate(cycles)
    ]
    return {"name": name, "high": len(cycles) - 1, "values": values}
