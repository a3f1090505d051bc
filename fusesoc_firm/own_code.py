"""Which of this package's own files a result was made with, so that an edit makes anew just what it can change.

These are the modules that were imported, the data files beside them, and the templates that were read, all of them for
the whole process. A generator call has one to itself; a process that does more counts too many, never too few.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
_DATA = (".yaml", ".csv")
_COUNTED = (".py", ".mustache", *_DATA)


def digests(package: Path = PACKAGE) -> dict[str, str]:
    """The SHA-256 of every module, data file and template of a package's folder, its library left out, by name."""
    return {name: hashlib.sha256((package / name).read_bytes()).hexdigest() for name in all_names(package)}


def digest() -> str:
    """The SHA-256 of all of them, which tells one state of this package from another between two versions."""
    return hashlib.sha256(json.dumps(digests(), sort_keys=True).encode()).hexdigest()


def used_code() -> list[str]:
    """Those of the names in `digests` that this process has used so far, sorted."""
    from fusesoc_firm.render import TEMPLATES, templates_read

    files = [getattr(module, "__file__", None) for module in [*sys.modules.values()]]
    modules = {path for file in files if file and (path := Path(file).resolve()).is_relative_to(PACKAGE)}
    folders = {path.parent for path in modules}
    used = modules | {TEMPLATES / name for name in templates_read()}
    return sorted(name for name in all_names() if (path := PACKAGE / name) in used or _is_data(path, folders))


def _is_data(path: Path, folders: set[Path]) -> bool:
    return path.suffix in _DATA and path.parent in folders


def all_names(package: Path = PACKAGE) -> list[str]:
    """The names in `digests`, sorted."""
    found: list[str] = []
    for folder, folders, files in os.walk(package):
        # In the library lie cores, and links to folders of any size.
        folders[:] = [name for name in folders if name not in ("library", "__pycache__")]
        above = os.path.relpath(folder, package)
        found += [os.path.normpath(os.path.join(above, name)) for name in files if name.endswith(_COUNTED)]
    return sorted(found)
