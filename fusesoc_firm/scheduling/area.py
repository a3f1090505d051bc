"""LUTs and flip-flops of the schedulers and of the Manager, measured by `make bench BENCH=manager`.

The file is `area.csv` next to this module, with the columns design, requesters, lut, ff. A design is a policy, a
combination of policies by its name in table 4.5, or the Manager without a scheduler for 8-bit streams. The areas of all
other designs and numbers of requesters are unknown.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path

COLUMNS = ("design", "requesters", "lut", "ff")
FILE = "area.csv"
MANAGER = "manager"
MANAGER_PREEMPTIVE = "manager_preemptive"
"""The Manager that makes bursts of what a scheduler interrupts."""


@dataclass(frozen=True)
class Area:
    """The area of a design; LUTs used as memory count as LUTs."""

    lut: int
    ff: int

    def __str__(self) -> str:
        return f"{self.lut}/{self.ff}"


Areas = Mapping[tuple[str, int], Area]


@cache
def measured() -> Areas:
    """Return the areas by design and number of requesters; empty if nothing was measured."""
    file = resources.files(__package__) / FILE
    return read(file.read_text(encoding="utf-8")) if file.is_file() else {}


def read(text: str) -> dict[tuple[str, int], Area]:
    """Read the areas from the text of a file."""
    rows = csv.DictReader(text.splitlines())
    return {(row["design"], int(row["requesters"])): Area(int(row["lut"]), int(row["ff"])) for row in rows}


def write(path: Path, areas: Areas) -> None:
    """Write the measured areas, in the order of names and numbers."""
    lines: Iterable[tuple[object, ...]] = ((*key, area.lut, area.ff) for key, area in sorted(areas.items()))
    text = "\n".join(",".join(map(str, line)) for line in (COLUMNS, *lines))
    path.write_text(f"{text}\n", encoding="utf-8")


def at(areas: Areas, design: str, requesters: int) -> Area | None:
    """Return the area for a number of requesters, or for the next larger known number, or None if there is no such number."""
    known = [number for name, number in areas if name == design and number >= requesters]
    return areas[design, min(known)] if known else None
