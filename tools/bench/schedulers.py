"""The schedulers that are measured: of each policy, and combined ones; times are as in the large set of section 4.3."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from fusesoc_firm.scheduling.evaluation.combinations import TOP
from fusesoc_firm.scheduling.policies import POLICIES
from tests.cores.schedulers import POLICY_CORES, preset_generics, wrapper
from tests.hdl.ghdl import Library, core_files

TIME_BITS = 16
SHORTEST_TIME, LONGEST_TIME = 50, 150

_ENTITY = "measured_scheduler"


def analysed(folder: Path, policy: str, requesters: int) -> tuple[Library, str]:
    """A policy's entity for so many requesters in a library of its own, and what it is called there."""
    return _wrapped(folder, POLICIES[policy].entity, requesters, _generics(policy, requesters))


def combined(folder: Path, policies: Sequence[str], requesters: int) -> tuple[Library, str]:
    """The same of a scheduler of schedulers, whose groups of these policies share the requesters evenly."""
    generics = {
        "REQUESTERS": str(requesters),
        "SIZES": _aggregate(requesters // len(policies) for _ in policies),
        "POLICIES": _aggregate(policies),
        "TOP_POLICY": TOP,
        **_times(requesters),
    }
    return _wrapped(folder, "firm_sched_combined", requesters, generics)


def _wrapped(folder: Path, entity: str, requesters: int, generics: Mapping[str, str]) -> tuple[Library, str]:
    firm, work = Library("firm", folder), Library("work", folder)
    cores = (*POLICY_CORES, "by_policy", "combined")
    firm.analyse(core_files("axis/package", "axis/axis", "sched/package", *(f"sched/{core}" for core in cores)))
    file = folder / f"{_ENTITY}.vhd"
    file.write_text(wrapper(_ENTITY, entity, requesters, generics), encoding="ascii")
    work.analyse([file])
    return work, _ENTITY


def _generics(policy: str, requesters: int) -> dict[str, str]:
    preset = {name: str(value).lower() for name, value in preset_generics(policy).items()}
    generics = {"REQUESTERS": str(requesters), **preset}
    times = _times(requesters) if POLICIES[policy].has_deadlines else {}
    if not POLICIES[policy].has_transfer_times:
        times.pop("TRANSFER_TIMES", None)
    return generics | times


def _times(requesters: int) -> dict[str, str]:
    """All generics that are about time; the steps have nothing in common with each other."""
    return {
        "TIME_BITS": str(TIME_BITS),
        "PERIODS": _aggregate(_spread(37, requesters)),
        "TRANSFER_TIMES": _aggregate(_spread(61, requesters)),
    }


def _spread(step: int, requesters: int) -> Iterator[int]:
    """A time for each requester."""
    range_of_times = LONGEST_TIME - SHORTEST_TIME + 1
    return (SHORTEST_TIME + step * requester % range_of_times for requester in range(requesters))


def _aggregate(values: Iterable[object]) -> str:
    """An array in VHDL; with names, since one of a single value needs them."""
    return f"({', '.join(f'{index} => {value}' for index, value in enumerate(values))})"
