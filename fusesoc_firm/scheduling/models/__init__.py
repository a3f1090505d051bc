"""Cycle-exact models of the schedulers in cores/sched, by the name of their policy."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fusesoc_firm.scheduling.models.base import Generics, Scheduler
from fusesoc_firm.scheduling.models.combined import Combined
from fusesoc_firm.scheduling.models.edf import edf_latency, edf_resources
from fusesoc_firm.scheduling.models.fixed_priority import FixedPriority, PreemptiveFixedPriority
from fusesoc_firm.scheduling.models.lru import lru
from fusesoc_firm.scheduling.models.lst import lst
from fusesoc_firm.scheduling.models.round_robin import RoundRobin

__all__ = ["POLICIES", "Combined", "Generics", "Policy", "Scheduler"]

# Makes a scheduler just after reset; raises `ValueError` for generics that the entity refuses.
Policy = Callable[[Generics], Scheduler]

POLICIES: Mapping[str, Policy] = {
    "fixed_priority": lambda generics: FixedPriority(generics.batch, generics.requesters),
    "fixed_priority_preemptive": lambda generics: PreemptiveFixedPriority(
        generics.batch, generics.requesters, generics.shortest_run
    ),
    "round_robin": lambda generics: RoundRobin(generics.batch, generics.requesters),
    "lru": lambda generics: lru(generics.batch, generics.requesters),
    "edf_resources": edf_resources,
    "edf_latency": edf_latency,
    "lst": lst,
}
