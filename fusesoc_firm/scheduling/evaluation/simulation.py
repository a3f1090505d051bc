"""Simulate requesters and a sink around a scheduler's model, cycle by cycle, for all sets of a data set at once.

A requester follows section 4.3: it asserts its request, holds the request until all beats are accepted (AXI-Stream),
pauses for the number of cycles called its frequency, and requests again. The sink accepts a beat in every cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fusesoc_firm.scheduling.evaluation.workloads import Times, Workload

Flags = NDArray[np.bool_]


class SchedulerModel(Protocol):
    """The interface to a scheduler's model: the two output registers for B sets, and the clock edge."""

    @property
    def grant_valid(self) -> Flags:
        """Whether a requester has been granted since reset, shape (B,)."""

    @property
    def grant_select(self) -> Times:
        """The granted requester, shape (B,)."""

    def step(self, request: Flags, beat: Flags, last: Flags) -> None:
        """Simulate a rising edge; `request` has the shape (B, N), `beat` and `last` have the shape (B,)."""


@dataclass(frozen=True)
class Tasks:
    """All granted tasks as arrays with one element per task, in the order of completion; unfinished tasks are last.

    Times are clock edges: an event in cycle k begins at k and ends at k + 1. For a task that the end of the simulation
    cut short, `finish` is -1.
    """

    set: Times
    requester: Times
    arrival: Times
    """The time at which the request is first seen (a_i in equation 4.3)."""
    grant: Times
    """The time at which request and grant are first seen together (g_i); with this sink, the first beat then begins."""
    finish: Times
    """The time at which the last beat ends (f_i in equation 4.5)."""
    preemptions: Times
    """The number of times that another requester was granted between the task's beats."""

    @property
    def is_finished(self) -> Flags:
        """Whether the last beat of each task was accepted."""
        return np.asarray(self.finish >= 0)


@dataclass(frozen=True)
class Trace:
    """The result of a simulation: its tasks, and the cycles of each set, shape (B,)."""

    workload: Workload
    cycles: int
    tasks: Tasks
    busy: Times
    """The number of cycles in which a beat was accepted."""
    requested: Times
    """The number of cycles in which at least one requester requested."""


def simulate(
    model: SchedulerModel,
    workload: Workload,
    cycles: int,
    first_requests: Times | None = None,
    resume_beats: int = 0,
) -> Trace:
    """Simulate a model for a number of cycles after its reset, and return the trace.

    `first_requests` (B, N) are the cycles of the first requests. If `first_requests` is None, each requester makes its
    first request after its usual pause. Section 4.3 does not define the times of the first requests. This choice
    explains the maxima of table 4.3 for two accelerators; simultaneous first requests would result in maxima that are a
    quarter larger. Each run of a task except the first run begins with `resume_beats` additional cycles, which the
    Manager needs to resume a burst; the scheduler sees no beat in these cycles.
    """
    first = workload.frequencies if first_requests is None else first_requests
    environment = _Environment(workload, first, resume_beats)
    for cycle in range(cycles):
        environment.step(model, cycle)
    return environment.trace(cycles)


class _Environment:
    """All requesters, as flat arrays: element b * N + i is requester i of set b."""

    def __init__(self, workload: Workload, first_requests: Times, resume_beats: int) -> None:
        shape = workload.transfer_times.shape
        self.workload = workload
        self.resume_beats = resume_beats
        self.lengths = workload.transfer_times.ravel()
        self.pauses = workload.frequencies.ravel()
        periods = np.zeros_like(workload.frequencies) if workload.periods is None else workload.periods
        self.periods = periods.ravel()
        self.base = np.arange(shape[0]) * shape[1]
        # 32 bits for speed, since these values are compared with the time in every cycle.
        self.next_request = first_requests.astype(np.int32)
        self.request = np.zeros(shape, np.bool_)
        count = self.lengths.size
        self.remaining = self.lengths.copy()
        self.arrival = np.zeros(count, np.int64)
        self.grant = np.full(count, -1, np.int64)
        self.preemptions = np.zeros(count, np.int64)
        # The current run: its task, and the remaining cycles of its resumption.
        self.running = self.base.copy()
        self.owed = np.zeros(shape[0], np.int64)
        self.busy = np.zeros(shape[0], np.int64)
        self.requested = np.zeros(shape[0], np.int64)
        self.finished: list[tuple[Times, Times, Times, Times, Times]] = []

    def step(self, model: SchedulerModel, cycle: int) -> None:
        """Simulate one cycle: read the registers, derive the beats, and apply the edge."""
        self._arrive(cycle)
        granted = self.base + model.grant_select
        asks = self.request.ravel()[granted]
        served = model.grant_valid & asks
        self._begin_runs(granted, served, cycle)
        beat = served
        if self.resume_beats:
            beat = served & (self.owed == 0)
            self.owed -= served & (self.owed > 0)
        remaining = self.remaining[granted] - beat
        self.remaining[granted] = remaining
        last = beat & (remaining == 0)
        self.busy += beat
        model.step(self.request, beat, last)
        if last.any():
            self._finish(granted[last], cycle + 1)

    def _arrive(self, cycle: int) -> None:
        arrivals = self.next_request == cycle
        if arrivals.any():
            self.request |= arrivals
            self.arrival[arrivals.ravel()] = cycle
        self.requested += self.request.any(axis=1)

    def _begin_runs(self, granted: Times, served: Flags, cycle: int) -> None:
        """Where the served task changes, record the new task's first grant or resumption, and the interrupted task."""
        begins = served & ((granted != self.running) | (self.grant[granted] < 0))
        if not begins.any():
            return
        new, old = granted[begins], self.running[begins]
        # The interrupted task has begun and is unfinished, unless it is itself the task that begins.
        interrupted = old[(self.grant[old] >= 0) & (old != new)]
        self.preemptions[interrupted] += 1
        is_first = self.grant[new] < 0
        self.grant[new[is_first]] = cycle
        self.owed[begins] = np.where(is_first, 0, self.resume_beats)
        self.running[begins] = new

    def _finish(self, done: Times, time: int) -> None:
        ends = np.full(done.size, time)
        self.finished.append((done, self.arrival[done], self.grant[done], ends, self.preemptions[done]))
        self.request.ravel()[done] = False
        self.next_request.ravel()[done] = np.maximum(time + self.pauses[done], self.arrival[done] + self.periods[done])
        self.remaining[done] = self.lengths[done]
        self.grant[done] = -1
        self.preemptions[done] = 0

    def trace(self, cycles: int) -> Trace:
        """Return the tasks recorded so far, including unfinished tasks that have begun."""
        cut = np.flatnonzero(self.grant >= 0)
        cut_short = (cut, self.arrival[cut], self.grant[cut], np.full(cut.size, -1), self.preemptions[cut])
        columns = [np.concatenate(column) for column in zip(*self.finished, cut_short, strict=True)]
        index = columns[0]
        requesters = self.workload.requesters
        tasks = Tasks(index // requesters, index % requesters, *columns[1:])
        return Trace(self.workload, cycles, tasks, self.busy, self.requested)
