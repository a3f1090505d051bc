"""Instances of generated VHDL, with their generic and port maps, as plain data."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

Pairs = Iterable[tuple[str, str]]
"""Formals with their actuals."""


def port_map(pairs: Pairs) -> list[dict[str, Any]]:
    """Return the formal and the actual of each port."""
    return [{"formal": formal, "actual": actual} for formal, actual in pairs]


def instance(label: str, unit: str, ports: Pairs, generics: Iterable[tuple[str, object]] = ()) -> dict[str, Any]:
    """Return an instance of a unit, such as `entity work.arm`."""
    generic_map = port_map((formal, str(actual)) for formal, actual in generics)
    return {"label": label, "unit": unit, "generics": generic_map, "ports": port_map(ports)}
