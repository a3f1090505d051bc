"""Generic and port maps of generated VHDL as plain data."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


def port_map(pairs: Iterable[tuple[str, str]]) -> list[dict[str, Any]]:
    """Return the formal and the actual of each port."""
    return [{"formal": formal, "actual": actual} for formal, actual in pairs]
