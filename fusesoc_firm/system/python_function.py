"""An accelerator in software: a Python function that takes its messages and gives its answers.

    def mix(message0, message1):
        return {"x": message0["x"] + message1["x"], "y": 0.0, "z": 0.0}

Here its file is only read, never run.
"""

from __future__ import annotations

import ast
import keyword
from collections.abc import Iterator, Sequence
from pathlib import Path

from fusesoc_firm.diagnostics import Diagnostics, SourceRef
from fusesoc_firm.naming import identifier
from fusesoc_firm.system.derived import AcceleratorType

_KEYWORDS = frozenset(word.lower() for word in keyword.kwlist)


def function_name(type_: AcceleratorType) -> str:
    """The function: named after the accelerator."""
    return identifier(type_.accelerator.name, avoid=_KEYWORDS, suffix="function")


def parameter_names(type_: AcceleratorType) -> list[str]:
    """What the function's parameters could be called: one an input, in their order."""
    count = len(type_.inputs)
    return ["message"] if count == 1 else [f"message{number}" for number in range(count)]


def prototype(type_: AcceleratorType) -> str:
    """The function as it must be declared."""
    return f"def {function_name(type_)}({', '.join(parameter_names(type_))})"


def check_function(type_: AcceleratorType, path: Path, faults: Diagnostics) -> None:
    """Note what keeps the file at `path`, if it is there, from holding the function."""
    accelerator = type_.accelerator
    if not type_.inputs:
        message = f"'{accelerator.name}' takes no message, so nothing would call its function"
        hint = "without 'sources' it stands for software elsewhere, which sends when it likes"
        faults.error(message, accelerator.name.source, hint)
    if not path.is_file():
        return
    text = path.read_text(encoding="utf-8", errors="replace")
    lines = text.splitlines()
    try:
        found = _definition(ast.parse(text), function_name(type_))
    except SyntaxError as error:
        faults.error(f"this is not Python: {error.msg}", _place(path, lines, error.lineno or 1, error.offset or 1))
        return
    hint = f"expected: {prototype(type_)}"
    if found is None:
        place = accelerator.sources[0].source
        faults.error(f"'{accelerator.sources[0]}' has no function '{function_name(type_)}'", place, hint)
    elif isinstance(found, ast.FunctionDef) and not _takes(found.args, len(type_.inputs)):
        count = len(type_.inputs)
        message = f"'{found.name}' cannot be called with {count} message{'' if count == 1 else 's'}"
        faults.error(message, _place(path, lines, found.lineno, found.col_offset + 1), hint)


def _definition(module: ast.Module, name: str) -> ast.stmt | None:
    """The last statement of a module that gives something a name: the one that holds."""
    return next((found for found in reversed([*_statements(module.body)]) if name in _bound(found)), None)


def _statements(body: Sequence[ast.stmt]) -> Iterator[ast.stmt]:
    """All statements of a module's own scope, also those that hang on a condition."""
    for statement in body:
        yield statement
        for block in ("body", "orelse", "finalbody"):
            if isinstance(statement, ast.If | ast.Try | ast.With):
                yield from _statements(getattr(statement, block, ()))


def _bound(statement: ast.stmt) -> set[str]:
    """The names that a statement gives to something that may be called."""
    match statement:
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            return {name}
        case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
            return {alias.asname or alias.name for alias in aliases}
        case ast.Assign(targets=targets):
            return {target.id for target in targets if isinstance(target, ast.Name)}
        case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr()):
            return {name}
    return set()


def _takes(arguments: ast.arguments, count: int) -> bool:
    """Whether a function can be called with so many values by their order."""
    positional = len(arguments.posonlyargs) + len(arguments.args)
    fewest = positional - len(arguments.defaults)
    needs_keywords = None in arguments.kw_defaults
    return fewest <= count and (count <= positional or arguments.vararg is not None) and not needs_keywords


def _place(path: Path, lines: Sequence[str], line: int, column: int) -> SourceRef:
    return SourceRef(str(path), line, column, lines[line - 1] if line <= len(lines) else "")
