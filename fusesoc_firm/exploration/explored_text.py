"""An exploration as text of at most 100 columns, and as a picture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fusesoc_firm.exploration.accuracy import Accuracy, Largest
from fusesoc_firm.exploration.placement import Placed
from fusesoc_firm.exploration.points import Point
from fusesoc_firm.exploration.tables import WIDTH, aligned, cut
from fusesoc_firm.text.render import render

TEMPLATE = "svg/exploration.svg"
# With more points, the table has only those of the front and that of the specification.
_MOST_ROWS = 40
_SHORT_NAMES = {
    "multiply": "mul",
    "square_root": "sqrt",
    "divide": "div",
    "to_float": "from int",
    "to_integer": "to int",
}
# The size of the picture, and its margins, in pixels.
_WIDTH, _HEIGHT, _LEFT, _TOP = 640, 400, 70, 40

Measured = Mapping[int, Placed]
"""The placed points, by their place in the list of points."""


def table(points: Sequence[Point], measured: Measured, *, is_whole: bool) -> Iterator[str]:
    """Yield the lines of the table; without `is_whole`, a long one has only the front."""
    shown = [*range(len(points))]
    if not is_whole and len(points) > _MOST_ROWS:
        shown = [number for number in shown if points[number].is_front or points[number].is_current]
    kinds = [*dict.fromkeys(kind for item in points for kind in item.operators)]
    has_elements = any(item.elements for item in points)
    rows = [_head(kinds, has_elements)] + [_row(points[number], kinds, has_elements) for number in shown]
    if measured:
        empty = ("", "", "")
        rows[0] = (*rows[0], "LUT4", "FF", "MHz")
        rows[1:] = [
            (*row, *(_measured(measured[number]) if number in measured else empty))
            for row, number in zip(rows[1:], shown, strict=True)
        ]
    lines = [*aligned(rows, left=2)]
    if measured:
        lines.insert(0, f"{'measured':>{max(map(len, lines))}}")
    yield from lines
    if len(shown) < len(points):
        yield f"{len(points) - len(shown)} other points are not on the front; --all shows them"


def _head(kinds: Sequence[str], has_elements: bool) -> tuple[str, ...]:
    names = [_SHORT_NAMES.get(kind, kind) for kind in kinds]
    return (
        *("", "numbers", *names, "latency", "interval"),
        *(["element"] if has_elements else []),
        *("ns", "LUT4", "FF", "DSP", "MHz"),
    )


def _row(point: Point, kinds: Sequence[str], has_elements: bool) -> tuple[str, ...]:
    size = point.estimate
    marks = ("*" if point.is_front else " ") + ("=" if point.is_current else "")
    cycles = [point.schedule.latency, point.schedule.interval, *([point.elements] if has_elements else [])]
    counts = [str(point.operators.get(kind, "-")) for kind in kinds]
    sizes = [f"{point.nanoseconds:.0f}", size.lut, size.ff, size.dsp, f"{size.megahertz:.0f}"]
    return marks, point.numbers, *counts, *map(str, cycles), *map(str, sizes)


def _measured(placed: Placed) -> tuple[str, ...]:
    return str(placed.lut), str(placed.ff), "-" if placed.megahertz is None else f"{placed.megahertz:.0f}"


def errors_text(errors: Mapping[str, Accuracy], source: str) -> Iterator[str]:
    """Yield the lines about the errors of numbers, with messages of `source`."""
    for numbers, found in errors.items():
        yield cut(f"{numbers} against float64, {found.calls} messages of {source}:", WIDTH)
        for word, largest in (("absolute", found.absolute), ("relative", found.relative)):
            yield f"  largest {word} error {_error(largest)}"
        if found.missing:
            yield f"  {found.missing} answers are sent with only one of the two"


def _error(largest: Largest) -> str:
    if not largest.field:
        return "0"
    error = "infinite" if math.isinf(largest.error) else f"{largest.error:.3g}"
    return f"{error} in '{cut(largest.field, 50)}', message {largest.call}"


def picture(name: str, points: Sequence[Point]) -> str:
    """Return the picture in SVG: LUT4 over latency, a colour for each type of numbers, and the front as lines."""
    cycles = [item.schedule.latency for item in points]
    least, most = min(cycles), max(cycles)
    most_luts = max([1, *(item.estimate.lut for item in points)])

    def place(item: Point) -> dict[str, int]:
        return {
            "x": _LEFT + round((_WIDTH - 2 * _LEFT) * (item.schedule.latency - least) / max(1, most - least)),
            "y": _HEIGHT - _TOP - round((_HEIGHT - 2 * _TOP) * item.estimate.lut / most_luts),
        }

    groups = []
    for number, numbers in enumerate(dict.fromkeys(item.numbers for item in points)):
        own = [item for item in points if item.numbers == numbers]
        front = [place(item) for item in own if item.is_front]
        groups.append(
            {
                "numbers": numbers,
                "y": _TOP + 18 * number + 4,
                "line": " ".join(f"{item['x']},{item['y']}" for item in front),
                "points": [{**place(item), "radius": 5 if item.is_front else 3, "title": _title(item)} for item in own],
            }
        )
    context: dict[str, Any] = {"name": name, "least": least, "most": most, "luts": most_luts, "groups": groups}
    size = {"width": _WIDTH, "height": _HEIGHT, "left": _LEFT, "right": _WIDTH - _LEFT, "top": _TOP}
    return render(TEMPLATE, {**context, **size, "bottom": _HEIGHT - _TOP})


def _title(point: Point) -> str:
    counts = ", ".join(f"{count} {kind}" for kind, count in point.operators.items()) or "no operators"
    size = point.estimate
    return f"{point.numbers}: {counts}; {point.schedule.latency} cycles, {size.lut} LUT4, {size.megahertz:.0f} MHz"
