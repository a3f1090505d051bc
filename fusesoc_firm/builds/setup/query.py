"""Questions about the cores in FuseSoC's libraries: dependencies, dependents, paths, targets and their kinds.

An answer is a table, with edges for a picture. Dependencies include those of all targets and flags.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from fusesoc_firm.builds.setup.cores import GRAPH_TEMPLATE, ProjectCore, short
from fusesoc_firm.builds.setup.flows import target_flow
from fusesoc_firm.builds.setup.libraries import ALL_CORES, newest, open_libraries
from fusesoc_firm.builds.setup.selection import matching
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.json_text import json_text
from fusesoc_firm.text.render import render

Edge = tuple[str, str]


@dataclass(frozen=True)
class Answer:
    """The answer to a question: the columns' names, rows of texts, and the edges between names."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    edges: tuple[Edge, ...] = ()

    def lines(self) -> str:
        """Return a line for each row, with blanks between the columns."""
        widths = [max((len(row[place]) for row in self.rows), default=0) for place in range(len(self.columns))]
        return "\n".join(
            "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in self.rows
        )

    def json(self) -> str:
        """Return the rows as objects, and the edges, as JSON."""
        rows = [dict(zip(self.columns, row, strict=True)) for row in self.rows]
        return json_text({"rows": rows, "edges": self.edges}, 2)

    def dot(self) -> str:
        """Return the first column and the edges in Graphviz's language."""
        names = dict.fromkeys([row[0] for row in self.rows] + [name for edge in self.edges for name in edge])
        edges = [{"from": start, "to": end} for start, end in self.edges]
        data = {"cores": [{"name": name} for name in names], "generated": [], "sources": [], "edges": edges}
        return render(GRAPH_TEMPLATE, data).rstrip("\n")


@dataclass(frozen=True)
class Cores:
    """All cores by their full names, with the cores on which each depends directly.

    A dependency that no core satisfies is in `missing`, as written. Cores that need one, directly or not, are in
    `lacking`.
    """

    needs: Mapping[str, tuple[str, ...]]
    missing: frozenset[str] = frozenset()
    lacking: frozenset[str] = frozenset()

    def deps(self, patterns: Sequence[str]) -> Answer:
        """Return the selected cores and all cores on which they depend. May raise `InputError`."""
        return self.among(_reached(self.named(patterns), self.needs))

    def rdeps(self, patterns: Sequence[str]) -> Answer:
        """Return the selected cores and all cores that depend on them. May raise `InputError`."""
        return self.among(_reached(self.named(patterns), self._needed_by()))

    def allpaths(self, start: str, end: str) -> Answer:
        """Return the cores on all paths of dependencies between two selections. May raise `InputError`."""
        below = _reached(self.named([start]), self.needs)
        return self.among(below & _reached(self.named([end]), self._needed_by()))

    def named(self, patterns: Iterable[str]) -> list[str]:
        """Return the cores that match the patterns. May raise `InputError`."""
        return [
            name
            for pattern in patterns
            for name in ([pattern] if pattern in self.missing else named(self.needs, pattern))
        ]

    def _needed_by(self) -> dict[str, tuple[str, ...]]:
        return {name: tuple(other for other, needs in self.needs.items() if name in needs) for name in self.needs}

    def among(self, names: Iterable[str]) -> Answer:
        """Return these cores, and the dependencies between them."""
        found = sorted(names)
        edges = ((name, other) for name in found for other in self.needs[name] if other in found)
        states = {**dict.fromkeys(self.lacking, "lacks a core"), **dict.fromkeys(self.missing, "missing")}
        rows = ((name, states.get(name, "")) for name in found)
        return Answer(("core", "state"), tuple(rows), tuple(edges))


def core_dependencies(cores: Sequence[ProjectCore]) -> Cores:
    """Return the dependencies between cores.

    As in FuseSoC, the newest version that satisfies a dependency counts. If this version lacks a core in turn, FuseSoC
    silently uses the next version unless another target has that dependency, so both count. All cores that provide a
    virtual name count, since the target's flags decide between them.
    """
    by_name: dict[str, list[str]] = {}
    for core in cores:
        for name in core.names:
            by_name.setdefault(name, []).append(core.vlnv)
    choices = {
        core.vlnv: {
            depend: _satisfying(depend, by_name.get(short(depend), ())) for depend in sorted(core.needs, key=short)
        }
        for core in cores
    }
    lacking = _lacking(choices)
    needs: dict[str, tuple[str, ...]] = {}
    for name, depends in choices.items():
        found = (other for depend, choice in depends.items() for other in choice.used(lacking) or [depend])
        needs[name] = tuple(dict.fromkeys(found))
    missing = dict.fromkeys(depend for depends in choices.values() for depend, choice in depends.items() if not choice)
    return Cores({**dict.fromkeys(missing, ()), **needs}, frozenset(missing), frozenset(lacking))


@dataclass(frozen=True)
class _Choice:
    """The cores that satisfy a dependency: the versions, newest first, and those for which it is a virtual name."""

    versions: tuple[str, ...]
    virtual: tuple[str, ...]

    def __bool__(self) -> bool:
        return bool(self.versions or self.virtual)

    def used(self, lacking: Collection[str]) -> list[str]:
        """Return the versions down to the first that lacks nothing, and all cores with the virtual name."""
        last = next((place for place, name in enumerate(self.versions) if name not in lacking), len(self.versions))
        return [*self.versions[: last + 1], *self.virtual]


def _lacking(choices: Mapping[str, Mapping[str, _Choice]]) -> set[str]:
    """Return the cores with a dependency, direct or not, that no core satisfies."""
    lacking: set[str] = set()
    while new := {
        name
        for name, depends in choices.items()
        if name not in lacking
        and any(lacking.issuperset((*choice.versions, *choice.virtual)) for choice in depends.values())
    }:
        lacking |= new
    return lacking


def _satisfying(depend: str, providers: Sequence[str]) -> _Choice:
    own = [name for name in providers if name.rpartition(":")[0] == short(depend)]
    virtual = tuple(name for name in providers if name not in own)
    versions: list[str] = []
    try:
        while chosen := newest(depend, (name for name in own if name not in versions)):
            versions.append(chosen)
    except SyntaxError:
        return _Choice((), ())
    return _Choice(tuple(versions), virtual)


def targets(patterns: Sequence[str], kind: str = "*") -> Answer:
    """Return the targets of the selected cores, each with its kind; `kind` is a pattern. May raise `InputError`.

    The kind is the flow or tool in Edalize, as in `sim/ghdl`, or `-` for a target without both.
    """
    found = [row for row in _targets(patterns) if fnmatchcase(row[2], kind) or fnmatchcase(row[2].split("/")[0], kind)]
    edges = ((core, f"{core} {target}") for core, target, _ in found)
    return Answer(("core", "target", "kind"), tuple(found), tuple(edges))


def kinds(patterns: Sequence[str]) -> Answer:
    """Return the kinds of the selected cores' targets, each with its number of targets. May raise `InputError`."""
    counts = Counter(kind for _, _, kind in _targets(patterns))
    return Answer(("kind", "targets"), tuple((kind, str(counts[kind])) for kind in sorted(counts)))


def named(names: Iterable[str], pattern: str) -> list[str]:
    """Return the names that match a pattern. Raise `InputError` without a match."""
    if not (found := matching(names, pattern)):
        fail(f"no core matches '{pattern}'", hint=ALL_CORES)
    return found


def _targets(patterns: Sequence[str]) -> list[tuple[str, str, str]]:
    cores = open_libraries().get_cores()
    chosen = dict.fromkeys(name for pattern in patterns for name in named(sorted(cores), pattern))
    return [
        (name, target, _kind(cores[name], target))
        for name in chosen
        for target in sorted(cores[name].get_data({}).targets)
    ]


def _kind(core: Any, target: str) -> str:
    if not (flow := target_flow(core, target)):
        return "-"
    return "/".join(dict.fromkeys(filter(None, (flow.name, flow.tool))))


def _reached(names: Iterable[str], edges: Mapping[str, Sequence[str]]) -> set[str]:
    found = set(names)
    waiting = list(found)
    while waiting:
        new = [name for name in edges[waiting.pop()] if name not in found]
        found.update(new)
        waiting += new
    return found
