"""LUTs and flip-flops of the schedulers and of the Manager, measured by `make bench BENCH=manager`.

The file `area.csv` next to this module has the columns design, requesters, lut and ff. A design is a policy, a
combination of policies with its name from table 4.5, or the Manager for 8-bit streams without a scheduler. The areas of
all other designs and numbers of requesters are unknown.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

FILE = "area.csv"
MANAGER = "manager"
MANAGER_PREEMPTIVE = "manager_preemptive"
"""The Manager that splits interrupted frames into bursts."""


@dataclass(frozen=True)
class Area:
    """The LUTs and flip-flops of a design; LUTs used as memory are counted as LUTs."""

    lut: int
    ff: int

    def __str__(self) -> str:
        return f"{self.lut}/{self.ff}"


Areas = Mapping[tuple[str, int], Area]


@cache
def measured() -> Areas:
    """Return the areas by design and number of requesters; the mapping is empty if nothing was measured."""
    file = resources.files(__package__) / FILE
    return read(file.read_text(encoding="utf-8")) if file.is_file() else {}


def read(text: str) -> dict[tuple[str, int], Area]:
    """Return the areas in the text of a CSV file, by design and number of requesters."""
    rows = csv.DictReader(text.splitlines())
    return {(row["design"], int(row["requesters"])): Area(int(row["lut"]), int(row["ff"])) for row in rows}


def at(areas: Areas, design: str, requesters: int) -> Area | None:
    """Return the area for the smallest known number of at least `requesters`, or None if there is none."""
    known = [number for name, number in areas if name == design and number >= requesters]
    return areas[design, min(known)] if known else None
