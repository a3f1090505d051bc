"""The manifest of a build: the tools that took part in the build, stored next to the tools' outputs.

Every program that has run is added, so the tools of an output that is not rebuilt remain in the list. The file contains
no dates and no paths, so the same tools and the same build give the same manifest on every machine.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from fusesoc_firm.text.file_lock import locked
from fusesoc_firm.tools.programs import PROGRAMS, facts_of, find, packages

FILE = "manifest.json"
_PACKAGES = ("edalize", "fusesoc", "fusesoc-firm")


def note(program: str, folder: Path) -> None:
    """Record in a folder's manifest a program that has run in this folder, and the packages that started the program.

    Unknown programs, such as mkdir, are not recorded. Several programs may be recorded at the same time.
    """
    if program not in PROGRAMS:
        return
    programs = (program, *PROGRAMS[program].starts)
    found = packages(_PACKAGES) | {name: facts_of(name, path) for name in programs if (path := find(name))}
    # The folder itself is locked, so no lock file is left over.
    with locked(folder):
        tools = read(folder) | found
        _replace(folder / FILE, json.dumps({"tools": tools}, indent=2, sort_keys=True) + "\n")


def read(folder: Path) -> dict[str, dict[str, str]]:
    """Return the facts of each tool in a folder's manifest, or an empty dictionary if the manifest is missing or unreadable."""
    try:
        tools = json.loads((folder / FILE).read_text(encoding="utf-8"))["tools"]
    except (OSError, ValueError, LookupError, TypeError):
        return {}
    return dict(tools) if isinstance(tools, dict) else {}


def _replace(path: Path, text: str) -> None:
    """Replace a file atomically, unless its text is unchanged."""
    if path.is_file() and path.read_text(encoding="utf-8") == text:
        return
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=path.parent, delete=False) as part:
        part.write(text)
    Path(part.name).chmod(0o644)
    Path(part.name).replace(path)
