"""Tables of texts in Markdown."""

from __future__ import annotations

import math
from collections.abc import Sequence

UNKNOWN = "-"


def decimal(value: float | None) -> str:
    """Return a value with two decimal places."""
    return UNKNOWN if value is None or math.isnan(value) else f"{value:.2f}"


def grid(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; the first column is left-aligned, numbers are right-aligned."""
    lines = [columns, *rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(columns))]
    rule = "|".join(["", "-" * (widths[0] + 2), *("-" * (width + 1) + ":" for width in widths[1:]), ""])
    heading, *body = (
        " | ".join([line[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))])
        for line in lines
    )
    return "\n".join([f"| {heading} |", rule, *(f"| {line} |" for line in body)]) + "\n"
