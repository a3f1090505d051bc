"""Derived System -> template configuration: the entity of an accelerator that is compiled from Python."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

from fusesoc_firm.compiler.binding import bound
from fusesoc_firm.compiler.interface import side_of
from fusesoc_firm.compiler.kinds import KINDS, kind_named
from fusesoc_firm.compiler.models import model_files
from fusesoc_firm.compiler.operators import table_files
from fusesoc_firm.compiler.program import Program, Setting, Task, compile_function
from fusesoc_firm.compiler.schedule import RELEASE, Schedule
from fusesoc_firm.compiler.source import Source
from fusesoc_firm.compiler.writer import TEMPLATE, Writer
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.derived.python_function import function_name, shown_path
from fusesoc_firm.system.hardware.instances import declarations, parameter_declarations
from fusesoc_firm.system.hardware.limits import (
    LATENCY,
    BudgetError,
    LimitError,
    Limits,
    fastest_of_budget,
    fastest_within,
)
from fusesoc_firm.system.written.specification import BUDGETS, Resources
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.render import Rendering
from fusesoc_firm.text.yaml_sections import keys_of


def compiled(type_: AcceleratorType, folder: Path) -> Rendering:
    """Return the template and configuration of the entity. Raise `InputError` for a function that is not hardware."""
    return entity_of(type_, schedule_of(type_, folder))


def entity_of(type_: AcceleratorType, schedule: Schedule) -> Rendering:
    """Return the template and configuration of an accelerator's entity with a schedule of its function."""
    writer = Writer(bound(schedule))
    ports = [*declarations(type_), *parameter_declarations(type_)]
    return Rendering(TEMPLATE, writer.configuration(type_.entity, ports, type_.width))


def compiler_files() -> list[Path]:
    """Return the files, beside the source, that determine the entity."""
    return [*table_files(), *model_files()]


def schedule_of(type_: AcceleratorType, folder: Path, numbers: str = "") -> Schedule:
    """Return the scheduled function of an accelerator, whose floats have the type `numbers`, if it is given.

    Raise `InputError` for a limit that the function cannot meet, too.
    """
    program, limits = program_of(type_, folder, numbers), _limits(type_)
    try:
        if not budget_of(type_):
            return fastest_within(program, resources_of(type_), limits)
        found = _of_budget(type_, program)
        limits.check(found)
        return found
    except LimitError as error:
        _refuse_limit(type_, error)


def _limits(type_: AcceleratorType) -> Limits:
    """Return the limits of an accelerator; that of the interval is one of the latency, too."""
    accelerator = type_.accelerator
    given = [accelerator.latency, accelerator.interval and accelerator.interval - RELEASE]
    return Limits(min((item for item in given if item is not None), default=None), accelerator.element)


def resources_of(type_: AcceleratorType) -> dict[str, int]:
    """Return the numbers of operators that the specification gives."""
    return {name: count for name, count in _given(type_).items() if name not in BUDGETS}


def budget_of(type_: AcceleratorType) -> dict[str, int]:
    """Return the cells to which the specification limits an accelerator."""
    return {name: count for name, count in _given(type_).items() if name in BUDGETS}


def _given(type_: AcceleratorType) -> dict[str, int]:
    resources = type_.accelerator.resources
    names = [field for field, _ in keys_of(Resources).values()]
    return {name: count for name in names if resources and (count := getattr(resources, name)) is not None}


def _of_budget(type_: AcceleratorType, program: Program) -> Schedule:
    budget, resources = budget_of(type_), type_.accelerator.resources
    try:
        return fastest_of_budget(program, resources_of(type_), budget)
    except BudgetError as error:
        name = next(name for name, most in budget.items() if error.least[name] > most)
        message = f"'{type_.accelerator.name}' is larger than the {budget[name]} of '{name}'"
        assert resources
        fail(message, resources.place(name), f"legal here: at least {error.least[name]}, as estimated")


def _refuse_limit(type_: AcceleratorType, error: LimitError) -> NoReturn:
    accelerator, key, cycles = type_.accelerator, error.name, error.cycles
    if key == LATENCY and (accelerator.latency is None or cycles <= accelerator.latency):
        key, cycles = "interval", cycles + RELEASE
    given = ", ".join(f"{name}: {count}" for name, count in _given(type_).items())
    within = f" with 'resources: {{{given}}}'" if given else ""
    message = f"'{key}' of '{accelerator.name}' cannot be {getattr(accelerator, key)}{within}"
    fail(message, accelerator.place(key), f"legal here: {cycles} cycles or more")


def program_of(type_: AcceleratorType, folder: Path, numbers: str = "") -> Program:
    """Return the compiled function of an accelerator, whose floats have the type `numbers`, if it is given.

    May raise `InputError`.
    """
    path = type_.accelerator.sources[0]
    text = (folder / path).read_text(encoding="utf-8", errors="replace")
    floats = kind_named(numbers or str(type_.accelerator.numbers))
    inputs = [side_of(side.prefix, side.frame) for side in type_.inputs]
    outputs = [
        side_of(side.prefix, side.frame, *([side.length.source.value] if side.length else [])) for side in type_.outputs
    ]
    settings = [
        Setting(item.name, type_.parameter_port(item), KINDS[item.type.name], item.default, item.least, item.most)
        for item in type_.parameters
    ]
    source = Source(shown_path(path), text)
    return compile_function(Task(source, function_name(type_), inputs, outputs, floats, settings))
