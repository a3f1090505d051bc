"""One run of FuseSoC: writes a generated core, and the data that the run's calls leave for each other.

Each generator call is a separate process. FuseSoC makes the calls of a run one after another, in adjacent folders
below `generator_cache`, which may still contain folders of earlier runs. So the data that a call leaves there names its
run.
* The messages of a core: the messages' generator marks its folder, and the generators of other cores find that folder.
* The design units of a core: a tool keeps one unit of each name, and a later unit silently replaces an earlier one. So
  each call compares its units with those of previous calls. Other targets generate elsewhere.

A hit waits for this module, so it imports as little as possible.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress

from fusesoc_firm.text.files import read_file, write_if_changed

# The folder in which FuseSoC creates a folder for each call; adjacent folders elsewhere are not one design.
_GENERATED = "generator_cache"
# A file that keeps FuseSoC from searching a folder for cores.
_IGNORE = "FUSESOC_IGNORE"
_MESSAGES, _UNITS = "firm_messages.run", "firm_units.run"
_VHDL = re.compile(rb"^[ \t]*(?:entity|package)[ \t]+(\w+)[ \t\r\n]+is\b", re.MULTILINE | re.IGNORECASE)
_VERILOG = re.compile(rb"^[ \t]*module[ \t]+(\w+)", re.MULTILINE)
_PATTERNS = {".vhd": _VHDL, ".vhdl": _VHDL, ".v": _VERILOG, ".sv": _VERILOG}


Clash = tuple[str, str]
"""A unit, and the full name of another core of the run that defines it differently."""


def run_of(fusesoc: int) -> str:
    """Return an id of this FuseSoC process's run that is unique on this machine."""
    # The start time follows the name in parentheses, which may contain blanks.
    status = (read_file(f"/proc/{fusesoc}/stat") or b"").decode(errors="replace")
    return f"{fusesoc} {''.join(status.rpartition(')')[2].split()[19:20])}"


def write_core(files: Mapping[str, bytes], core: str, messages_of: str, run: str) -> Clash | None:
    """Write a generated core, by its full name, to the current folder; the last file is its `.core`.

    `messages_of` is the core whose messages these are, or "". If another core of the run defines a unit differently,
    that clash is returned and nothing is written. Raise `OSError` with the absolute path that cannot be written.
    """
    folder = os.getcwd()
    units = _units_of(files)
    if found := _clash(folder, units, run):
        return found
    if is_generated := os.path.basename(os.path.dirname(folder)) == _GENERATED:
        _hide(os.path.dirname(folder))
    for name, content in files.items():
        _write(name, content)
    if messages_of:
        _write(_MESSAGES, f"{messages_of}\n{run}".encode())
    if units and is_generated:
        lines = [run, core, *(f"{digest} {unit}" for unit, digest in units.items())]
        _write(_UNITS, "\n".join(lines).encode())
    return None


def message_folders(generated: str, core: str, run: str | None) -> list[str]:
    """Return the folders in `generated` with the messages of a core (`vendor:library:name`), sorted; None means any run."""
    found = []
    for folder in _folders(generated):
        marked, _, of_run = _read(folder, _MESSAGES).partition("\n")
        if marked == core and run in (None, of_run):
            found.append(folder)
    return found


def _units_of(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the design units in generated files by their VHDL names, each with the digest of its file."""
    found: dict[str, str] = {}
    for name, content in files.items():
        if pattern := _PATTERNS.get(os.path.splitext(name)[1].lower()):
            digest = hashlib.sha256(content).hexdigest()
            found |= dict.fromkeys((unit.decode().lower() for unit in pattern.findall(content)), digest)
    return found


def _clash(folder: str, units: Mapping[str, str], run: str) -> Clash | None:
    """Return the first unit that differs from a unit of the same name and run in a folder next to `folder`."""
    for core, others in _others(folder, run):
        for unit, digest in others.items():
            if units.get(unit, digest) != digest:
                return unit, core
    return None


def _others(folder: str, run: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the core and units of each call in the run, except the call in `folder`, in order of folder name."""
    generated = os.path.dirname(folder)
    if os.path.basename(generated) != _GENERATED:
        return
    for place in _folders(generated):
        if place == folder:
            continue
        of_run, _, rest = _read(place, _UNITS).partition("\n")
        if of_run == run:
            core, *lines = rest.split("\n")
            yield core, {unit: digest for digest, _, unit in (line.partition(" ") for line in lines)}


def _folders(generated: str) -> list[str]:
    try:
        names = sorted(os.listdir(generated))
    except OSError:
        return []
    return [os.path.join(generated, name) for name in names]


def _read(folder: str, name: str) -> str:
    return (read_file(os.path.join(folder, name)) or b"").decode(errors="replace")


def _hide(generated: str) -> None:
    """Keep generated cores from being found as cores of a library.

    FuseSoC takes every `.core` below a library's folder. If a project's own folder is a library, it contains the
    project's builds, too.
    """
    # Everything else works without this file.
    with suppress(OSError), open(os.path.join(generated, _IGNORE), "ab"):
        pass


def _write(name: str, content: bytes) -> None:
    try:
        write_if_changed(name, content)
    except OSError as error:
        raise OSError(error.errno, error.strerror, os.path.abspath(name)) from error
