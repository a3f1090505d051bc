"""Load a function from a user's Python file, and report exceptions at the lines of this file."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from fusesoc_firm.text.diagnostics import SourceRef, closest, fail, nearest

Function = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
"""A function in a user's text."""

TIME_LIMIT = 60.0
"""The most seconds for a call of a user's function, and for the statements of the file."""

_MODULE = "_user_code"
_OF_ROS = ("rclpy", "rospy", "roslib")
# An exception can be lost in code that catches all, so it is repeated after these seconds.
_AGAIN = 1.0
# Usual names of modules that are not the modules' own.
_ABBREVIATIONS = {"np": "numpy"}


@dataclass(frozen=True)
class UserFunction:
    """A function and its file; messages to the user call the function `what`, such as "the model"."""

    path: Path
    what: str
    call: Callable[..., Any]

    @contextmanager
    def guarded(self, when: str, messages: Sequence[Mapping[str, Any]] = ()) -> Iterator[None]:
        """Convert exceptions of the function within this context, and a lack of its end, to `InputError`.

        In the main thread, the function has `TIME_LIMIT` seconds. `when` names the occasion, and `messages` are the
        function's arguments, whose fields are suggested.
        """
        try:
            with _limited():
                yield
        except (Exception, SystemExit, _OverdueError) as error:  # noqa: BLE001 - the user's code may raise anything
            _fail_in(place_in(self.path, self._line()), self.what, error, f" for {when}", [*_names(messages)])

    def fail(self, message: str, hint: str = "", word: str = "") -> NoReturn:
        """Raise `InputError` for a fault in the function's result.

        The place is that of the key or else the string `word`, if the function has one of them; else the function's
        only `return` or `yield`; else the function's line.
        """
        fail(message, self._result_place(word), hint)

    def _result_place(self, word: str) -> SourceRef:
        nodes = [*_own_nodes(self.path, self._line())]
        words = [node for node in nodes if word and isinstance(node, ast.Constant) and node.value == word]
        keys = {id(key) for node in nodes if isinstance(node, ast.Dict) for key in node.keys}
        results = [node for node in nodes if isinstance(node, ast.Return | ast.Yield | ast.YieldFrom)]
        for found in ([item for item in words if id(item) in keys], words, results):
            if len(found) == 1:
                return place_of(self.path, found[0])
        return place_in(self.path, self._line())

    def _line(self) -> int:
        """Return the line of the function, or 1 if the file does not define the function."""
        call = inspect.unwrap(self.call)
        method = call if inspect.isroutine(call) else inspect.getattr_static(type(call), "__call__")
        code = getattr(method, "__code__", None)
        return code.co_firstlineno if code is not None and code.co_filename == str(self.path.absolute()) else 1


def load_function(path: Path, name: str, what: str, parameters: str, hint: str) -> UserFunction:
    """Load the function `name` of a file. May raise `InputError`; `parameters` and `hint` describe the correct form."""

    def run(module: ModuleType) -> None:
        loader = module.__spec__.loader if module.__spec__ else None
        assert loader is not None, "the module of a file has a loader"
        loader.exec_module(module)

    return _loaded(path, name, what, (parameters, hint), run)


@dataclass(frozen=True)
class Numbers:
    """The numbers of a compiled function: the type of its floats, if one is given, and its parameters.

    A parameter is the name of an attribute of the object that is called, a type and a value.
    """

    type: str = ""
    parameters: Sequence[tuple[str, str, float]] = ()


def load_compiled(
    path: Path, name: str, what: str, form: tuple[str, str], numbers: Numbers = Numbers()
) -> UserFunction:
    """Load the function of an accelerator that is compiled: it computes with the numbers of hardware.

    The `form` has the parameters and a hint, as those of `load_function`.
    """
    from fusesoc_firm.accelerator.hardware_numbers import typed_number

    function = _loaded(path, name, what, form, lambda module: _run_compiled(path, module, numbers.type))
    for attribute, type_, value in numbers.parameters:
        setattr(function.call, attribute, typed_number(type_, value, numbers.type))
    return function


class _OverdueError(BaseException):
    """The time of a user's code is over; code that catches `Exception` does not catch this."""


def _end(*_: object) -> NoReturn:
    raise _OverdueError


@contextmanager
def _limited() -> Iterator[None]:
    """Raise `_OverdueError` where this context is after `TIME_LIMIT` seconds, unless a context around it does so.

    Python handles signals in the main thread only: elsewhere, there is no limit.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGALRM) is _end:
        yield
        return
    before = signal.signal(signal.SIGALRM, _end)
    others = signal.setitimer(signal.ITIMER_REAL, TIME_LIMIT, _AGAIN)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, *others)


def _loaded(path: Path, name: str, what: str, form: tuple[str, str], run: Callable[[ModuleType], None]) -> UserFunction:
    """Return a function of a file; `run` runs the file as a module."""
    parameters, hint = form
    spec = importlib.util.spec_from_file_location(_MODULE, path.absolute())
    if spec is None or spec.loader is None or not path.is_file():
        fail_missing(path, f"{name}({parameters})", what, hint)
    module = importlib.util.module_from_spec(spec)
    # The module must be registered, since dataclasses, for example, look up their module.
    sys.modules[_MODULE] = module
    # Write no __pycache__ beside the user's file.
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        with _limited():
            run(module)
    except (Exception, SystemExit, _OverdueError) as error:  # noqa: BLE001 - the user's code may raise anything
        _fail_in(place_in(path, 1), what, error, "")
    finally:
        sys.dont_write_bytecode = writes
    function = getattr(module, name, None)
    if not callable(function):
        fail(f"{path} has no function '{name}({parameters})'", place_in(path, 1), hint)
    return UserFunction(path, what, function)


def _run_compiled(path: Path, module: ModuleType, numbers: str) -> None:
    """Run a file of a compiled accelerator as a module."""
    # NumPy is imported only if it is needed.
    from fusesoc_firm.accelerator.hardware_numbers import begin, prepared

    begin(module, numbers)
    tree = prepared(ast.parse(path.read_text(encoding="utf-8")), numbers)
    exec(compile(tree, str(path.absolute()), "exec"), vars(module))


def fail_missing(path: Path, function: str, what: str, hint: str) -> NoReturn:
    """Raise `InputError` for a missing file with this function."""
    near = closest(path.name, [item.name for item in path.parent.glob("*.py")])
    form = f"write a Python file (.py) with a function '{function}'; {hint}"
    fail(f"there is no {what.removeprefix('the ')} at {path}", hint=f"did you mean '{near}'?" if near else form)


def _fail_in(begin: SourceRef, what: str, error: BaseException, when: str, fields: Sequence[str] = ()) -> NoReturn:
    """Raise `InputError` at the line that caused an exception in the file of `begin`, or at `begin` if unknown."""
    path = Path(begin.file)
    text = f": {error}" if str(error) else ""
    message = f"{what} raised {type(error).__name__}{when}{text}"
    if isinstance(error, _OverdueError):
        message = f"{what} has not ended after {TIME_LIMIT:g} s{when}"
    if isinstance(error, SyntaxError) and error.filename == str(path.absolute()):
        line, column = error.lineno or 1, error.offset or 1
        fail(
            f"{what} is not valid Python: {error.msg}",
            SourceRef(str(path), line, column, (error.text or "").rstrip("\n")),
        )
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path.absolute())]
    hint = _cure(error, fields)
    if not frames:
        fail(message, begin, hint)
    fail(message, place_in(path, frames[-1].lineno or 1, (frames[-1].colno or 0) + 1), hint)


def _cure(error: BaseException, fields: Sequence[str]) -> str:
    """Return the cure of an exception that beginners cause, or an empty text; `fields` are those of the messages."""
    match error:
        case NameError(name=str(name)):
            module = _ABBREVIATIONS.get(name, name)
            if importlib.util.find_spec(module) is None:
                return ""
            return f"write 'import {module}{f' as {name}' if name != module else ''}' at the top of the file"
        case AttributeError(name=str(name), obj=dict()):
            return nearest(name, fields)
        case KeyError(args=[str(key)]) if fields:
            return nearest(key, fields)
        case ModuleNotFoundError(name=str(name)):
            return absent_module(name)
        case _OverdueError():
            return "if this is a loop, give it an end; it may also wait for something"
    return ""


def absent_module(name: str) -> str:
    """Return the cure of an import of a module that is not installed."""
    if name in _OF_ROS or name.endswith(("_msgs", "_interfaces")):
        return "messages are dictionaries here, without ROS: remove the import"
    return f"install '{name}' with pip"


def _names(value: object) -> Iterator[str]:
    """Yield the names of all fields in messages."""
    if isinstance(value, Mapping):
        yield from value
    for part in value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else ():
        yield from _names(part)


def _own_nodes(path: Path, line: int) -> Iterator[ast.expr | ast.stmt]:
    """Yield the statements and expressions of the function that begins in a line, without those of inner functions."""
    for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(function, Function) and _first_line(function) == line:
            yield from (node for node in nodes_of(function) if isinstance(node, ast.expr | ast.stmt))
            return


def nodes_of(function: Function) -> Iterator[ast.AST]:
    """Yield the nodes of a function's body in their order, without those of the functions and classes in it."""
    waiting: list[ast.AST] = [function.body] if isinstance(function, ast.Lambda) else [*function.body]
    while waiting:
        node = waiting.pop(0)
        yield node
        if not isinstance(node, Function | ast.ClassDef):
            waiting[:0] = ast.iter_child_nodes(node)


def _first_line(function: Function) -> int:
    """Return the line of a function as its code object has it: that of its first decorator."""
    decorators = [] if isinstance(function, ast.Lambda) else function.decorator_list
    return min([function.lineno, *(item.lineno for item in decorators)])


def place_of(path: Path, node: ast.expr | ast.stmt) -> SourceRef:
    """Return the place of a node in a user's file."""
    place = place_in(path, node.lineno)
    # The parser counts bytes of UTF-8.
    column = len(place.text.encode()[: node.col_offset].decode()) + 1
    return replace(place, column=column)


def place_in(path: Path, line: int, column: int = 1) -> SourceRef:
    """Return a place in a user's file."""
    lines = path.read_text(encoding="utf-8").split("\n")
    return SourceRef(str(path), line, column, lines[line - 1] if line <= len(lines) else "")
