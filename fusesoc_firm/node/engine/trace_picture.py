"""Draw the table of a trace with matplotlib, an extra dependency: `pip install 'fusesoc-firm[plots]'`."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from importlib import import_module
from math import ceil
from pathlib import Path
from typing import Any

from fusesoc_firm.node.engine.trace import COLUMNS
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
_ROW_INCHES = 4.2
_WIDTH_INCHES = 11.0
_NANOSECONDS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}
_PERCENTILES = (50, 95, 99)
# Without a date and matplotlib's random names, the same table always results in the same bytes.
_SETTINGS = {"svg.hashsalt": "firm", "font.size": 9, "axes.titlesize": 9}
_METADATA: dict[str, dict[str, None]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}


def draw_trace(table: Path, picture: Path) -> None:
    """Draw a table that `Trace` wrote: a row of panels for each route, with wall time beside simulated time.

    A panel is a timeline: each message has a row, and each stage a bar from its begin to its end, counted from the
    begin of the first stage. Raise `InputError` for another kind of file, for an unknown picture format, and if
    matplotlib is missing.
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
        _draw(left, rows, _WALL, f"{way}, wall time", 1.0)
        _draw(right, rows, _CYCLES, f"{way}, simulated time", _cycle(rows))
    try:
        drawing.savefig(picture, metadata=_METADATA[picture.suffix])
    except OSError as error:
        fail(f"cannot write {picture}: {error.strerror}")
    plots.close(drawing)


def _cycle(rows: Sequence[_Row]) -> float | None:
    """Return the time of a cycle in ns, or None if the clock is unknown."""
    for row in rows:
        if row["hardware_ns"]:
            cycles = _number(row["last_beat_out_cycle"]) - _number(row["first_beat_in_cycle"])
            return _number(row["hardware_ns"]) / cycles if cycles else None
    return None


def _draw(
    axis: Any, rows: Sequence[_Row], parts: Sequence[tuple[str, str, str]], title: str, tick: float | None
) -> None:
    """Draw the stages of all messages; `tick` is the time of the table's unit in ns, if it is known."""
    whole = [row for row in rows if all(row[name] is not None for _, *names in parts for name in names)]
    axis.set_ylabel("message")
    if not whole:
        axis.set_title(title)
        axis.text(0.5, 0.5, "unknown for this hardware", ha="center", va="center", transform=axis.transAxes)
        return
    begin, end = parts[0][1], parts[-1][2]
    totals = [_number(row[end]) - _number(row[begin]) for row in whole]
    unit, scale = _unit(max(totals), tick)
    axis.set_title(f"{title}\nwhole way: {_percentiles(totals, scale)} {unit}")
    axis.set_xlabel(unit)
    height = 0.9 / len(parts)
    for lane, (label, first, last) in enumerate(parts):
        spans = [_number(row[last]) - _number(row[first]) for row in whole]
        axis.barh(
            [_number(row["message"]) + (lane + 0.5) * height - 0.45 for row in whole],
            [max(0.0, span) * scale for span in spans],
            left=[(_number(row[first]) - _number(row[begin])) * scale for row in whole],
            height=height,
            color=f"C{lane}",
            # Bars of many messages are thinner than a pixel.
            edgecolor=f"C{lane}",
            linewidth=0.6,
            label=f"{label}: {_percentiles(spans, scale)} {unit}",
        )
    axis.invert_yaxis()
    axis.yaxis.get_major_locator().set_params(integer=True)
    axis.legend(fontsize="small", loc="upper left", bbox_to_anchor=(0, -0.14), frameon=False)


def _unit(longest: float, tick: float | None) -> tuple[str, float]:
    """Return the unit in which the longest time is at least 1, and the factor to it."""
    if tick is None:
        return "cycles", 1.0
    unit = next((name for name, size in _NANOSECONDS.items() if longest * tick >= size), "ns")
    return unit, tick / _NANOSECONDS[unit]


def _percentiles(times: Sequence[float], scale: float) -> str:
    """Return the median and high percentiles by nearest rank, which are measured times."""
    found = sorted(times)
    return ", ".join(f"p{p} {found[ceil(p * len(found) / 100) - 1] * scale:.3g}" for p in _PERCENTILES)


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
