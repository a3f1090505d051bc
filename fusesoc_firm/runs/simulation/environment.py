"""The environment at a system's pins in its simulation: the user's VHDL, such as motors driven by a PWM output."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from fusesoc_firm.core.request import GeneratedFile
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.written.specification import SOURCE_SUFFIXES
from fusesoc_firm.text.diagnostics import SourceRef, fail
from fusesoc_firm.text.naming import identifier


def environment_files(
    paths: Mapping[Path, SourceRef | None], system: DerivedSystem
) -> dict[PurePosixPath, GeneratedFile]:
    """Return the environment's files by path in the simulation core, in order.

    The test bench instantiates the entity that has the name of the last file. Raise `InputError` for a file that cannot
    be part of the environment.
    """
    taken = {
        system.entity,
        f"{system.entity}_tb",
        f"{system.entity}_live",
        *(item.entity for item in system.accelerator_types),
        *(item.own.entity for item in system.accelerator_types),
    }
    files: dict[PurePosixPath, GeneratedFile] = {}
    for path, source in paths.items():
        if not any(block.type.accelerator.pins for block in system.accelerators):
            fail(f"system '{system.name}' has no pins, so it cannot have an environment", source)
        if not path.is_file():
            fail(f"there is no file '{path}'", source, "the paths of 'environment' are relative to the core")
        if path.suffix.lower() not in SOURCE_SUFFIXES["VHDL"] or identifier(path.stem) != path.stem:
            fail(f"'{path.name}' is not a legal file name for a VHDL entity", source, "a legal name is motors.vhd")
        if path.stem.lower() in {entity.lower() for entity in taken}:
            fail(f"the system already has an entity '{path.stem}'; rename the environment", source)
        files[PurePosixPath("environment", path.name)] = GeneratedFile(path.read_bytes(), "vhdlSource-93")
    return files
