"""The selection of cores and targets by patterns.

A pattern of a core is a name in FuseSoC: `vendor:library:name`, with a version or without, or the name alone. Each part
may contain the wildcards `*`, `?` and `[...]` of file names.
"""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase

_WILDCARDS = frozenset("*?[")
_ALL_PARTS = 4


def is_pattern(text: str) -> bool:
    """Return whether a name contains wildcards."""
    return not _WILDCARDS.isdisjoint(text)


def matching(names: Iterable[str], pattern: str) -> list[str]:
    """Return the full names of cores that match a pattern, in the order of `names`."""
    parts = pattern.split(":")
    if len(parts) == 1:
        parts = ["*", "*", *parts]
    parts += ["*"] * (_ALL_PARTS - len(parts))
    return [name for name in names if _match(name.split(":"), parts)]


def _match(name: list[str], parts: list[str]) -> bool:
    return len(name) == len(parts) and all(map(fnmatchcase, name, parts))
