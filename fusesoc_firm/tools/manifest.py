"""The manifest of a build: the tools that took part in the build, stored next to the tools' outputs.

Each program is added when it has run, so the tools of an output that is not rebuilt remain in the list. The file
contains no dates and no paths, so equal tools and builds result in equal manifests on every machine.
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
    """Record a program that has run in a folder, and the packages that started it, in the folder's manifest.

    Unknown programs, such as mkdir, are not recorded. Several programs may be recorded at the same time.
    """
    if program not in PROGRAMS:
        return
    programs = (program, *PROGRAMS[program].starts)
    found = packages(_PACKAGES) | {name: facts_of(name, path) for name in programs if (path := find(name))}
    # The lock is on the folder itself, so no lock file remains.
    with locked(folder):
        tools = read(folder) | found
        _replace(folder / FILE, json.dumps({"tools": tools}, indent=2, sort_keys=True) + "\n")


def read(folder: Path) -> dict[str, dict[str, str]]:
    """Return the facts about each tool in a folder's manifest; empty if the manifest is missing or unreadable."""
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
