"""`firm init --example`: a new project that is a copy of a demo system."""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from fusesoc_firm.core.core_reader import read_core
from fusesoc_firm.system.scaffold.project import files_of, new_folder, write_surroundings
from fusesoc_firm.text.diagnostics import closest, fail
from fusesoc_firm.text.naming import identifier

# The demo systems' pages contain links that are valid only in a checkout.
_LEFT_OUT = ("README.md", "__pycache__")


def examples(demos: Path) -> list[str]:
    """Return the names of the demo systems in a folder."""
    return sorted(path.name for path in demos.iterdir() if (path / f"{path.name}.core").is_file())


def example_named(words: str, demos: Path) -> str:
    """Return the only demo system whose name begins with the words, or else whose description contains them.

    Raise `InputError` unless exactly one matches.
    """
    known = {name: str(read_core(demos / name / f"{name}.core").data["description"]) for name in examples(demos)}
    named = [name for name in known if name.startswith(words)]
    described = [name for name, text in known.items() if re.search(rf"\b{re.escape(words)}\b", text, re.IGNORECASE)]
    if words in known:
        return words
    found = named or described
    if not words or len(found) != 1:
        fail(f"unknown example '{words}'", hint=_hint(words, known))
    return found[0]


def copy_example(example: str, folder: Path, demos: Path) -> list[Path]:
    """Copy a demo system to a new folder as a project, and return its files, relative to `folder`.

    `demos` is the folder of the demo systems. May raise `InputError`.
    """
    with new_folder(folder) as inner:
        shutil.copytree(demos / example, inner, ignore=shutil.ignore_patterns(*_LEFT_OUT), dirs_exist_ok=True)
        write_surroundings(inner, identifier(folder.name))
    return files_of(folder)


def _hint(words: str, known: Mapping[str, str]) -> str:
    """Return the example that was probably meant, or all examples with their descriptions."""
    if near := closest(words, known):
        return f"did you mean '{near}'?"
    return "legal here:\n" + "\n".join(f"        {name}: {text}" for name, text in known.items())
