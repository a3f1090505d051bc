"""Check the text of a model without running it: its function, its imports, and what its answers show as written.

An answer is known as far as it consists of literals: the name of a publisher, and the fields of a message that is not
changed afterwards. All else is checked when the model runs.
"""

from __future__ import annotations

import ast
import importlib.util
import os
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.accelerator.user_code import absent_module, fail_missing, nodes_of, place_in, place_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.runs.simulation.reference import ANSWER, NAME, PARAMETERS
from fusesoc_firm.system.derived.python_function import body_faults, definition, takes
from fusesoc_firm.text.diagnostics import Diagnostics, closest, nearest

# With another Python, other packages are installed.
_OTHER_PYTHON = "FUSESOC_FIRM_PYTHON"
_FORM = f"{NAME}({', '.join(PARAMETERS)})"


def check_model(path: Path, frames: Mapping[str, Frame], names: Collection[str], faults: Diagnostics) -> None:
    """Note the faults in the text of a model that may answer with these frames; hints contain only the `names`.

    Raise `InputError` for a missing file.
    """
    if path.suffix != ".py" or not path.is_file():
        fail_missing(path, _FORM, "the model", ANSWER)
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        module = ast.parse(text)
    except (SyntaxError, ValueError) as error:
        line, column = (error.lineno, error.offset) if isinstance(error, SyntaxError) else (1, 1)
        message = f"the model is not valid Python: {getattr(error, 'msg', error)}"
        faults.error(message, place_in(path, line or 1, column or 1))
        return
    if _OTHER_PYTHON not in os.environ and "sys.path" not in text:
        _check_imports(module, path, faults)
    function = definition(module, NAME)
    if function is None:
        _note_missing(module, path, faults)
    elif isinstance(function, ast.FunctionDef):
        _Answers(path, function, frames, names, faults).check()


def _note_missing(module: ast.Module, path: Path, faults: Diagnostics) -> None:
    """Note that the function is missing, at the place of a function with a similar name."""
    functions = {item.name: item for item in module.body if isinstance(item, ast.FunctionDef)}
    near = closest(NAME, functions)
    place = place_in(path, functions[near].lineno if near else 1)
    faults.error(f"{path} has no function '{_FORM}'", place, f"rename '{near}' to '{NAME}'" if near else ANSWER)


def _check_imports(module: ast.Module, path: Path, faults: Diagnostics) -> None:
    """Note the modules that the model imports at its beginning, and that do not exist."""
    for statement in module.body:
        match statement:
            case ast.Import(names=aliases):
                imported = [alias.name for alias in aliases]
            case ast.ImportFrom(module=str(name), level=0):
                imported = [name]
            case _:
                continue
        for name in (item.partition(".")[0] for item in imported):
            beside = (path.parent / name, path.parent / f"{name}.py")
            if importlib.util.find_spec(name) is None and not any(map(Path.exists, beside)):
                message = f"the model imports '{name}', which is not installed"
                faults.error(message, place_of(path, statement), absent_module(name))


@dataclass(frozen=True)
class _Answers:
    """The answers of a model's function, as written."""

    path: Path
    function: ast.FunctionDef
    frames: Mapping[str, Frame]
    names: Collection[str]
    faults: Diagnostics

    def check(self) -> None:
        """Note the faults of the function and of its answers."""
        if not takes(self.function.args, len(PARAMETERS)):
            own = f"{NAME}({ast.unparse(self.function.args)})"
            self._note(f"'{NAME}' is called as '{_FORM}', but is defined as '{own}'", self.function)
        for node, message, cure in body_faults(self.function, has_result=True):
            self._note(message, node, ANSWER if node is self.function else cure)
        for value in self._values():
            self._check_value(value)

    def _values(self) -> Iterator[ast.expr]:
        """Yield the values that the function returns, and lists with the values that it yields."""
        for node in nodes_of(self.function):
            match node:
                case ast.Return(value=ast.expr() as value) | ast.YieldFrom(value=value):
                    yield value
                case ast.Yield(value=ast.expr() as value):
                    yield ast.List([value], ast.Load())

    def _check_value(self, value: ast.expr) -> None:
        match value:
            case ast.Tuple(elts=[ast.Constant(value=str()), _]):
                self._note(f"'{NAME}' returns one response, not a list", value, f"write [{ast.unparse(value)}]")
                return
        match self._literal(value):
            case ast.Dict() | ast.Constant(value=int() | float() | None) as literal:
                self._note(f"'{NAME}' returns {ast.unparse(literal)}, which is not a list", value, ANSWER)
        for item in _items(value):
            self._check_item(item)

    def _check_item(self, item: ast.expr) -> None:
        match item:
            case (
                ast.Tuple(elts=[ast.Constant(value=name) as word, message])
                | ast.List(elts=[ast.Constant(value=name) as word, message])
            ):
                if not isinstance(name, str) or name not in self.frames:
                    fault = f"'{NAME}' returns a message for {name!r}, which is not a publisher"
                    self._note(fault, word, nearest(str(name), self.names))
                elif (fields := self._fields(message)) is not None:
                    self._check_fields(name, fields, item)
            case ast.Constant() | ast.Dict():
                self._note(f"'{NAME}' returns a list that contains {ast.unparse(item)}", item, ANSWER)

    def _check_fields(self, name: str, given: Collection[str], item: ast.expr) -> None:
        frame = self.frames[name]
        for field in given:
            if frame.names and field not in frame.names:
                message = f"'{NAME}' returns an invalid message for '{name}': {frame.message} has no field '{field}'"
                self._note(message, item, nearest(field, frame.names))

    def _fields(self, message: ast.expr) -> Collection[str] | None:
        """Return the fields of a message that is a literal, or the name of an unchanged literal; else None."""
        if isinstance(message, ast.Name):
            # The name is bound once, and used once: nothing else changes the message.
            if len(self._uses(message.id)) != 2:
                return None
            message = self._literal(message)
        if not isinstance(message, ast.Dict):
            return None
        keys = [key.value for key in message.keys if isinstance(key, ast.Constant) and isinstance(key.value, str)]
        return keys if len(keys) == len(message.keys) else None

    def _literal(self, value: ast.expr) -> ast.expr:
        """Return the only value that is bound to a name, or else the expression itself."""
        if not isinstance(value, ast.Name):
            return value
        uses = self._uses(value.id)
        found = [
            node.value
            for node in nodes_of(self.function)
            if isinstance(node, ast.Assign) and any(target in uses for target in node.targets)
        ]
        is_bound_once = sum(isinstance(node.ctx, ast.Store) for node in uses) == 1
        return found[0] if len(found) == 1 and is_bound_once else value

    def _uses(self, name: str) -> list[ast.Name]:
        return [node for node in ast.walk(self.function) if isinstance(node, ast.Name) and node.id == name]

    def _note(self, message: str, node: ast.expr | ast.FunctionDef, hint: str = "") -> None:
        self.faults.error(message, place_of(self.path, node), hint)


def _items(value: ast.expr) -> Iterator[ast.expr]:
    """Yield the items of a list, as far as they are written in it."""
    match value:
        case ast.List(elts=items) | ast.Tuple(elts=items):
            yield from items
        case ast.ListComp(elt=item) | ast.GeneratorExp(elt=item):
            yield item
        case ast.IfExp(body=one, orelse=other) | ast.BinOp(left=one, op=ast.Add(), right=other):
            yield from (*_items(one), *_items(other))
