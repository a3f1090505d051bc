"""Tables of figures, as Markdown that is aligned: the same text for the terminal and for docs/figures."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fusesoc_firm.scheduling.tables import grid

NOT_CONVERTED = "not converted"
NOT_MEASURED = "not measured"
MET, MISSED, FAILED = "met", "MISSED", "FAILED"

_LINE_LENGTH = 100

# Called with a line of progress for the user.
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Table:
    """A title, the columns' headings, the rows, and remarks."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def __str__(self) -> str:
        table = self._without_empty_columns()
        text = f"### {self.title}\n\n{grid(table.columns, table.rows)}"
        return f"{text}\n{filled(self.note)}\n" if self.note else text

    @property
    def is_good(self) -> bool:
        """Whether no row failed and none missed its bar."""
        return not any(cell in (MISSED, FAILED) for row in self.rows for cell in row)

    def _without_empty_columns(self) -> Table:
        kept = [index for index in range(len(self.columns)) if any(row[index] for row in self.rows)]
        rows = (tuple(row[index] for index in kept) for row in self.rows)
        return Table(self.title, tuple(self.columns[index] for index in kept), tuple(rows), self.note)


def known_rows(text: str, title: str, columns: Sequence[str], keys: int = 2) -> dict[tuple[str, ...], tuple[str, ...]]:
    """The rows of a table in a text, by their cells in the first columns; columns without entries are restored."""
    found = re.search(rf"^### {re.escape(title)}\n\n((?:\|.*\n)+)", text, re.MULTILINE)
    if not found:
        return {}
    heading, _, *lines = ([cell.strip() for cell in line.strip("|").split("|")] for line in found[1].splitlines())
    rows = (dict(zip(heading, line, strict=True)) for line in lines)
    return {cells[:keys]: cells for cells in (tuple(row.get(name, "") for name in columns) for row in rows)}


def filled(text: str) -> str:
    """A paragraph in lines as long as docs have them."""
    return textwrap.fill(" ".join(text.split()), _LINE_LENGTH, break_on_hyphens=False)
