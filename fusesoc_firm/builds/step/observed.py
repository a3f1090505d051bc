"""Facts about a step's inputs outside its folder; each has a kind, a name and the state when the step ran.

    program     the SHA-256 of the program that PATH finds under this name
    file        the SHA-256 of the content
    folder      the names in the folder
    modules     the names in a folder on Python's path that an import can find
    there       `file` or `folder`, or nothing for a missing path

A stored result is valid while no state differs.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import sys
from collections.abc import Callable
from functools import cache
from importlib.machinery import all_suffixes

from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.trace import Trace
from fusesoc_firm.tools.facts import Fact, StateOf

# Python adds this folder beside each imported module.
_BYTE_CODE = "__pycache__"
_MODULES = tuple(all_suffixes())


def facts_of(trace: Trace, contents: Contents, search: str) -> list[Fact]:
    """Return the facts about a step's use of files, each in its current state; `search` is the step's PATH."""
    folders = search.split(os.pathsep)
    names: dict[tuple[str, str], None] = {}
    for path in sorted(trace.programs):
        is_found = os.path.dirname(path) in folders
        names["program" if is_found else "file", os.path.basename(path) if is_found else path] = None
    names |= {("file", _source(path)): None for path in sorted(trace.read)}
    names |= {("modules" if path in sys.path else "folder", path): None for path in sorted(trace.listed)}
    known = {name for _, name in names}
    names |= {("there", path): None for path in sorted(trace.asked) if path not in known and _BYTE_CODE not in path}
    return [(kind, name, state(kind, name, contents, search)) for kind, name in names]


def states(contents: Contents, search: str) -> StateOf:
    """Return a function for current states, which looks each fact up once."""
    return cache(lambda kind, name: state(kind, name, contents, search))


def state(kind: str, name: str, contents: Contents, search: str) -> str | None:
    """Return a fact's current state, or None if the object is missing."""
    if kind == "program":
        path = _found(name, search)
        return contents.digest(path) if path else None
    if kind == "file":
        return contents.digest(name)
    if kind == "folder":
        return _names(name)
    if kind == "modules":
        return _names(name, _is_importable)
    return _kind(name)


@cache
def _found(name: str, search: str) -> str | None:
    return shutil.which(name, path=search)


def _names(path: str, is_counted: Callable[[str], bool] = lambda _: True) -> str | None:
    try:
        names = sorted(name for name in {*os.listdir(path)} - {_BYTE_CODE} if is_counted(name))
    except OSError:
        return None
    return hashlib.sha256("\0".join(names).encode()).hexdigest()


def _is_importable(name: str) -> bool:
    """Return whether an import of a module or package may find this name in a folder on Python's path.

    Python lists these folders, such as a checkout or the installed packages, but looks only for modules in them.
    """
    return name.isidentifier() or name.endswith(_MODULES)


def _kind(path: str) -> str | None:
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return None
    return "folder" if stat.S_ISDIR(mode) else "file"


def _source(path: str) -> str:
    """Return a module's source for the byte code that Python keeps of it."""
    folder, name = os.path.split(path)
    if os.path.basename(folder) != _BYTE_CODE:
        return path
    return os.path.join(os.path.dirname(folder), f"{name.partition('.')[0]}.py")
