"""Check what a simulation of a system reads, without a build: core, targets, files, stimuli, model and software.

The check calls the functions that the run calls, so both report the same faults at the same places.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.call.calls import make_request
from fusesoc_firm.builds.call.generators import GENERATORS, MESSAGES
from fusesoc_firm.builds.project import message_folders
from fusesoc_firm.builds.setup.cores import calls_of, solved
from fusesoc_firm.builds.setup.libraries import check_files, core_place, ignored
from fusesoc_firm.builds.setup.sources import with_libraries
from fusesoc_firm.core.core_reader import CoreFile, core_name
from fusesoc_firm.core.request import GeneratorCall
from fusesoc_firm.runs.simulation import simulation_core
from fusesoc_firm.system.system_core import load_requested
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics, SourceRef, closest, fail, nearest, nearest_file
from fusesoc_firm.text.outputs import shown

# A fileset may be named under a condition: 'tool_ghdl? (benches)'.
_WORD = re.compile(r"\w+")


def check_core(file: CoreFile, simulation: str, *, may_run: bool = False) -> tuple[Diagnostic, ...]:
    """Check the targets of a system's core, and all that a simulation reads; return the warnings.

    `simulation` is the simulation's target. The user's Python code is only read unless it `may_run`. Raise `InputError`
    with all faults.
    """
    from fusesoc.coremanager import DependencyError

    faults = Diagnostics()
    name = str(file.data.get("name", ""))
    fusesoc = with_libraries(name, file.path.parent)
    try:
        core = fusesoc.get_core(name)
    except (DependencyError, SyntaxError):
        fail(f"FuseSoC does not know the core '{name}'", file.place_of(name), ignored(fusesoc, name))
    for target in core.get_data({}).targets:
        _check_target(core, target, faults)
    _note_unused(file, faults)
    for call in _calls(fusesoc, core, simulation, faults):
        with faults.noting():
            _check_call(call, may_run=may_run)
    faults.raise_if_any()
    return faults.warnings


def _note_unused(file: CoreFile, faults: Diagnostics) -> None:
    """Warn of the filesets that no target names: their files are in no build."""
    named = {word for item in file.section("targets").values() for word in _WORD.findall(str(item.get("filesets", "")))}
    for name in file.section("filesets").keys() - named if named else ():
        hint = f"add '{name}' to 'filesets' of the targets that need its files"
        faults.warn(f"no target uses the fileset '{name}'", _place(file, name), hint)


def check_toplevels(file: CoreFile, toplevels: Mapping[str, str], faults: Diagnostics) -> None:
    """Note the targets of a core whose top level is misspelt; `toplevels` has the top level of each known target."""
    targets = file.section("targets")
    # A target inherits the fault of another one.
    found = {(str(targets[name].get("toplevel", "")), usual) for name, usual in toplevels.items() if name in targets}
    for own, usual in sorted(found):
        if own != usual and closest(own, [usual]):
            faults.error(f"no target has the top level '{own}'", _place(file, own), f"did you mean '{usual}'?")


def _place(file: CoreFile, word: str) -> SourceRef:
    source = file.place_of(word)
    return replace(source, file=shown(Path(source.file)))


def _check_target(core: Any, target: str, faults: Diagnostics) -> None:
    """Note the faults of a target itself: unknown filesets, files and generator instances."""
    flags = {**core.get_flags(target), "target": target, "is_toplevel": True}
    known = {fault.source for fault in faults.found}
    found = Diagnostics()
    with found.noting():
        check_files(core, flags)
    with found.noting():
        any(calls_of(core, flags))
    for fault in found.found:
        # A target inherits the faults of another one.
        if fault.source not in known:
            faults.error(fault.message, fault.source, fault.hint)


def _calls(fusesoc: Any, core: Any, simulation: str, faults: Diagnostics) -> Iterator[GeneratorCall]:
    """Yield the calls of our generators for the simulation; note missing files of cores on this machine."""
    if simulation not in core.get_data({}).targets:
        return
    cores = solved(fusesoc, core, simulation)
    known = {name for item, flags in cores for name in item.get_generators(dict(flags))}
    for item, flags in cores:
        _check_present(item, flags, faults)
        for call in calls_of(item, flags):
            if call.generator not in known:
                _note_generator(fusesoc, item, call.generator, faults)
            elif call.generator in GENERATORS:
                yield call


def _note_generator(fusesoc: Any, core: Any, name: str, faults: Diagnostics) -> None:
    """Note that no core of a build has a generator, and the core that has it."""
    owners = {own: core_name(vlnv) for vlnv, found in fusesoc.get_generators().items() for own in found}
    hint = f"add '{owners[name]}' to 'depend' of a fileset" if name in owners else nearest(name, owners)
    faults.error(f"no core of this build has the generator '{name}'", core_place(core, name), hint)


def _check_present(core: Any, flags: Mapping[str, Any], faults: Diagnostics) -> None:
    folder = Path(core.files_root)
    for item in core.get_files(dict(flags)) if not core.provider else ():
        path = folder / item["name"]
        if not path.exists():
            place = core_place(core, item["name"])
            faults.error(f"there is no file {shown(path)}", place, nearest_file(path))


def _check_call(call: GeneratorCall, *, may_run: bool) -> None:
    """Raise `InputError` with the faults of a generator's call."""
    here = replace(call, files_root=shown(Path(call.files_root)))
    request = make_request(here, GENERATORS[call.generator].parameters, message_folders)
    if request.parameters.get("product") == "simulation":
        simulation_core.check(request, load_requested(request), may_run=may_run)
    elif call.generator != MESSAGES:
        GENERATORS[call.generator].load(request)
