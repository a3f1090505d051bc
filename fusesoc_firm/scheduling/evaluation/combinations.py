"""The combined schedulers of section 4.3.5: two schedulers with half the accelerators each, below an LRU scheduler."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from fusesoc_firm.scheduling.models import Combined, Generics, make_model

COMBINED_REQUESTERS = 256
"""The number of accelerators with which combined schedulers are evaluated."""

COMBINATIONS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "(LOEDF128+LOEDF128)+LRU2": ("edf_latency", "edf_latency"),
        "(LOEDF128+LST128)+LRU2": ("edf_latency", "lst"),
        "(LST128+LST128)+LRU2": ("lst", "lst"),
        "(LST128+LOEDF128)+LRU2": ("lst", "edf_latency"),
    }
)
"""The policies for the lower and the upper half of the accelerators, by the combination's name in table 4.5."""

TOP = "lru"
"""The policy that chooses between the two halves."""


def combined(policies: tuple[str, str], generics: Generics) -> Combined:
    """Return the model of a combination; its two halves contain the requesters in their original order."""
    half = generics.requesters // 2
    parts = (slice(0, half), slice(half, None))
    groups = [make_model(policy, generics.part(part)) for policy, part in zip(policies, parts, strict=True)]
    return Combined(groups, make_model(TOP, Generics(np.ones((generics.batch, 2), np.int64))))
