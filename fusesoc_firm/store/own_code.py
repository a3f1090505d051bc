"""Which of this package's own files a result was made with, so that an edit makes anew just what it can change.

These are the modules that were imported, the data files beside them, and the templates that were read, all of them for
the whole process. A generator call has one to itself; a process that does more counts too many, never too few.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
_DATA = (".yaml", ".csv")
_COUNTED = (".py", ".mustache", *_DATA)
# A file can be edited twice within what its time tells apart.
_NEW_SECONDS = 2
_DIGESTS: dict[Path, tuple[tuple[int, int, int], str]] = {}


def digests(package: Path = PACKAGE) -> dict[str, str]:
    """The SHA-256 of every module, data file and template of a package's folder, its libraries left out, by name."""
    return {name: _digest(_path(package, name)) for name in all_names(package)}


def digest() -> str:
    """The SHA-256 of all of them, which tells one state of this package from another between two versions."""
    return hashlib.sha256(json.dumps(digests(), sort_keys=True).encode()).hexdigest()


@cache
def _path(package: Path, name: str) -> Path:
    return package / name


def _digest(path: Path) -> str:
    """The SHA-256 of a file; not read again while its state is the same, unless it is so new that this may err."""
    status = path.stat()
    state = (status.st_ino, status.st_size, status.st_mtime_ns)
    if (known := _DIGESTS.get(path)) and known[0] == state:
        return known[1]
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if time.time() - status.st_mtime > _NEW_SECONDS:
        _DIGESTS[path] = (state, digest)
    return digest


def used_code() -> list[str]:
    """Those of the names in `digests` that this process has used so far, sorted."""
    from fusesoc_firm.text.render import TEMPLATES, templates_read

    files = [getattr(module, "__file__", None) for module in [*sys.modules.values()]]
    modules = {name for file in files if file and (name := _own_name(file))}
    folders = {name.rpartition("/")[0] for name in modules}
    templates = TEMPLATES.relative_to(PACKAGE).as_posix()
    used = modules | {f"{templates}/{name}" for name in templates_read()}
    return [name for name in all_names() if name in used or _is_data(name, folders)]


@cache
def _own_name(file: str) -> str | None:
    """The name of one of our own files; None for another."""
    path = Path(file).resolve()
    return path.relative_to(PACKAGE).as_posix() if path.is_relative_to(PACKAGE) else None


def _is_data(name: str, folders: set[str]) -> bool:
    return name.endswith(_DATA) and name.rpartition("/")[0] in folders


def all_names(package: Path = PACKAGE) -> list[str]:
    """The names in `digests`, sorted."""
    found: list[str] = []
    start = len(str(package)) + 1
    for folder, folders, files in os.walk(package):
        # In the libraries lie cores, and links to folders of any size.
        folders[:] = [name for name in folders if name not in ("demos", "library", "__pycache__")]
        above = f"{folder}/"[start:]
        found += [f"{above}{name}" for name in files if name.endswith(_COUNTED)]
    return sorted(found)
