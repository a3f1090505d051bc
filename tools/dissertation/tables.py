"""Reproduced tables and figures as plain values, with their forms in Markdown and CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fusesoc_firm.scheduling.tables import UNKNOWN, decimal, grid


@dataclass(frozen=True)
class Table:
    """A reproduced table: its number in the dissertation (`4.3`), a title, rows of cells, and remarks."""

    number: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    @property
    def file_name(self) -> str:
        """The file name without a suffix, such as `table_4_3`."""
        return f"table_{self.number.replace('.', '_')}"


@dataclass(frozen=True)
class Panel:
    """A diagram: for each scheduler's name, one value for each number of accelerators; NaN means no value.

    `dissertation` contains the corresponding values from the dissertation's tables, if there are any.
    """

    title: str
    series: Mapping[str, Sequence[float]]
    dissertation: Mapping[str, Sequence[float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Figure:
    """A reproduced figure of the dissertation: panels side by side, each over the numbers of accelerators."""

    number: str
    title: str
    unit: str
    requesters: tuple[int, ...]
    panels: tuple[Panel, ...]

    @property
    def file_name(self) -> str:
        """The file name without a suffix, such as `figure_4_10`."""
        return f"figure_{self.number.replace('.', '_')}"


def markdown(table: Table) -> str:
    """Return the table in Markdown, under its heading and with aligned columns."""
    text = f"### Table {table.number}: {table.title}\n\n{grid(table.columns, table.rows)}"
    return f"{text}\n{table.note}\n" if table.note else text


def figure_markdown(figure: Figure) -> str:
    """Return the values of a figure in Markdown, under its heading and with a table for each panel."""
    parts = [f"### Figure {figure.number}: {figure.title} ({figure.unit})\n"]
    for panel in figure.panels:
        columns = ("accelerators", *panel.series)
        rows = [
            (str(number), *(decimal(values[index]) for values in panel.series.values()))
            for index, number in enumerate(figure.requesters)
        ]
        parts.append(f"{panel.title}:\n\n{grid(columns, rows)}")
    return "\n".join(parts)


def table_csv(table: Table) -> str:
    """Return the table's cells as CSV; unknown values are empty."""
    return _csv(table.columns, [["" if cell == UNKNOWN else cell for cell in row] for row in table.rows])


def figure_csv(figure: Figure) -> str:
    """Return CSV text with a row for each point, which includes the dissertation's value where it is known."""
    rows = [
        [
            panel.title,
            name,
            number,
            _number(values[index]),
            _number(panel.dissertation[name][index] if name in panel.dissertation else math.nan),
        ]
        for panel in figure.panels
        for name, values in panel.series.items()
        for index, number in enumerate(figure.requesters)
    ]
    return _csv(("panel", "scheduler", "accelerators", "value", "dissertation"), rows)


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


def _csv(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue()
