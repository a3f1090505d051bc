"""One run of FuseSoC: write a generated core, and the data that the run's calls leave for each other.

Each generator call is a separate process. FuseSoC makes the calls of a run one after another, in adjacent folders
below `generator_cache`, which may still contain folders of earlier runs. The data that a call leaves in its folder
therefore include the run's id:

* The messages of a core: the generator of message cores marks its folder, and the generators of other cores find that
  folder.
* The design units of a core: a tool keeps only one unit of each name, and a later unit silently replaces an earlier
  unit. Each call therefore compares its units with those of previous calls. Other targets generate elsewhere.

Every hit loads this module, so it imports as little as possible.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress

from fusesoc_firm.text.files import read_file, write_if_changed
from fusesoc_firm.tools.processes import start_time

# The folder in which FuseSoC creates a folder for each call; adjacent folders in other places are not one design.
_GENERATED = "generator_cache"
# A file that keeps FuseSoC from searching a folder for cores.
_IGNORE = "FUSESOC_IGNORE"
_MESSAGES, _UNITS = "firm_messages.run", "firm_units.run"
_VHDL = re.compile(rb"^[ \t]*(?:entity|package)[ \t]+(\w+)[ \t\r\n]+is\b", re.MULTILINE | re.IGNORECASE)
_VERILOG = re.compile(rb"^[ \t]*module[ \t]+(\w+)", re.MULTILINE)
# In a generated `.core`; all files have the same library.
_LIBRARY = re.compile(rb"^ *logical_name: (\w+)$", re.MULTILINE)
_PATTERNS = {".vhd": _VHDL, ".vhdl": _VHDL, ".v": _VERILOG, ".sv": _VERILOG}


Clash = tuple[str, str]
"""A unit, and the full name of another core in the run that defines the unit differently."""


def run_of(fusesoc: int) -> str:
    """Return an id, unique on this machine, for the run of the FuseSoC process with this id."""
    return f"{fusesoc} {start_time(fusesoc)}"


def write_core(files: Mapping[str, bytes], core: str, messages_of: str, run: str) -> Clash | None:
    """Write the generated core with the full name `core` to the current folder; the last of `files` is its `.core`.

    `messages_of` is the core whose messages `files` define, or "". If another core in the run defines a unit
    differently, return this clash and write nothing. Raise `OSError` with the absolute path that cannot be written.
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
    """Return the sorted folders in `generated` with the messages of a core, from `run` or, for None, from any run."""
    found = []
    for folder in _folders(generated):
        marked, _, of_run = _read(folder, _MESSAGES).partition("\n")
        if marked == core and run in (None, of_run):
            found.append(folder)
    return found


def _units_of(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return the VHDL names of the design units in generated files, each with the digest of its file.

    Units of a VHDL library have its name before their own, since other libraries may have units of the same name.
    """
    library = _LIBRARY.search([*files.values()][-1]) if files else None
    prefix = f"{library[1].decode()}." if library else ""
    found: dict[str, str] = {}
    for name, content in files.items():
        if pattern := _PATTERNS.get(os.path.splitext(name)[1].lower()):
            digest = hashlib.sha256(content).hexdigest()
            found |= dict.fromkeys((f"{prefix}{unit.decode().lower()}" for unit in pattern.findall(content)), digest)
    return found


def _clash(folder: str, units: Mapping[str, str], run: str) -> Clash | None:
    """Return the first unit that differs from a unit with the same name and run beside `folder`, or None."""
    for core, others in _others(folder, run):
        for unit, digest in others.items():
            if units.get(unit, digest) != digest:
                return unit, core
    return None


def _others(folder: str, run: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the core and units of each call in the run, except the call in `folder`, in the order of folder names."""
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
    """Prevent FuseSoC from finding generated cores in a library.

    FuseSoC loads every `.core` below a library's folder. If a project's own folder is a library, it also contains the
    project's builds.
    """
    # A failed write has no other effect, so it is ignored.
    with suppress(OSError), open(os.path.join(generated, _IGNORE), "ab"):
        pass


def _write(name: str, content: bytes) -> None:
    try:
        write_if_changed(name, content)
    except OSError as error:
        raise OSError(error.errno, error.strerror, os.path.abspath(name)) from error
