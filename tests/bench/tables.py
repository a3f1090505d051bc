"""Tables of figures, as Markdown that is aligned: the same text for the terminal and for docs/figures."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from dataclasses import dataclass

from fusesoc_firm.scheduling.tables import grid

NOT_CONVERTED = "not converted"
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


def filled(text: str) -> str:
    """A paragraph in lines as long as docs have them."""
    return textwrap.fill(" ".join(text.split()), _LINE_LENGTH, break_on_hyphens=False)
