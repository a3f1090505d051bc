"""Areas of the Manager and of schedulers as a file: the choice of a scheduler compares them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from fusesoc_firm.scheduling.area import FILE, Area
from tests.hdl.ghdl import REPOSITORY
from tools.bench.tables import Table

PATH = REPOSITORY / "fusesoc_firm" / "scheduling" / FILE

# The Manager is that of the dissertation's streams.
_WIDTHS = ("", "8")
_COLUMNS = ("design", "requesters", "lut", "ff")
_DESIGN = re.compile(r"(\S+), N = (\d+)")


def write_areas(tables: Iterable[Table], path: Path = PATH) -> None:
    """Write the tables of the Manager and of schedulers; entries that could not be measured are omitted."""
    found = {}
    for table in tables:
        columns = [table.columns.index(name) for name in ("design", "bits", "LUT", "FF", "LUT as RAM")]
        for row in table.rows:
            design, width, lut, ff, memory = (row[column] for column in columns)
            name = _DESIGN.fullmatch(design)
            if name and lut and width in _WIDTHS:
                # LUTs that are memory are LUTs.
                found[name[1], int(name[2])] = Area(int(lut) + int(memory or 0), int(ff))
    rows = [
        ",".join(_COLUMNS),
        *(f"{design},{number},{area.lut},{area.ff}" for (design, number), area in sorted(found.items())),
    ]
    path.write_text("\n".join([*rows, ""]), encoding="utf-8")
