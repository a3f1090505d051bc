"""Earliest deadline first (section 4.2.3), preemptive."""

from __future__ import annotations

from fusesoc_firm.scheduling.models.base import Generics, Scheduler
from fusesoc_firm.scheduling.models.engine import Engine, Heap, Preemption, SortedQueue, Times, check_times
from fusesoc_firm.scheduling.models.parallel import Parallel


def edf_resources(generics: Generics) -> Scheduler:
    """Return the variant with few LUTs, in which tasks wait in a heap."""
    check_times("deadline", generics.relative_deadlines, generics.time_bits)
    return _engine(generics, Heap(generics.batch, generics.requesters))


def edf_latency(generics: Generics) -> Scheduler:
    """Return the low-latency variant, which compares few requesters in parallel and keeps more in a sorted queue."""
    check_times("deadline", generics.relative_deadlines, generics.time_bits)
    if generics.requesters <= Parallel.MAX_REQUESTERS:
        return Parallel(generics.relative_deadlines, generics.time_bits, shortest_run=generics.shortest_run)
    return _engine(generics, SortedQueue(generics.batch, generics.requesters))


def _engine(generics: Generics, queue: Heap | SortedQueue) -> Scheduler:
    return Engine(
        generics.batch,
        generics.requesters,
        queue,
        Times(generics.relative_deadlines, generics.time_bits),
        Preemption(generics.shortest_run),
    )
