"""The open folder of the page: its specifications, and the command line's functions for them."""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ParamSpec, TypeVar

from aiohttp import web

from fusesoc_firm.studio.document import Document
from fusesoc_firm.studio.page_run import Build
from fusesoc_firm.studio.scene import content_of
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import Diagnostic
from fusesoc_firm.text.files import is_file, read_regular
from fusesoc_firm.text.yaml_text import SMALL

# The endings of specifications' names, and folders without specifications.
_SUFFIXES = (".yaml", ".yml")
_NO_SOURCES = ("build", "node_modules")
# The keys by which a specification is recognised, and the maximum number of characters with a different layout.
_KEYS = ("project", "blocks")
_KEY_LINE = re.compile(r"""^["']?(project|blocks)["']?[ \t]*:(?:\s|$)""", re.MULTILINE)
_MOST_PARSED = 2**14
# The largest number of messages in an answer to a search.
MOST_NAMES = 50

Load = Callable[[Path, str], LoadedSystem]
"""Derives the system of a text in the place of a specification. May raise `InputError`."""
Check = Callable[[LoadedSystem, Path], Sequence[Diagnostic]]
"""Compares a system's accelerators with their sources and returns the warnings. May raise `InputError`."""
Names = Callable[[Path, Sequence[str]], Sequence[str]]
"""Returns the names of all messages for a specification with these `paths`. May raise `InputError`."""

_P = ParamSpec("_P")
_T = TypeVar("_T")


@dataclass(frozen=True)
class Tools:
    """The command line's functions for a specification; `paths` and `distro` are the sources of messages."""

    load: Load
    check: Check
    names: Names
    build: Build
    paths: Sequence[Path] = ()
    distro: str | None = None


class Workspace:
    """A folder of specifications, or one specification, and the `tools` for it."""

    def __init__(self, place: Path, tools: Tools) -> None:
        """Open a file or a folder."""
        self.tools = tools
        self._place = place.resolve()
        self.folder = self._place if self._place.is_dir() else self._place.parent
        self._documents: dict[str, Document] = {}
        # Derivations share caches, so one runs at a time.
        self._turn = asyncio.Lock()

    @property
    def is_single(self) -> bool:
        """Whether only one specification is open."""
        return not self._place.is_dir()

    @property
    def documents(self) -> list[Document]:
        """The open documents."""
        return [*self._documents.values()]

    async def in_turn(self, function: Callable[_P, _T], *arguments: _P.args, **options: _P.kwargs) -> _T:
        """Call a function that derives systems, in a thread."""
        async with self._turn:
            return await asyncio.to_thread(function, *arguments, **options)

    def loaded(self, document: Document) -> LoadedSystem:
        """Derive the system of a document. May raise `InputError`."""
        return self.tools.load(document.path, document.text)

    def specifications(self) -> Iterator[str]:
        """Yield the names of all specifications, relative to the folder."""
        if self.is_single:
            yield self.name(self._place)
            return
        for place, folders, names in os.walk(self.folder):
            folders[:] = sorted(name for name in folders if name not in _NO_SOURCES and not name.startswith("."))
            for path in (Path(place, name) for name in sorted(names)):
                if path.suffix in _SUFFIXES and self._is_inside(path) and _is_specification(path):
                    yield self.name(path)

    def document(self, name: object) -> Document:
        """Return the open document with a name; raise 404 for files outside the folder and for other files."""
        path = self.folder / str(name)
        if (
            not name
            or "\0" in str(name)
            or path.suffix not in _SUFFIXES
            or not self._is_inside(path)
            or not is_file(path)
        ):
            raise web.HTTPNotFound(reason="there is no such specification")
        if self.is_single and path.resolve() != self._place:
            raise web.HTTPNotFound(reason="only one specification is open")
        path = path.resolve()
        return self._documents.setdefault(str(path), Document(path))

    def _is_inside(self, path: Path) -> bool:
        return path.resolve().is_relative_to(self.folder)

    def name(self, path: Path) -> str:
        """Return the name of a specification, relative to the folder."""
        return path.relative_to(self.folder).as_posix()


def with_words(names: Iterable[str], query: str) -> list[str]:
    """Return the names that contain all words of a query."""
    words = query.lower().split()
    return [name for name in names if all(word in name.lower() for word in words)]


def _is_specification(path: Path) -> bool:
    """Return whether a file has a specification's keys; it need not be valid."""
    try:
        text = read_regular(path, SMALL.bytes).decode(errors="replace")
    except OSError:
        return False
    if not all(key in text for key in _KEYS):
        return False
    # Most files have a key on each line, so that no parser is needed, which may take seconds.
    return set(_KEYS) <= {*_KEY_LINE.findall(text)} or set(_KEYS) <= (content_of(text[:_MOST_PARSED]) or {}).keys()
