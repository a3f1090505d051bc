"""Report the results of a campaign as JSON for programs and as HTML for people, without paths of the machine."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm import __version__
from fusesoc_firm.message.middleware import Middleware, middlewares
from fusesoc_firm.runs.verify.campaign import Entry, Settings
from fusesoc_firm.runs.verify.complexity import Level, Statistics
from fusesoc_firm.runs.verify.judge import versions
from fusesoc_firm.runs.verify.simulation import STALL_PERCENT, ghdl_version
from fusesoc_firm.runs.verify.task import Verdict
from fusesoc_firm.text.json_text import json_text
from fusesoc_firm.text.outputs import write
from fusesoc_firm.text.render import render

_TEMPLATE = "verify/report.html"
_LEVELS = {
    Level.SIMPLE: "1 Simple",
    Level.EXPANDING: "2 Expanding",
    Level.ARRAYS: "3 Arrays",
    Level.VARIABLE_SUBMESSAGES: "4 VariableSubmessages",
}
# The sizes, in pixels, of a figure and of the labels below and to the left of the bars.
_WIDTH, _HEIGHT, _MARGIN, _LABELS = 560, 200, 40, 34


@dataclass(frozen=True)
class Report:
    """All entries of a campaign, its settings, and its duration."""

    entries: tuple[Entry, ...]
    settings: Settings
    seconds: float
    tools: Mapping[str, str]

    @property
    def totals(self) -> dict[str, int]:
        """The number of messages with each verdict."""
        found = Counter(entry.result.verdict for entry in self.entries)
        return {str(verdict): found[verdict] for verdict in Verdict}

    @property
    def failures(self) -> list[Entry]:
        """The entries of failed messages; messages that were themselves simulated are first."""
        failed = [entry for entry in self.entries if entry.result.verdict is Verdict.FAIL]
        return sorted(failed, key=lambda entry: entry.same_as is not None)


def make_report(entries: Iterable[Entry], settings: Settings, seconds: float) -> Report:
    """Return a report with the entries sorted by name, and the versions of the references."""
    ordered = tuple(sorted(entries, key=lambda entry: (entry.ros.number, entry.name)))
    tools = {"fusesoc-firm": __version__, "GHDL": ghdl_version(), "Python": platform.python_version(), **versions()}
    return Report(ordered, settings, round(seconds, 1), tools)


def write_report(report: Report, path: Path) -> Path:
    """Write the report to `path`, and an HTML version next to it; return the path of the HTML file."""
    write(path, json_text(as_data(report), 1) + "\n")
    beside = path.with_suffix(".html")
    write(beside, as_html(report))
    return beside


def as_data(report: Report) -> dict[str, Any]:
    """Return the report as plain data."""
    settings = report.settings
    return {
        "tools": dict(report.tools),
        "width": settings.width,
        "stimuli": settings.stimuli,
        "stall_percent": STALL_PERCENT,
        "seed": settings.seed,
        "seconds": report.seconds,
        "totals": {"messages": len(report.entries), **report.totals},
        "messages": [_entry(entry) for entry in report.entries],
    }


def _entry(entry: Entry) -> dict[str, Any]:
    result = entry.result
    found: dict[str, Any] = {"name": str(entry.name), "ros": entry.ros.number, "signature": entry.signature}
    if entry.statistics:
        found |= {name: int(value) for name, value in vars(entry.statistics).items()}
    if entry.same_as:
        found["same_as"] = str(entry.same_as)
    return found | {
        "verdict": str(result.verdict),
        "detail": result.detail,
        "judge": result.judge,
        "bytes": list(result.payload_bytes),
        "cycles": result.cycles,
        "seconds": result.seconds,
    }


# --- HTML --------------------------------------------------------------------------------------------------------


def as_html(report: Report) -> str:
    """Return the report as a self-contained HTML page."""
    settings = report.settings
    versions_of_ros = [ros for ros in middlewares() if any(entry.ros is ros for entry in report.entries)]
    return render(
        _TEMPLATE,
        {
            "width": settings.width,
            "stimuli": settings.stimuli,
            "stall_percent": STALL_PERCENT,
            "seed": settings.seed,
            "seconds": f"{report.seconds:g}",
            "tools": ", ".join(f"{name} {version}" for name, version in report.tools.items()),
            "verdicts": [{"verdict": str(verdict)} for verdict in Verdict],
            "totals": [_total(row, entries) for row, entries in _groups(report.entries, versions_of_ros)],
            "figures": [figure for ros in versions_of_ros for figure in _figures(report.entries, ros)],
            "tables": [
                _table(f"Messages with the verdict '{verdict}'", verdict, report.entries)
                for verdict in (Verdict.FAIL, Verdict.NO_JUDGE, Verdict.REFUSED)
                if report.totals[verdict]
            ],
        },
    )


def _groups(entries: Sequence[Entry], versions_of_ros: Sequence[Middleware]) -> list[tuple[str, list[Entry]]]:
    """Return the rows of the totals table: all messages and each level, for each ROS version."""
    rows = []
    for ros in versions_of_ros:
        mine = [entry for entry in entries if entry.ros is ros]
        rows.append((f"{ros.title}", mine))
        for level, words in _LEVELS.items():
            of_level = [entry for entry in mine if entry.statistics and entry.statistics.level is level]
            rows.append((f"{ros.title}, level {words}", of_level))
    return rows


def _total(row: str, entries: Sequence[Entry]) -> dict[str, Any]:
    found = Counter(entry.result.verdict for entry in entries)
    return {"row": row, "messages": len(entries), "counts": [{"count": found[verdict]} for verdict in Verdict]}


def _table(title: str, verdict: Verdict, entries: Sequence[Entry]) -> dict[str, Any]:
    rows = []
    for entry in entries:
        if entry.result.verdict is verdict:
            same = f" (as {entry.same_as})" if entry.same_as else ""
            rows.append(
                {
                    "name": f"{entry.name}{same}",
                    "ros": entry.ros.number,
                    "level": int(entry.statistics.level) if entry.statistics else "",
                    "detail": entry.result.detail,
                }
            )
    return {"title": title, "rows": rows}


@dataclass(frozen=True)
class Histogram:
    """`counts[k]` values are in [`first + k * step`, `first + (k + 1) * step`); `beyond` values are above the range."""

    first: int
    step: int
    counts: tuple[int, ...]
    beyond: int


def histogram(values: Sequence[int], first: int, step: int, most: int) -> Histogram:
    """Return the histogram of values from `first` to at most `most`, with no more steps than the values need."""
    inside = [value for value in values if value <= most]
    counts = Counter((value - first) // step for value in inside)
    return Histogram(
        first, step, tuple(counts[k] for k in range(max(counts, default=0) + 1)), len(values) - len(inside)
    )


def _figures(entries: Sequence[Entry], ros: Middleware) -> list[dict[str, Any]]:
    """Return figures 5.8 to 5.10 of the dissertation for one ROS version."""
    known = [entry.statistics for entry in entries if entry.ros is ros and entry.statistics]
    figures = (
        ("Fields, all messages within unfolded", histogram([each.fields for each in known], 0, 10, 249)),
        ("Distinct types of the fields", histogram([each.types for each in known], 0, 1, 60)),
        ("Depth of nesting; 1 is a message without another one", histogram([each.depth for each in known], 1, 1, 30)),
    )
    return [_figure(f"{ros.title}: {title}", found, known) for title, found in figures]


def _figure(title: str, found: Histogram, known: Sequence[Statistics]) -> dict[str, Any]:
    tallest = max([1, *found.counts])
    pitch = max(4, (_WIDTH - _MARGIN) // len(found.counts))
    every = max(1, -(-_LABELS // pitch))
    bars = []
    for number, count in enumerate(found.counts):
        low = found.first + number * found.step
        height = round(_HEIGHT * count / tallest)
        bars.append(
            {
                "x": _MARGIN + number * pitch,
                "y": _HEIGHT - height,
                "width": pitch - 1,
                "height": height,
                "label_y": _HEIGHT + 14,
                "middle": _MARGIN + number * pitch + pitch // 2,
                "label": str(low) if number % every == 0 else "",
                "title": f"{_range(low, found.step)}: {count}",
            }
        )
    beyond = f"; {found.beyond} beyond the figure" if found.beyond else ""
    return {
        "title": title,
        "caption": f"{len(known)} messages{beyond}",
        "view_width": _MARGIN + len(found.counts) * pitch,
        "view_height": _HEIGHT + 20,
        "base": _HEIGHT,
        "axis": _MARGIN,
        "tallest": tallest,
        "bars": bars,
    }


def _range(low: int, step: int) -> str:
    return str(low) if step == 1 else f"{low} to {low + step - 1}"
