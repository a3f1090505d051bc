"""The values of the dissertation's tables 4.1 to 4.6, from the data file beside this module."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

Row = list[float]

EVALUATED = ("lru", "fixed_priority", "fixed_priority_preemptive", "edf_resources", "edf_latency", "lst")
"""The dissertation's six policies, in the order of its tables."""


@dataclass(frozen=True)
class Dissertation:
    """The tables by policy and number of accelerators; comments in the data file describe the rows."""

    area: dict[str, dict[int, Row]]
    edf_ratio: dict[int, Row]
    response_time: dict[str, dict[int, Row]]
    lateness: dict[str, dict[int, Row]]
    combined_area: dict[str, Row]
    comparison: dict[int, dict[str, list[str]]]


@cache
def dissertation() -> Dissertation:
    """Return all tables of the data file."""
    return Dissertation(**yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")))
