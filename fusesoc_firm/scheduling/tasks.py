"""A task: what a requester sends, and by when."""

from __future__ import annotations

from dataclasses import dataclass


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
