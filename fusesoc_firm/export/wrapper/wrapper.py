"""Write a component as a module of a framework in Python: an instance of its netlist between streams and signals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path, PurePosixPath

from fusesoc_firm.export.component.model import Component, Direction, Generic, SourceFile
from fusesoc_firm.export.component.package import Package, write_files
from fusesoc_firm.export.wrapper.framework import FRAMEWORKS, Framework
from fusesoc_firm.export.wrapper.sides import capitalised, distinct, sides
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import write
from fusesoc_firm.text.quoting import python_string
from fusesoc_firm.text.render import Context, render

_VERILOG = ("verilogSource", "systemVerilogSource")
# Pins and clocks belong to the design around the wrapper.
_CONSTRAINTS = "xdc"
# Names of the frameworks that the templates use.
_USED = "ClockSignal In Instance Module Mux Out Path ResetSignal Signal".split()


def write_wrapper(package: Package, framework: str, folder: Path) -> list[Path]:
    """Write a component's module for a framework, and its files in Verilog; return the paths, that of the module first.

    May raise `InputError`.
    """
    text = wrapper(package.component, framework)
    module = folder / f"{package.component.name}.py"
    files = [file.path for file in _verilog(package.component.files)]
    write_files({path: package.places[path] for path in files}, folder)
    write(module, text)
    return [module, *(folder / path for path in files)]


def wrapper(component: Component, framework: str) -> str:
    """Return the text of a component's module. Raise `InputError` if a wrapper has no place for a port or a file."""
    for port in component.ports:
        if port.direction is Direction.INOUT:
            hint = "name a target without pins of a board"
            fail(f"port '{port.name}' of '{component.name}' is bidirectional, which no wrapper passes on", hint=hint)
    context = _context(component, FRAMEWORKS[framework], _verilog(component.files))
    return render(f"wrapper/{framework}.py", context)


def _verilog(files: Sequence[SourceFile]) -> list[SourceFile]:
    found = [file for file in files if file.type != _CONSTRAINTS]
    for file in found:
        if not file.type.startswith(_VERILOG):
            fail(f"{file.path} is not in Verilog, of which a wrapper consists", hint="move its content into a module")
    return found


def _context(component: Component, framework: Framework, files: Sequence[SourceFile]) -> Context:
    sources = [file.path for file in files if not file.is_include_file]
    included = [file.path for file in files if file.is_include_file]
    return {
        "core": ":".join([component.vendor, component.library, component.name, component.version]),
        "unit": component.name,
        "class": next(distinct([capitalised(component.name)], _USED)),
        "description": component.description,
        "sources": _texts(sources),
        "included": _texts(included),
        "include_folders": _texts(dict.fromkeys(path.parent for path in included)),
        "parameters": [{"name": generic.name, "value": _value(generic)} for generic in component.generics],
        **sides(component, framework).context(),
    }


def _texts(paths: Iterable[PurePosixPath]) -> list[str]:
    return [str(path) for path in paths]


def _value(generic: Generic) -> str:
    return python_string(generic.value) if isinstance(generic.value, str) else str(generic.value)
