"""The schedulers' areas as a file: `firm scheduler bench` shows them, `firm scheduler choose` compares them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from fusesoc_firm.scheduling.area import FILE, Area, write
from tests.bench.tables import Table
from tests.sim.ghdl import REPOSITORY

PATH = REPOSITORY / "fusesoc_firm" / "scheduling" / FILE

_SCHEDULER = re.compile(r"(\w+), N = (\d+)")


def write_areas(tables: Iterable[Table], path: Path = PATH) -> None:
    """Write what the table of schedulers holds; a scheduler that could not be measured is left out."""
    (table,) = (table for table in tables if table.title == "Schedulers")
    columns = [table.columns.index(name) for name in ("design", "LUT", "FF", "LUT as RAM")]
    found = {}
    for row in table.rows:
        design, lut, ff, memory = (row[column] for column in columns)
        name = _SCHEDULER.fullmatch(design)
        if name and lut and ff:
            # LUTs that are memory are LUTs.
            found[name[1], int(name[2])] = Area(int(lut) + int(memory or 0), int(ff))
    write(path, found)
