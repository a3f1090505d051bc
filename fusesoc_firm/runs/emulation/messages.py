"""The stimuli and expected responses of an emulation, from a specification's core or from a command's options."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from fusesoc_firm.core.request import CoreFolders
from fusesoc_firm.message.library import libraries
from fusesoc_firm.runs.simulation.reference import responses
from fusesoc_firm.runs.simulation.software_run import Traffic, answered, system_stimuli, traffic
from fusesoc_firm.system.message_sources import MessageSources, core_of
from fusesoc_firm.system.scaffold.core_file import EMULATED
from fusesoc_firm.system.system_core import LoadedSystem, load_system, with_keys
from fusesoc_firm.text.diagnostics import fail


def load_emulated(spec: Path, sources: MessageSources, core_folders: CoreFolders) -> LoadedSystem:
    """Return the system of a specification as it is emulated: at the end of a UART. May raise `InputError`."""
    known = libraries(sources.paths, os.environ, sources.distro)
    return load_system(spec, known, changed=lambda written: with_keys(written, EMULATED), core_folders=core_folders)


def emulated_traffic(spec: Path, loaded: LoadedSystem, given: Mapping[str, Path | None]) -> Traffic:
    """Return the messages of the `given` stimuli and model, by default of those in the core beside the specification.

    May raise `InputError`.
    """
    core = core_of(spec)
    written = core.parameters("simulation") if core else {}
    files: dict[str, Path] = {}
    for name, path in given.items():
        if path:
            files[name] = path
        elif core and isinstance(value := written.get(name), str):
            files[name] = core.path.parent / value
        else:
            fail(f"no core beside {spec} names its {name}", hint=f"name them with --{name}")
    stimuli = system_stimuli(files["stimuli"], loaded)
    answers = responses(files["model"], stimuli, answered(loaded.system))
    return traffic(loaded.system, loaded.folder, stimuli, answers)
