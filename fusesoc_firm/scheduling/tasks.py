"""A task: a requester's transfer with its period and deadline."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Task:
    """A sporadic task, in cycles.

    Requests are at least `period` apart, and never precede the end of the last transfer. Each request is for
    `transfer_time` beats, to be sent within `deadline` cycles after the scheduler first sees the request. The deadline
    may be shorter or longer than the period (section 4.1).
    """

    name: str
    period: int
    transfer_time: int
    deadline: int

    def __post_init__(self) -> None:
        for key in ("period", "transfer_time", "deadline"):
            if getattr(self, key) < 1:
                raise ValueError(f"{key} of '{self.name}' is {getattr(self, key)}; legal: 1 or more cycles")
