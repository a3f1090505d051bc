"""The VHDL files of the cores that a core depends on, without a run of FuseSoC."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.setup.cores import calls_of, solved
from fusesoc_firm.builds.setup.outcome import configuration
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.library_path import library_root

_VHDL = "vhdlSource"
_VHDL_2008 = "vhdlSource-2008"
_STANDARD = "--std="
_WORK = "work"
_LIBRARY_CORE = "robot:firm:firm_system:0"


@dataclass(frozen=True)
class VhdlSources:
    """VHDL files with their VHDL libraries, in the order of their use, and GHDL's options for them.

    `is_complete` is False if files are missing that a generator or a download would create.
    """

    files: tuple[tuple[Path, str], ...] = ()
    options: tuple[str, ...] = (f"{_STANDARD}93",)
    is_complete: bool = False


def vhdl_sources(name: str, folder: Path) -> VhdlSources:
    """Return the files that a core in `folder` uses in its simulation; for an unknown core, the result is empty."""
    from fusesoc.coremanager import DependencyError

    try:
        fusesoc = _with_libraries(name, folder)
        core = fusesoc.get_core(name)
        targets = core.get_data({}).targets
        target = next(item for item in ("sim", *targets) if item in targets)
        cores = solved(fusesoc, core, target)
    except (InputError, DependencyError, SyntaxError, RuntimeError, StopIteration):
        return VhdlSources()
    options = tuple(map(str, _flow_options(core, target).get("analyze_options") or ()))
    found = [item for other, flags in cores for item in _files(other, flags)]
    if not any(option.startswith(_STANDARD) for option in options):
        options += (f"{_STANDARD}{'08' if any(item['file_type'] == _VHDL_2008 for item in found) else '93'}",)
    files = [(Path(item["folder"], item["name"]), item.get("logical_name") or _WORK) for item in found]
    present = tuple(item for item in files if item[0].is_file())
    generates = any(other is not core and any(calls_of(other, flags)) for other, flags in cores)
    return VhdlSources(present, options, len(present) == len(files) and not generates)


def _with_libraries(name: str, folder: Path) -> Any:
    """Return a FuseSoC instance that knows our library and the core in `folder`."""
    from fusesoc.fusesoc import Fusesoc
    from fusesoc.librarymanager import Library

    fusesoc = Fusesoc(configuration())
    for core, place in ((_LIBRARY_CORE, library_root()), (name, folder)):
        if core.rpartition(":")[0] not in {known.rpartition(":")[0] for known in fusesoc.get_cores()}:
            fusesoc.add_library(Library(str(place), str(place.resolve())))
    return fusesoc


def _flow_options(core: Any, target: str) -> Mapping[str, Any]:
    return getattr(core.get_data({}).targets[target], "flow_options", None) or {}


def _files(core: Any, flags: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """Yield the VHDL files of a core with their attributes and their folder."""
    for item in core.get_files(dict(flags)):
        if item.get("file_type", "").startswith(_VHDL):
            yield {**item, "folder": core.files_root}
