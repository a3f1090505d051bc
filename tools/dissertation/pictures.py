"""Draw figures with matplotlib, an extra dependency: `pip install 'fusesoc-firm[plots]'`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module
from importlib.util import find_spec
from math import isnan
from pathlib import Path
from typing import Any

from tools.dissertation.tables import Figure, Panel
from tools.dissertation.timeline import Timeline

SUFFIXES = ("png", "svg")

_PANEL_INCHES = (6.0, 4.0)
_TIMELINE_INCHES = (9.0, 3.0)
# An axis is logarithmic if the values differ by this factor.
_WIDE = 20
# The ratio between the largest value and the smallest that has its own place beside zero.
_MOST_SHOWN = 1000
_MARKERS = "osv^DPX"
# Without the date and the random names that matplotlib writes, equal values result in equal bytes.
_SETTINGS = {"svg.hashsalt": "firm", "font.size": 9}
_METADATA = {"png": {"Software": None}, "svg": {"Date": None}}


def are_possible() -> bool:
    """Return whether matplotlib is installed."""
    return find_spec("matplotlib") is not None


def draw_figure(figure: Figure, folder: Path) -> None:
    """Draw a figure with solid lines for our values and dashed lines for the dissertation's values."""
    plots = _plots()
    columns = min(2, len(figure.panels))
    rows = -(-len(figure.panels) // columns)
    size = (_PANEL_INCHES[0] * columns, _PANEL_INCHES[1] * rows)
    drawing, axes = plots.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
    drawing.suptitle(f"Figure {figure.number}: {figure.title}")
    draw_panel = _draw_lines if len(figure.requesters) > 1 else _draw_bars
    for panel, axis in zip(figure.panels, axes.flat, strict=False):
        draw_panel(axis, figure, panel)
    if names := {name: line for axis in axes.flat for line, name in zip(*_legend(axis), strict=True)}:
        drawing.legend(names.values(), names.keys(), loc="outside right upper")
    for axis in axes.flat[len(figure.panels) :]:
        axis.set_visible(False)
    _save(drawing, folder / figure.file_name)


def draw_timeline(timeline: Timeline, folder: Path) -> None:
    """Draw requests as thin bars, overlaid by the grant as thick bars."""
    plots = _plots()
    drawing, axis = plots.subplots(figsize=_TIMELINE_INCHES, layout="constrained")
    axis.set_title(f"Figure {timeline.number}: {timeline.title}")
    for index, bits in enumerate(timeline.requests):
        served = [bit and timeline.granted[cycle] == index for cycle, bit in enumerate(bits)]
        for cycles, height, colour in ((bits, 0.3, "C7"), (served, 0.7, f"C{index}")):
            spans = [(cycle, 1) for cycle, is_high in enumerate(cycles) if is_high]
            axis.broken_barh(spans, (index - height / 2, height), color=colour, linewidth=0)
    axis.set_yticks(range(len(timeline.requests)), [f"Acc{index}" for index in range(len(timeline.requests))])
    axis.invert_yaxis()
    axis.set_xlabel("clock cycle; thin: request, thick: granted")
    _save(drawing, folder / timeline.file_name)


def _plots() -> Any:
    matplotlib: Any = import_module("matplotlib")
    matplotlib.use("Agg")
    matplotlib.rcParams.update(_SETTINGS)
    return import_module("matplotlib.pyplot")


def _draw_bars(axis: Any, figure: Figure, panel: Panel) -> None:
    """Draw a bar for each scheduler, for a figure with a single number of accelerators."""
    heights = [values[0] for values in panel.series.values()]
    axis.barh(list(panel.series), heights)
    axis.invert_yaxis()
    axis.set_title(f"{panel.title}, {figure.requesters[0]} accelerators")
    axis.set_xlabel(figure.unit)
    axis.grid(visible=True, axis="x", alpha=0.3)


def _draw_lines(axis: Any, figure: Figure, panel: Panel) -> None:
    places = range(len(figure.requesters))
    # Margins are relative to the scale at the time of a plot.
    axis.set_yscale(**_scale([*panel.series.values(), *panel.dissertation.values()]))
    for index, (name, values) in enumerate(panel.series.items()):
        style = {"color": f"C{index}", "marker": _MARKERS[index % len(_MARKERS)], "markersize": 4}
        axis.plot(places, values, label=name, **style)
        if name in panel.dissertation:
            axis.plot(places, panel.dissertation[name], linestyle="--", alpha=0.5, **style)
    axis.set_title(f"{panel.title}; dashed: dissertation" if panel.dissertation else panel.title)
    axis.set_xticks(places, [str(number) for number in figure.requesters])
    axis.set_xlabel("accelerators")
    axis.set_ylabel(figure.unit)
    axis.grid(visible=True, alpha=0.3)


def _legend(axis: Any) -> tuple[list[Any], list[str]]:
    """Return the lines of an axis, and their names."""
    lines, names = axis.get_legend_handles_labels()
    return lines, names


def _scale(series: Iterable[Sequence[float]]) -> dict[str, Any]:
    """Return a logarithmic scale if small values would look like zero beside the largest one, else a linear one.

    Zero and negative values need a scale that is linear around zero, up to the smallest other value.
    """
    values = [value for row in series for value in row if not isnan(value)]
    sizes = [abs(value) for value in values if value]
    if not sizes or min(sizes) * _WIDE >= max(sizes):
        return {"value": "linear"}
    if min(values) > 0:
        return {"value": "log"}
    # Sizes far below the largest one are not worth their space.
    return {"value": "symlog", "linthresh": max(min(sizes), max(sizes) / _MOST_SHOWN)}


def _save(drawing: Any, path: Path) -> None:
    for suffix in SUFFIXES:
        drawing.savefig(path.with_suffix(f".{suffix}"), metadata=_METADATA[suffix])
    _plots().close(drawing)
