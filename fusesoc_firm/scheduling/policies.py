"""What the policies are called, here and in the dissertation, and what tells them apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Policy:
    """A policy; `name` is its key among the models and its core's file name."""

    name: str
    short: str
    """The dissertation's abbreviation."""
    title: str
    """The dissertation's name in its tables."""
    is_preemptive: bool
    is_fixed: bool = False
    """Whether priorities stay as they are."""


_ALL = (
    Policy("lru", "LRU", "LRU", is_preemptive=False),
    Policy("fixed_priority", "NPFP", "Non-Preemptive FP", is_preemptive=False, is_fixed=True),
    Policy("fixed_priority_preemptive", "PFP", "Preemptive FP", is_preemptive=True, is_fixed=True),
    Policy("edf_resources", "ROEDF", "Resources-Optimized EDF", is_preemptive=True),
    Policy("edf_latency", "LOEDF", "Latency-Optimized EDF", is_preemptive=True),
    Policy("lst", "LST", "LST", is_preemptive=True),
    Policy("round_robin", "RR", "Round robin", is_preemptive=False),
)

POLICIES: Mapping[str, Policy] = MappingProxyType({policy.name: policy for policy in _ALL})
"""All policies, in the order of the dissertation's tables; round robin, which it has not, stands last."""

EVALUATED = tuple(name for name in POLICIES if name != "round_robin")
"""The six of the dissertation."""
