"""The tasks of a system: what its publishers send, and by when."""

from __future__ import annotations

from dataclasses import dataclass

from fusesoc_firm.diagnostics import Diagnostics
from fusesoc_firm.system.derived import DerivedSystem


@dataclass(frozen=True)
class Task:
    """A sporadic task, in cycles.

    Its requests come at least `period` apart, and never before its last transfer is over; each wants `transfer_time`
    beats, and wants them sent `deadline` cycles after it is first seen. The deadline may be shorter or longer than the
    period (section 4.1).
    """

    name: str
    period: int
    transfer_time: int
    deadline: int

    def __post_init__(self) -> None:
        for key in ("period", "transfer_time", "deadline"):
            if getattr(self, key) < 1:
                raise ValueError(f"{key} of '{self.name}' is {getattr(self, key)}; legal: 1 and more cycles")


def tasks_of(system: DerivedSystem) -> tuple[Task, ...]:
    """The publishers' tasks, in the order of their ids. Raises `InputError` for every time that is not known."""
    faults = Diagnostics()
    found = []
    for publisher, times in zip(system.publishers, system.scheduling.times, strict=True):
        if times.period is None:
            faults.error(f"the 'period' of publisher '{publisher.block}' is not given")
        if times.transfer_time is None:
            faults.error(f"publisher '{publisher.block}' needs a 'wcet': the size of its message has no bound")
        if times.period and times.transfer_time:
            deadline = times.deadline or times.period
            found.append(Task(publisher.block, times.period, times.transfer_time, deadline))
    faults.raise_if_any()
    return tuple(found)
