"""Least slack time first (section 4.2.4), preemptive."""

from __future__ import annotations

from fusesoc_firm.scheduling.models.base import Generics, Scheduler
from fusesoc_firm.scheduling.models.engine import Engine, Heap, Preemption, Times, check_times
from fusesoc_firm.scheduling.models.parallel import Parallel


def lst(generics: Generics) -> Scheduler:
    """Return a scheduler that compares few requesters in parallel; with more requesters, tasks wait in a heap.

    Raise `ValueError` if the transfer times are missing.
    """
    if generics.transfer_times is None:
        raise ValueError("transfer_times is None; legal: the beats of each requester's tasks")
    check_times("deadline", generics.relative_deadlines, generics.time_bits)
    check_times("transfer time", generics.transfer_times, generics.time_bits)
    slacks = generics.relative_deadlines - generics.transfer_times
    if generics.requesters <= Parallel.MAX_REQUESTERS:
        return Parallel(slacks, generics.time_bits, sends_own_time=True, shortest_run=generics.shortest_run)
    return Engine(
        generics.batch,
        generics.requesters,
        Heap(generics.batch, generics.requesters),
        Times(slacks, generics.time_bits),
        Preemption(generics.shortest_run, sends_own_time=True),
    )
