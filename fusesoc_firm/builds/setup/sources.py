"""The VHDL files of the cores that a core depends on, without a run of FuseSoC."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.setup.cores import calls_of, solved
from fusesoc_firm.builds.setup.libraries import has_library, open_libraries
from fusesoc_firm.core.core_reader import core_name
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.library_path import library_root

_VHDL = "vhdlSource"
_VHDL_2008 = "vhdlSource-2008"
_STANDARD = "--std="
_WORK = "work"
_LIBRARY_CORE = "robot:firm:firm_system:0"


@dataclass(frozen=True)
class VhdlSources:
    """VHDL files with their VHDL libraries, and GHDL's standard and options for them.

    The `standard` is empty if neither the options nor a file selects one. `is_complete` is False if files are missing
    that a generator or a download would create.
    """

    files: tuple[tuple[Path, str], ...] = ()
    standard: str = ""
    options: tuple[str, ...] = ()
    is_complete: bool = False
    _fusesoc: Any = field(default=None, repr=False)

    def core_with(self, library: str, unit: str) -> str:
        """Return the name of the first known core with a VHDL library and, unless empty, a unit in a file of its name.

        Return an empty text if there is no such core.
        """
        for core in self._fusesoc.get_cores().values() if self._fusesoc else ():
            units = [Path(name).stem.lower() for name, of in _library_files(core) if of.lower() == library.lower()]
            if unit.lower() in units if unit else units:
                return core_name(str(core.name))
        return ""


def vhdl_sources(name: str, folder: Path) -> VhdlSources:
    """Return the files that a core in `folder` uses in its simulation; for an unknown core, the result is empty."""
    from fusesoc.coremanager import DependencyError

    try:
        fusesoc = with_libraries(name, folder)
        core = fusesoc.get_core(name)
        targets = core.get_data({}).targets
        target = next(item for item in ("sim", *targets) if item in targets)
        cores = solved(fusesoc, core, target)
    except (InputError, DependencyError, SyntaxError, RuntimeError, StopIteration):
        return VhdlSources()
    given = [*map(str, _flow_options(core, target).get("analyze_options") or ())]
    standards = [option.removeprefix(_STANDARD) for option in given if option.startswith(_STANDARD)]
    options = tuple(option for option in given if not option.startswith(_STANDARD))
    found = [item for other, flags in cores for item in _files(other, flags)]
    # GHDL has one standard for all files.
    if any(item["file_type"] == _VHDL_2008 for item in found):
        standards.append("08")
    files = [(Path(item["folder"], item["name"]), item.get("logical_name") or _WORK) for item in found]
    present = tuple(item for item in files if item[0].is_file())
    generates = any(other is not core and any(calls_of(other, flags)) for other, flags in cores)
    is_complete = len(present) == len(files) and not generates
    return VhdlSources(present, standards[0] if standards else "", options, is_complete, fusesoc)


def with_libraries(name: str, folder: Path) -> Any:
    """Return a FuseSoC instance that knows our library and the core in `folder`."""
    from fusesoc.librarymanager import Library

    fusesoc = open_libraries()
    for core, place in ((_LIBRARY_CORE, library_root()), (name, folder)):
        known = {item.rpartition(":")[0] for item in fusesoc.get_cores()}
        if core.rpartition(":")[0] not in known and not has_library(fusesoc, place):
            fusesoc.add_library(Library(str(place), str(place.resolve())))
    return fusesoc


def _flow_options(core: Any, target: str) -> Mapping[str, Any]:
    return getattr(core.get_data({}).targets[target], "flow_options", None) or {}


def _library_files(core: Any) -> Iterator[tuple[str, str]]:
    """Yield the files of all filesets of a core that belong to a VHDL library, each with the library."""
    for fileset in core.get_data({}).filesets.values():
        for entry in fileset.files:
            yield from ((name, item.logical_name) for name, item in entry.items() if item.logical_name)


def _files(core: Any, flags: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """Yield the VHDL files of a core with their attributes and their folder."""
    for item in core.get_files(dict(flags)):
        if item.get("file_type", "").startswith(_VHDL):
            yield {**item, "folder": core.files_root}
