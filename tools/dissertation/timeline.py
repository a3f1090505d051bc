"""Recordings of a scheduler's ports, cycle by cycle, for figures 4.8 and 4.9."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusesoc_firm.scheduling.evaluation.jobs import model_of
from fusesoc_firm.scheduling.evaluation.simulation import Flags, SchedulerModel, simulate
from fusesoc_firm.scheduling.evaluation.workloads import Times, Workload


class Recorder:
    """A wrapper that records a scheduler's ports in every cycle."""

    def __init__(self, model: SchedulerModel) -> None:
        self._model = model
        self.request: list[Flags] = []
        """The requests in each cycle, shape (B, N)."""
        self.beat: list[Flags] = []
        self.last: list[Flags] = []
        self.granted: list[Times] = []
        """The granted requester in each cycle, shape (B,); -1 before the first grant."""

    @property
    def grant_valid(self) -> Flags:
        """The scheduler's port of this name."""
        return self._model.grant_valid

    @property
    def grant_select(self) -> Times:
        """The scheduler's port of this name."""
        return self._model.grant_select

    def step(self, request: Flags, beat: Flags, last: Flags) -> None:
        """Record the ports, and simulate a rising edge."""
        self.request.append(request.copy())
        self.beat.append(beat.copy())
        self.last.append(last.copy())
        self.granted.append(np.where(self.grant_valid, self.grant_select, -1))
        self._model.step(request, beat, last)


@dataclass(frozen=True)
class Timeline:
    """The requests of the accelerators, and the granted accelerator (-1: none yet), in each cycle."""

    number: str
    title: str
    requests: tuple[tuple[bool, ...], ...]
    granted: tuple[int, ...]

    @property
    def file_name(self) -> str:
        """The file name without a suffix, such as `figure_4_8`."""
        return f"figure_{self.number.replace('.', '_')}"

    def csv(self) -> str:
        """Return the timeline as CSV, with a row for each cycle."""
        names = [f"request_{index}" for index in range(len(self.requests))]
        lines = [",".join(["cycle", *names, "granted"])]
        for cycle, granted in enumerate(self.granted):
            bits = [str(int(bits[cycle])) for bits in self.requests]
            lines.append(",".join([str(cycle), *bits, "" if granted < 0 else str(granted)]))
        return "\n".join(lines) + "\n"


def timelines() -> tuple[Timeline, Timeline]:
    """Return figure 4.8, LRU with four accelerators, and figure 4.9, a request that waits for the grant."""
    four = Workload(np.array([[9, 5, 7, 4]]), np.array([[6, 9, 5, 12]]))
    two = Workload(np.array([[12, 8]]), np.array([[40, 4]]))
    return (
        Timeline("4.8", "LRU with four accelerators", *record("lru", four, 60)),
        Timeline("4.9", "response time and lateness", *record("fixed_priority", two, 32)),
    )


def record(policy: str, workload: Workload, cycles: int) -> tuple[tuple[tuple[bool, ...], ...], tuple[int, ...]]:
    """Return the requests and the grant of the workload's first set in each cycle.

    All accelerators request in cycle 1.
    """
    recorder = Recorder(model_of(policy, workload))
    simulate(recorder, workload, cycles, np.ones_like(workload.frequencies))
    requests = np.array(recorder.request)[:, 0, :].T
    granted = tuple(int(each[0]) for each in recorder.granted)
    return tuple(tuple(bool(bit) for bit in bits) for bits in requests), granted
