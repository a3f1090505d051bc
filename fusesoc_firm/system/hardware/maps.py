"""Generic and port maps of generated VHDL as plain data."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


def port_map(pairs: Iterable[tuple[str, str]]) -> list[dict[str, Any]]:
    """Formal and actual of each port, in columns; every line but the last ends with a comma."""
    lines = list(pairs)
    column = max(len(formal) for formal, _ in lines)
    return [
        {"formal": formal.ljust(column), "actual": actual, "comma": "," if number < len(lines) - 1 else ""}
        for number, (formal, actual) in enumerate(lines)
    ]
