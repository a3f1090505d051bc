"""Derived System -> template configuration: the entity of an accelerator that is compiled from Python."""

from __future__ import annotations

from pathlib import Path

from fusesoc_firm.compiler.binding import bound
from fusesoc_firm.compiler.interface import side_of
from fusesoc_firm.compiler.kinds import KINDS
from fusesoc_firm.compiler.operators import table_files
from fusesoc_firm.compiler.program import Program, Task, compile_function
from fusesoc_firm.compiler.schedule import Schedule, scheduled
from fusesoc_firm.compiler.source import Source
from fusesoc_firm.compiler.writer import TEMPLATE, Writer
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.derived.python_function import function_name, shown_path
from fusesoc_firm.system.hardware.instances import declarations
from fusesoc_firm.system.written.specification import Resources
from fusesoc_firm.text.render import Rendering
from fusesoc_firm.text.yaml_sections import keys_of


def compiled(type_: AcceleratorType, folder: Path) -> Rendering:
    """Return the template and configuration of the entity. Raise `InputError` for a function that is not hardware."""
    writer = Writer(bound(schedule_of(type_, folder)))
    return Rendering(TEMPLATE, writer.configuration(type_.entity, declarations(type_), type_.width))


def compiler_files() -> list[Path]:
    """Return the files, beside the source, that determine the entity."""
    return [*table_files(), table_files()[0].with_name("model.py")]


def schedule_of(type_: AcceleratorType, folder: Path) -> Schedule:
    """Return the scheduled function of an accelerator. May raise `InputError`."""
    resources = type_.accelerator.resources
    names = [field for field, _ in keys_of(Resources).values()]
    limits = {name: count for name in names if resources and (count := getattr(resources, name))}
    return scheduled(program_of(type_, folder), limits)


def program_of(type_: AcceleratorType, folder: Path) -> Program:
    """Return the compiled function of an accelerator. May raise `InputError`."""
    path = type_.accelerator.sources[0]
    text = (folder / path).read_text(encoding="utf-8", errors="replace")
    numbers = KINDS[str(type_.accelerator.numbers)] if type_.accelerator.numbers else None
    inputs = [side_of(side.prefix, side.frame) for side in type_.inputs]
    outputs = [
        side_of(side.prefix, side.frame, *([side.length.source.value] if side.length else [])) for side in type_.outputs
    ]
    return compile_function(Task(Source(shown_path(path), text), function_name(type_), inputs, outputs, numbers))
