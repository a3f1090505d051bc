"""Which design units the generated cores of one run of FuseSoC define, so that none is defined in two ways.

A tool keeps one unit of each name: the later one silently replaces the earlier. Each generator call is a process of its
own, and FuseSoC makes the calls of a run one after another, in folders side by side. So each call leaves a file in its
folder that names the run, its core and its units, and compares its own units with those of the calls before it. Folders
of earlier runs name another run, and other targets generate elsewhere. Only as much of Python's library is imported as
that needs.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from fusesoc_firm.text.files import read_file, write_whole

# The folder in which FuseSoC has a folder for each call; what lies side by side elsewhere is no design.
_GENERATED = "generator_cache"
_FILE = "firm_units.run"
_VHDL = re.compile(rb"^[ \t]*(?:entity|package)[ \t]+(\w+)[ \t\r\n]+is\b", re.MULTILINE | re.IGNORECASE)
_VERILOG = re.compile(rb"^[ \t]*module[ \t]+(\w+)", re.MULTILINE)
_PATTERNS = {".vhd": _VHDL, ".vhdl": _VHDL, ".v": _VERILOG, ".sv": _VERILOG}


class Clash(NamedTuple):
    """A unit that another core of the run, by its full name, defines in another way."""

    unit: str
    core: str


def units_of(files: Mapping[str, bytes]) -> dict[str, str]:
    """Every design unit in generated files, as VHDL sees its name, with the digest of its file."""
    found: dict[str, str] = {}
    for name, content in files.items():
        if pattern := _PATTERNS.get(os.path.splitext(name)[1].lower()):
            digest = hashlib.sha256(content).hexdigest()
            found |= dict.fromkeys((unit.decode().lower() for unit in pattern.findall(content)), digest)
    return found


def clash(folder: str, units: Mapping[str, str], run: str) -> Clash | None:
    """The first unit that differs from one of the same name and run in the folders beside `folder`."""
    for core, others in _others(os.path.abspath(folder), run):
        for unit, digest in others.items():
            if units.get(unit, digest) != digest:
                return Clash(unit, core)
    return None


def note_units(folder: str, core: str, units: Mapping[str, str], run: str) -> None:
    """Leave a generated core's units in its folder, for the calls after it."""
    if units and _is_generated(os.path.abspath(folder)):
        lines = [run, core, *(f"{digest} {unit}" for unit, digest in units.items())]
        write_whole(os.path.join(folder, _FILE), "\n".join(lines).encode())


def _is_generated(folder: str) -> bool:
    return os.path.basename(os.path.dirname(folder)) == _GENERATED


def _others(folder: str, run: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Core and units of every call of the run but that of `folder`, in the order of their folders' names."""
    if not _is_generated(folder):
        return
    generated = os.path.dirname(folder)
    try:
        names = sorted(os.listdir(generated))
    except OSError:
        return
    for name in names:
        if (place := os.path.join(generated, name)) == folder:
            continue
        found, _, rest = (read_file(os.path.join(place, _FILE)) or b"").decode(errors="replace").partition("\n")
        if found == run:
            core, *lines = rest.split("\n")
            yield core, {unit: digest for digest, _, unit in (line.partition(" ") for line in lines)}
