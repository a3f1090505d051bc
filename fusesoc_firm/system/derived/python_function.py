"""An accelerator in software: a Python function that receives messages and returns responses.

    def mix(message0, message1):
        return {"x": message0["x"] + message1["x"], "y": 0.0, "z": 0.0}

This module only reads the file and never runs the function.
"""

from __future__ import annotations

import ast
import keyword
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.written.specification import SOFTWARE, SOURCE_SUFFIXES
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, closest
from fusesoc_firm.text.files import is_file
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.yaml_text import Text

_KEYWORDS = frozenset(word.lower() for word in keyword.kwlist)


def function_name(type_: AcceleratorType) -> str:
    """Return the function's name, which is the name of the accelerator."""
    return identifier(type_.accelerator.name, avoid=_KEYWORDS, suffix="function")


def parameter_names(type_: AcceleratorType) -> list[str]:
    """Return suggested names for the function's parameters, one for each input, in order."""
    count = len(type_.inputs)
    return ["message"] if count == 1 else [f"message{number}" for number in range(count)]


def prototype(type_: AcceleratorType) -> str:
    """Return the required declaration of the function."""
    return f"def {function_name(type_)}({', '.join(parameter_names(type_))})"


def check_function(type_: AcceleratorType, path: Path, faults: Diagnostics) -> None:
    """Note faults in the function, whose file at `path` is the first source; the file may be missing."""
    accelerator = type_.accelerator
    if not type_.inputs:
        message = f"'{accelerator.name}' takes no messages, so its function would never be called"
        hint = "without 'sources', the accelerator represents external software, which can send at any time"
        faults.error(message, accelerator.name.source, hint)
        return
    if not is_file(path) or path.suffix.lower() not in SOURCE_SUFFIXES[SOFTWARE]:
        return
    source = accelerator.sources[0]
    file = _File(shown_path(source), path.read_text(encoding="utf-8", errors="replace"))
    hint = f"expected: {prototype(type_)}"
    try:
        module = ast.parse(file.text)
        found = definition(module, function_name(type_))
    except (SyntaxError, ValueError) as error:
        line, column = (error.lineno, error.offset) if isinstance(error, SyntaxError) else (1, 1)
        faults.error(
            f"the file is not valid Python: {getattr(error, 'msg', error)}", file.place(line or 1, column or 1)
        )
        return
    if found is None:
        near = closest(function_name(type_), [item.name for item in module.body if isinstance(item, ast.FunctionDef)])
        renamed = f"rename '{near}' to '{function_name(type_)}'; " if near else ""
        classes = [item.name for item in module.body if isinstance(item, ast.ClassDef)]
        if same := [name for name in classes if name.lower() == function_name(type_).replace("_", "").lower()]:
            renamed = f"construct the object: {function_name(type_)} = {same[0]}(); "
        faults.error(f"'{source}' has no function '{function_name(type_)}'", source.source, renamed + hint)
    elif isinstance(found, ast.FunctionDef) and not takes(found.args, len(type_.inputs)):
        count = len(type_.inputs)
        message = f"'{found.name}' cannot be called with {count} message{'' if count == 1 else 's'}"
        faults.error(message, file.place(found.lineno, found.col_offset + 1), hint)
    elif isinstance(found, ast.FunctionDef):
        for node, message, cure in body_faults(found, has_result=bool(type_.outputs)):
            faults.error(message, file.place(node.lineno, node.col_offset + 1), cure)


def body_faults(function: ast.FunctionDef, *, has_result: bool) -> Iterator[tuple[ast.FunctionDef, str, str]]:
    """Yield the faults in a function's body, each with its node and its cure.

    A function that only raises an exception, or is only '...', is unfinished.
    """
    if all(isinstance(item, ast.Expr) and isinstance(item.value, ast.Constant) for item in function.body):
        return
    is_ended = any(isinstance(node, ast.Return | ast.Yield | ast.YieldFrom | ast.Raise) for node in ast.walk(function))
    if has_result and not is_ended:
        yield function, f"'{function.name}' returns nothing", "end it with 'return answer', where answer is a message"


def shown_path(source: Text) -> str:
    """Return the path of a source, relative to the specification."""
    return str(Path(source.source.file).parent / source) if source.source else str(source)


@dataclass(frozen=True)
class _File:
    """The text of a source, with its name in messages."""

    name: str
    text: str

    def place(self, line: int, column: int) -> SourceRef:
        """Return a place in the file."""
        lines = self.text.split("\n")
        return SourceRef(self.name, line, column, lines[line - 1] if line <= len(lines) else "")


def definition(module: ast.Module, name: str) -> ast.stmt | None:
    """Return the last statement of a module that binds a name, since this statement determines the name's value."""
    return next((found for found in reversed([*_statements(module.body)]) if name in _bound(found)), None)


def _statements(body: Sequence[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield all statements in a module's scope, including conditional statements."""
    for statement in body:
        yield statement
        for block in ("body", "orelse", "finalbody"):
            if isinstance(statement, ast.If | ast.Try | ast.With):
                yield from _statements(getattr(statement, block, ()))


def _bound(statement: ast.stmt) -> set[str]:
    """Return the names that a statement binds to a possibly callable object."""
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


def takes(arguments: ast.arguments, count: int) -> bool:
    """Return whether a function can be called with this number of positional arguments."""
    positional = len(arguments.posonlyargs) + len(arguments.args)
    fewest = positional - len(arguments.defaults)
    needs_keywords = None in arguments.kw_defaults
    return fewest <= count and (count <= positional or arguments.vararg is not None) and not needs_keywords
