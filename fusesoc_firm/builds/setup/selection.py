"""The selection of cores and targets by patterns.

A pattern of a core is a name in FuseSoC: `vendor:library:name`, with a version or without, or the name alone. Each part
may contain the wildcards `*`, `?` and `[...]` of file names. Targets of one core follow its name, as in
`acme:m:one@sim,lint`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase

_WILDCARDS = frozenset("*?[")
_ALL_PARTS = 4


@dataclass(frozen=True)
class Selection:
    """The builds that a user selects.

    `targets` apply to all cores without separate targets. With `is_where_present`, a core without a target is skipped.
    Only cores in `affected` may be selected; None permits all.
    """

    cores: tuple[str, ...]
    targets: tuple[str, ...] = ()
    is_where_present: bool = False
    affected: frozenset[str] | None = None

    def parts(self) -> list[tuple[str, tuple[str, ...]]]:
        """Return each pattern of cores with its patterns of targets."""
        found = [core.partition("@") for core in self.cores]
        return [(core, tuple(own.split(",")) if mark else self.targets) for core, mark, own in found]

    def words(self) -> tuple[object, ...]:
        """Return the selection as plain data."""
        affected = None if self.affected is None else sorted(self.affected)
        return (self.cores, self.targets, self.is_where_present, affected)


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
