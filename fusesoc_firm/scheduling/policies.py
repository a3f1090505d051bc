"""The scheduling policies, each with a row here, a model in `models` and a core in cores/sched.

`make policies` writes the cores' lists of policies (tools/policies).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType


class Order(StrEnum):
    """The order in which a policy serves tasks; the analysis derives bounds from this order."""

    PRIORITY = "fixed priorities"
    TURNS = "each other task at most once before a task"
    DEADLINE = "earliest deadline first"
    SLACK = "least slack first"
    OTHER = "no known bound"


@dataclass(frozen=True)
class Policy:
    """A policy; `name` is its name in specifications, and the name of the model's function and file."""

    name: str
    title: str
    """The name in the dissertation's tables, or a similar one."""
    order: Order = Order.OTHER
    is_preemptive: bool = False
    has_deadlines: bool = False
    """Whether the policy compares times to deadlines, so that its core has deadlines as a generic."""
    has_transfer_times: bool = False
    """Whether the policy's core also has transfer times as a generic."""
    most_at_once: int = 256
    """The maximum number of requesters that the core compares in one cycle; with more, tasks wait in a queue."""
    queue_cycles: int = 2
    """The number of cycles of an operation of that queue."""
    model: str = ""
    """The name of the model's file if it differs from the policy's name."""
    core: str = ""
    """The core in cores/sched, with the entity firm_sched_<core>, if its name differs from the policy's name."""

    @property
    def model_file(self) -> str:
        """The module of `models` with the function `name`."""
        return self.model or self.name

    @property
    def core_file(self) -> str:
        """The name of the core's file, without its suffix."""
        return self.core or self.name

    @property
    def entity(self) -> str:
        """The name of the core's entity."""
        return f"firm_sched_{self.core_file}"

    @property
    def generics(self) -> tuple[str, ...]:
        """The generics of the entity except REQUESTERS."""
        uses = {
            "PREEMPTIVE": self.is_preemptive and self.order is Order.PRIORITY,
            "PERIODS": self.has_deadlines,
            "DEADLINES": self.has_deadlines,
            "TRANSFER_TIMES": self.has_transfer_times,
            "TIME_BITS": self.has_deadlines or self.has_transfer_times,
            "SHORTEST_RUN": self.is_preemptive,
        }
        return tuple(generic for generic, is_used in uses.items() if is_used)


_ROWS = (
    Policy("fixed_priority", "Non-Preemptive FP", Order.PRIORITY),
    Policy(
        "fixed_priority_preemptive",
        "Preemptive FP",
        Order.PRIORITY,
        is_preemptive=True,
        model="fixed_priority",
        core="fixed_priority",
    ),
    Policy("round_robin", "Round robin", Order.TURNS),
    Policy("lru", "LRU", Order.TURNS, most_at_once=16),
    Policy(
        "edf_resources",
        "Resources-Optimized EDF",
        Order.DEADLINE,
        is_preemptive=True,
        has_deadlines=True,
        most_at_once=0,
        model="edf",
    ),
    Policy(
        "edf_latency",
        "Latency-Optimized EDF",
        Order.DEADLINE,
        is_preemptive=True,
        has_deadlines=True,
        most_at_once=8,
        queue_cycles=1,
        model="edf",
    ),
    Policy(
        "lst",
        "LST",
        Order.SLACK,
        is_preemptive=True,
        has_deadlines=True,
        has_transfer_times=True,
        most_at_once=8,
    ),
)

POLICIES: Mapping[str, Policy] = MappingProxyType({policy.name: policy for policy in _ROWS})
"""All policies, in the order in which specifications, VHDL and pages list them."""

DEFAULT = "fixed_priority"
