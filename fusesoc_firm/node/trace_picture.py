"""Draw the table of a trace with matplotlib, an extra dependency: `pip install 'fusesoc-firm[plots]'`."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any

from fusesoc_firm.node.trace import COLUMNS
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import check_output
from fusesoc_firm.text.quoting import plot_text

SUFFIXES = (".pdf", ".png", ".svg")

_Row = dict[str, float | str | None]

# The stages between successive columns, by the wall clock and in simulated time.
_WALL = (
    ("to the queue", "received_ns", "queued_ns"),
    ("queue and sending", "queued_ns", "sent_ns"),
    ("hardware", "sent_ns", "came_ns"),
    ("publishing", "came_ns", "published_ns"),
)
_CYCLES = (
    ("frame in", "first_beat_in_cycle", "last_beat_in_cycle"),
    ("accelerator", "last_beat_in_cycle", "first_beat_out_cycle"),
    ("frame out", "first_beat_out_cycle", "last_beat_out_cycle"),
)
_ROW_INCHES = 2.6
_WIDTH_INCHES = 11.0
# Without a date and matplotlib's random names, the same table always results in the same bytes.
_SETTINGS = {"svg.hashsalt": "firm", "font.size": 9}
_METADATA: dict[str, dict[str, None]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}


def draw_trace(table: Path, picture: Path) -> None:
    """Draw a table that `Trace` wrote: a row of panels for each route, with wall time beside simulated time.

    Raise `InputError` for another kind of file, for an unknown picture format, and if matplotlib is missing.
    """
    check_output(picture, SUFFIXES)
    ways = _ways(table)
    if not ways:
        fail(f"{table} contains no messages with a response")
    plots = _plots()
    size = (_WIDTH_INCHES, _ROW_INCHES * len(ways) + 0.4)
    drawing, axes = plots.subplots(len(ways), 2, figsize=size, squeeze=False, layout="constrained")
    for (left, right), ((subscriber, publisher), rows) in zip(axes, ways.items(), strict=True):
        way = plot_text(f"{subscriber} to {publisher}")
        left.set_title(f"{way}: wall time")
        right.set_title(f"{way}: simulated time")
        _draw(left, rows, _WALL, lambda nanoseconds: nanoseconds / 1000, "us")
        _draw(right, rows, _CYCLES, float, "cycles")
    try:
        drawing.savefig(picture, metadata=_METADATA[picture.suffix])
    except OSError as error:
        fail(f"cannot write {picture}: {error.strerror}")
    plots.close(drawing)


def _draw(
    axis: Any, rows: Sequence[_Row], parts: Sequence[tuple[str, str, str]], scale: Callable[[float], float], unit: str
) -> None:
    """Draw each message as a bar of stacked stages; a stage that began before the stage below it is omitted."""
    whole = [row for row in rows if all(row[name] is not None for _, *names in parts for name in names)]
    axis.set_xlabel("message")
    axis.set_ylabel(unit)
    if not whole:
        axis.text(0.5, 0.5, "unknown for this hardware", ha="center", va="center", transform=axis.transAxes)
        return
    numbers = [_number(row["message"]) for row in whole]
    bottom = [0.0] * len(whole)
    for label, first, last in parts:
        spans = [max(0.0, scale(_number(row[last]) - _number(row[first]))) for row in whole]
        middle = median(scale(_number(row[last]) - _number(row[first])) for row in whole)
        axis.bar(numbers, spans, bottom=bottom, width=1.0, linewidth=0, label=f"{label}, median {middle:.4g}")
        bottom = [below + span for below, span in zip(bottom, spans, strict=True)]
    axis.legend(fontsize="small")


def _ways(table: Path) -> dict[tuple[str, str], list[_Row]]:
    """Return the rows of messages with a response, by route."""
    try:
        with table.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            if tuple(reader.fieldnames or ()) != COLUMNS:
                fail(f"{table} is not a node's trace", hint="'firm live ... --trace F.csv' writes a trace")
            found = [*reader]
    except OSError as error:
        fail(f"cannot read {table}: {error.strerror}")
    except (UnicodeDecodeError, csv.Error) as error:
        fail(f"cannot read {table}: {error}")
    ways: dict[tuple[str, str], list[_Row]] = {}
    for number, row in enumerate(found, start=2):
        if row["message"] and row["publisher"]:
            ways.setdefault((row["subscriber"], row["publisher"]), []).append(_values(row, f"{table}:{number}"))
    return ways


def _values(row: dict[str, str], place: str) -> _Row:
    words = ("subscriber", "publisher")
    try:
        return {name: text if name in words else float(text) if text else None for name, text in row.items()}
    except (TypeError, ValueError):
        fail(f"{place} is not a valid row of a trace")


def _number(value: float | str | None) -> float:
    assert isinstance(value, float), "only a row without missing values can be drawn"
    return value


def _plots() -> Any:
    try:
        matplotlib: Any = import_module("matplotlib")
    except ImportError:
        fail("pictures require matplotlib", hint="pip install 'fusesoc-firm[plots]'")
    matplotlib.use("Agg")
    plots: Any = import_module("matplotlib.pyplot")
    plots.rcParams.update(_SETTINGS)
    return plots
