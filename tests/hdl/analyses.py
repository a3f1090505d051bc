"""What GHDL has to analyse before it can simulate a unit, and does only where the result is not recalled.

A library's files are known by their bytes. Of all files that a test analyses in a directory, those decide what a unit
does that declare it or a name that stands, as a word, in another one of them, in the same library or in one whose name
stands there, too: never fewer than GHDL reads.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from itertools import chain
from pathlib import Path

from tests.recall import digest_of_source

_REPOSITORY = Path(__file__).resolve().parents[2]
_WORD = re.compile(r"\\(?:[^\\]|\\\\)+\\|\w+")
_UNIT = re.compile(
    r"^\s*(?:(?:entity|package|context|configuration)\s+(?:body\s+)?|architecture\s+\w+\s+of\s+)(\w+|\\[^\\]+\\)",
    re.IGNORECASE | re.MULTILINE,
)


@dataclass(frozen=True)
class Source:
    """A file with the options with which it is analysed."""

    path: Path
    library: str
    options: tuple[str, ...]
    digest: str
    units: frozenset[str] = field(repr=False)
    words: frozenset[str] = field(repr=False)
    text: bytes = field(repr=False)


@dataclass
class _Analysis:
    sources: list[Source]
    is_done: bool = False


class Analyses:
    """What was analysed in a directory, in order; `run` analyses the files of a command."""

    def __init__(self) -> None:
        self._all: list[_Analysis] = []

    def sources(self, library: str, names: Iterable[str]) -> list[Source]:
        """The files that decide what the units with these names in a library are."""
        every = [source for analysis in self._all for source in analysis.sources]
        # GHDL looks for a library that is named, even if nothing of it is used.
        first = {source.library: number for number, source in reversed([*enumerate(every)])}
        found: dict[int, Source] = {}
        left: list[tuple[str, frozenset[str]]] = [(library, frozenset(map(str.lower, names)))]
        while left:
            own, words = left.pop()
            for number, source in enumerate(every):
                is_near = source.library == own or source.library in words
                is_named = not words.isdisjoint(source.units) or first[source.library] == number
                if is_near and is_named and number not in found:
                    found[number] = source
                    left.append((source.library, source.words))
        return [found[number] for number in sorted(found)]

    def add(self, library: str, files: Sequence[Path], options: Sequence[str]) -> list[Source]:
        """Note files that follow; return them with all on which they depend."""
        added = [_source(path, library, tuple(options)) for path in files]
        self._all.append(_Analysis(added))
        return self.sources(library, (unit for source in added for unit in source.units))

    def make(self, sources: Sequence[Source], run: Callable[[Sequence[Source]], None]) -> None:
        """Analyse what these files need and was not analysed."""
        for analysis in self._needed(sources):
            if not analysis.is_done:
                run(analysis.sources)
                analysis.is_done = True

    def _needed(self, sources: Sequence[Source]) -> list[_Analysis]:
        """The commands that analyse these files. What other files of a command need is needed, too."""
        wanted, found = set(map(id, sources)), list[_Analysis]()
        while True:
            before, found = found, [item for item in self._all if any(id(source) in wanted for source in item.sources)]
            if len(found) == len(before):
                return found
            units: dict[str, set[str]] = {}
            for source in chain.from_iterable(item.sources for item in found):
                units.setdefault(source.library, set()).update(source.units)
            for library, names in units.items():
                wanted |= set(map(id, self.sources(library, names)))

    def make_all(self, run: Callable[[Sequence[Source]], None]) -> None:
        """Analyse all that was not."""
        self.make([source for analysis in self._all for source in analysis.sources], run)

    def take(self, others: Analyses) -> None:
        """Note what was analysed elsewhere, and copied."""
        self._all += [_Analysis(list(analysis.sources), True) for analysis in others._all]

    def forget(self) -> None:
        """Forget the last files, which GHDL refuses."""
        self._all.pop()


@contextmanager
def as_they_were(sources: Sequence[Source]) -> Iterator[None]:
    """Within it, files that a test has changed since their analysis contain what they contained then."""
    changed = {source.path: source.path.read_bytes() for source in sources if source.path.read_bytes() != source.text}
    for source in sources:
        if source.path in changed:
            assert not source.path.is_relative_to(_REPOSITORY), f"{source.path} was changed while tests ran"
            source.path.write_bytes(source.text)
    try:
        yield
    finally:
        for path, text in changed.items():
            path.write_bytes(text)


@cache
def analyses_in(directory: Path) -> Analyses:
    """The analyses in this directory, of this process."""
    assert directory.is_dir()
    return Analyses()


def _source(path: Path, library: str, options: tuple[str, ...]) -> Source:
    text = path.read_bytes()
    units, words = _names(text.decode("latin-1"))
    return Source(path, library.lower(), options, digest_of_source(path), units, words, text)


@cache
def _names(text: str) -> tuple[frozenset[str], frozenset[str]]:
    """The units of a file, and all words in it."""
    return frozenset(map(str.lower, _UNIT.findall(text))), frozenset(map(str.lower, _WORD.findall(text)))
