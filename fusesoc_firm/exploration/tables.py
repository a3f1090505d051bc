"""Tables of text for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

WIDTH = 100
"""The columns of a report."""


def aligned(rows: Sequence[Sequence[str]], left: int) -> Iterator[str]:
    """Yield the lines of a table, whose first `left` columns are aligned to the left, and the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = [
            f"{text:<{width}}" if number < left else f"{text:>{width}}"
            for number, (text, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield "  ".join(cells).rstrip()


def cut(text: str, width: int) -> str:
    """Return a text of at most `width` columns."""
    return text if len(text) <= width else f"{text[: width - 3]}..."
