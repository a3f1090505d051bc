"""The inputs of cores: all files and folders whose content may change the result of a build.

Commands have different views of this list: `firm affected` compares it with edited files, and `firm lock` records its
digests. A build compares what FuseSoC exported for its target: files of this list, and files that were generated from
it. So whatever lets a build run again is also affected and locked.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from fusesoc_firm.builds.setup.cores import ProjectCore
from fusesoc_firm.core.request import GeneratorCall
from fusesoc_firm.tools.reads import Input, Part

# Notes of the program that fetched a folder; they differ although the sources are the same.
_NOTES = (".git", ".svn")


def inputs_of_foreign_call(call: GeneratorCall) -> list[Path]:
    """Return the files and folders that a call of a generator of others may name.

    Such a generator may read any file, but its parameters are the way to tell it which. Each text in these may be a
    path relative to the core, even if the file does not exist at present.
    """
    root = Path(call.files_root).resolve()
    found: dict[Path, None] = {}
    for text in _texts(call.parameters):
        # A text may be too long for a path, or contain characters that paths cannot have.
        with suppress(OSError, ValueError):
            path = (root / text).resolve()
            if not path.is_dir() or (path != root and path.is_relative_to(root)):
                found[path] = None
    return [*found]


def _texts(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield from dict.fromkeys((value, *value.split()))
    elif isinstance(value, dict):
        yield from _texts([*value, *value.values()])
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(item)


def first_changed(changed: Collection[Path], items: Iterable[Input]) -> Path | None:
    """Return the first of the changed files that is an input, or in a folder that is an input."""
    places = {place for item in items for place in _places(_path(item))}
    return next((path for path in changed if not places.isdisjoint((path, *path.parents))), None)


def _places(path: Path) -> Iterator[Path]:
    """Yield a path and, for a folder, the places to which links in it lead."""
    yield path
    if path.is_dir():
        yield from (file.resolve() for file in _files_below(path) if not file.resolve().is_relative_to(path))


def digest_of_core(core: ProjectCore, items: Iterable[Input]) -> str:
    """Return the digest of the inputs of a core; their names are relative to the `.core` file or the fetched folder."""
    return _digest({_named(item, core): _digest_of(item) for item in items})


def _named(item: Input, core: ProjectCore) -> str:
    path = _path(item)
    if core.fetched and path.is_relative_to(core.fetched):
        name = f"fetched {path.relative_to(core.fetched)}"
    else:
        name = os.path.relpath(path, core.files[0].parent)
    return f"{name}:{item.name}" if isinstance(item, Part) else name


def _path(item: Input) -> Path:
    return (item if isinstance(item, Path) else item.path).resolve()


def _digest_of(item: Input) -> str | None:
    if isinstance(item, Part):
        return hashlib.sha256(item.content).hexdigest()
    if item.is_dir():
        return _digest({str(file.relative_to(item)): _digest_of(file) for file in _files_below(item)})
    return hashlib.sha256(item.read_bytes()).hexdigest() if item.is_file() else None


def _digest(found: object) -> str:
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()


def _files_below(folder: Path) -> list[Path]:
    """Return the files in a folder, sorted; links to folders are followed once."""
    found: list[Path] = []
    seen: set[str] = set()
    for place, folders, files in os.walk(folder, followlinks=True):
        seen.add(os.path.realpath(place))
        kept = [name for name in folders if name not in _NOTES]
        folders[:] = [name for name in kept if os.path.realpath(f"{place}/{name}") not in seen]
        found += [Path(place, name) for name in files]
    return sorted(found)
