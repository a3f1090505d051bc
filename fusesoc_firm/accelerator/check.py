"""All accelerators of a system, read by GHDL, Yosys or `cpp`, and compared with their interfaces."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from fusesoc_firm.accelerator.cpp import lacks_function, read_function
from fusesoc_firm.accelerator.cpp_interface import compare_function
from fusesoc_firm.accelerator.instances import Instances
from fusesoc_firm.accelerator.interface import compare
from fusesoc_firm.accelerator.unit import Libraries, Reader
from fusesoc_firm.accelerator.verilog import VerilogReader
from fusesoc_firm.accelerator.vhdl import VhdlReader
from fusesoc_firm.converter.constants import CONSTANTS_TEMPLATE
from fusesoc_firm.system.derived.cpp_function import function_name, prototype
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.hardware.compiled import compiled
from fusesoc_firm.system.system_core import LoadedSystem, artifacts
from fusesoc_firm.system.written.specification import PYTHON
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics
from fusesoc_firm.tools.programs import find, ways
from fusesoc_firm.tools.yosys import Yosys

_PROGRAMS = {"VHDL": "ghdl", "Verilog": "yosys"}
# Messages of `compare`, and of GHDL.
_MISSING_PORT = re.compile(r" has no port '([^']+)'")
_UNDECLARED = re.compile(r"no declaration for \"([^\"]+)\"")
# The names of VHDL's standards in GHDL.
_STANDARDS = {93: "93", 2008: "08"}


def check_accelerators(loaded: LoadedSystem, libraries: Callable[[], Libraries]) -> tuple[Diagnostic, ...]:
    """Read the accelerators of a system and compare them with their interfaces; return the warnings.

    `libraries` returns the files that accelerators in VHDL may use. If a program is missing, a warning names the
    accelerators that were not read. Raise `InputError` with all faults.
    """
    faults = Diagnostics()
    with tempfile.TemporaryDirectory(prefix="firm_") as name:
        for language, program in _PROGRAMS.items():
            if not (types := _written_in(language, loaded)):
                continue
            if path := find(program):
                read = _reader(loaded, types, path, Path(name), libraries)
                for type_ in types:
                    _check(type_, loaded.folder, read, faults)
            else:
                names = ", ".join(str(type_.accelerator.name) for type_ in types)
                faults.warn(f"not read, since {program} is not installed: {names}", hint=ways(program))
    for type_ in _written_in(PYTHON, loaded):
        with faults.noting(type_.accelerator.sources[0].source):
            compiled(type_, loaded.folder)
    for type_ in _written_in("HLS", loaded):
        sources, name = type_.accelerator.sources, function_name(type_)
        if function := read_function(loaded.folder / sources[0], name):
            compare_function(type_, function, faults)
        elif all(lacks_function(path, name) for path in _sources(type_, loaded.folder)):
            faults.error(f"'{sources[0]}' has no function '{name}'", sources[0].source, f"expected: {prototype(type_)}")
    _without_consequences(faults).raise_if_any()
    return faults.warnings


def _without_consequences(faults: Diagnostics) -> Diagnostics:
    """Return the faults without the undeclared names that are missing ports."""
    ports = {found[1].lower() for fault in faults.found if (found := _MISSING_PORT.search(fault.message))}
    kept = Diagnostics()
    for fault in faults.found:
        undeclared = _UNDECLARED.search(fault.message)
        if undeclared is None or undeclared[1].lower() not in ports:
            kept.error(fault.message, fault.source, fault.hint)
    return kept


def _written_in(language: str, loaded: LoadedSystem) -> list[AcceleratorType]:
    """Return the accelerators in a language whose sources exist; `load_system` reports missing ones."""
    types = [item.own for item in loaded.system.accelerator_types if item.accelerator.type == language]
    return [type_ for type_ in types if all(path.is_file() for path in _sources(type_, loaded.folder))]


def _reader(
    loaded: LoadedSystem,
    types: Sequence[AcceleratorType],
    program: Path,
    folder: Path,
    libraries: Callable[[], Libraries],
) -> Reader:
    """Return the reader of accelerators in one language."""

    def complete() -> Libraries:
        generated = artifacts(loaded)
        packages = [item.text for item in generated if item.template == CONSTANTS_TEMPLATE]
        return replace(libraries(), packages=packages, generated={Path(item.path).stem for item in generated})

    sources = list(dict.fromkeys(path for type_ in types for path in _sources(type_, loaded.folder)))
    if types[0].accelerator.type == "VHDL":
        # GHDL has one standard for all files of a design.
        standard = _STANDARDS[max(type_.accelerator.vhdl_standard for type_ in types)]
        return VhdlReader(program, folder, complete, sources, standard).read
    ghdl = find("ghdl")
    entity = VhdlReader(ghdl, folder, complete, []).entity if ghdl else lambda *_: None
    return VerilogReader(Yosys(program, folder), Instances(complete, entity)).read


def _sources(type_: AcceleratorType, folder: Path) -> list[Path]:
    return [folder / source for source in type_.accelerator.sources]


def _check(type_: AcceleratorType, folder: Path, read: Reader, faults: Diagnostics) -> None:
    generics = ("width", "WIDTH") if type_.has_width else ()
    compare(type_, read(_sources(type_, folder), type_.entity, dict.fromkeys(generics, type_.width), faults), faults)
