"""The manifest of a build: which tools took part in it, beside what they made.

Every program that has run is added, so an output that is not made again keeps the tools that made it.
The file holds no dates and no paths: where the same tools build the same, it is the same.
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
    """Write a program that has run in a folder into its manifest, with the packages that had it run.

    Nothing is written of a program that is not known, such as mkdir. Programs may be noted at the same time.
    """
    if program not in PROGRAMS:
        return
    programs = (program, *PROGRAMS[program].starts)
    found = packages(_PACKAGES) | {name: facts_of(name, path) for name in programs if (path := find(name))}
    # Of the folder, so no file is left over.
    with locked(folder):
        tools = read(folder) | found
        _replace(folder / FILE, json.dumps({"tools": tools}, indent=2, sort_keys=True) + "\n")


def read(folder: Path) -> dict[str, dict[str, str]]:
    """What a folder's manifest says of each tool; nothing where there is none, or none that can be read."""
    try:
        tools = json.loads((folder / FILE).read_text(encoding="utf-8"))["tools"]
    except (OSError, ValueError, LookupError, TypeError):
        return {}
    return dict(tools) if isinstance(tools, dict) else {}


def _replace(path: Path, text: str) -> None:
    """Write a file, which is either the old one or the new one at any time; not at all if nothing changes."""
    if path.is_file() and path.read_text(encoding="utf-8") == text:
        return
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=path.parent, delete=False) as part:
        part.write(text)
    Path(part.name).chmod(0o644)
    Path(part.name).replace(path)
