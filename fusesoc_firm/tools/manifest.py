"""The manifest of a build: the tools that took part in the build, stored next to the tools' outputs.

Each program is added after its run, so the tools of an output that is not rebuilt remain in the list. The file contains
no dates and no paths, so equal tools and builds result in equal manifests on every machine.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from contextlib import suppress
from importlib import metadata
from pathlib import Path

from fusesoc_firm.text.file_lock import locked
from fusesoc_firm.tools.own_code import PACKAGE
from fusesoc_firm.tools.programs import PROGRAMS, facts_of, find, packages

FILE = "manifest.json"
# Edalize's description of a build.
_OF_A_BUILD = "*.eda.yml"
_PACKAGES = ("edalize", "fusesoc", "fusesoc-firm")
# Linux's limit.
_MOST_LINKS = 40


def note(program: str, folder: Path) -> str:
    """Record a program that has run in a build's folder, and the packages that started it, in the folder's manifest.

    Several programs may be recorded at the same time. Return the text of the new entries. It is empty for an unknown
    program, such as mkdir, and for a folder without a build of Edalize, since `firm tool` can run anywhere.
    """
    if program not in PROGRAMS or not any(folder.glob(_OF_A_BUILD)):
        return ""
    programs = (program, *PROGRAMS[program].starts)
    found = packages(_PACKAGES) | {name: facts_of(name, path) for name in programs if (path := find(name))}
    # The lock is on the folder itself, so no lock file remains.
    with locked(folder):
        _replace(folder / FILE, _text(read(folder) | found))
    # Omit the lines with the braces around the entries.
    return "".join(_text(found).splitlines(keepends=True)[2:-2])


def note_for_other_builds(path: Path, environment: str, program: Path, entries: str, started: int) -> None:
    """Write a program's entries to the user's cache, where `firm_launcher.sh` finds them for other builds.

    The note is valid in an `environment` until a file that determines the entries changes after the time `started`, in
    nanoseconds. A folder that is not writable is ignored.
    """
    places = {name: str(metadata.distribution(name).locate_file("")) for name in _PACKAGES}
    starts = PROGRAMS[program.name].starts if program.name in PROGRAMS else ()
    files = [program, *filter(None, map(find, starts))]
    decisive = [*(link for file in files for link in _links(file)), Path(sys.executable), *map(Path, places.values())]
    lines = (environment, str(PACKAGE), *dict.fromkeys(map(str, decisive)), "")
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        _replace(path, "".join(f"{line}\n" for line in lines) + entries)
        os.utime(path, ns=(started, started))


def read(folder: Path) -> dict[str, dict[str, str]]:
    """Return the facts about each tool in a folder's manifest; empty if the manifest is missing or unreadable."""
    try:
        tools = json.loads((folder / FILE).read_text(encoding="utf-8"))["tools"]
    except (OSError, ValueError, LookupError, TypeError):
        return {}
    return dict(tools) if isinstance(tools, dict) else {}


def _links(path: Path) -> list[Path]:
    """Return a path, followed by the chain of its links and the file at the end."""
    found = [path]
    while found[-1].is_symlink() and len(found) < _MOST_LINKS:
        found.append(found[-1].parent / found[-1].readlink())
    return found


def _text(tools: dict[str, dict[str, str]]) -> str:
    return json.dumps({"tools": tools}, indent=2, sort_keys=True) + "\n"


def _replace(path: Path, text: str) -> None:
    """Replace a file atomically, unless its text is unchanged."""
    if path.is_file() and path.read_text(encoding="utf-8") == text:
        return
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=path.parent, delete=False) as part:
        part.write(text)
    Path(part.name).chmod(0o644)
    Path(part.name).replace(path)
