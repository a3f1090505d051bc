"""Every statement that reports a fault in a specification is reached by a bad specification in `tests/errors/spec`."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import pytest

from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from tests.errors.conftest import make_libraries
from tests.errors.test_spec_errors import SPECIFICATIONS, derive_file

PACKAGE = Path(sys.modules["fusesoc_firm"].__path__[0])
# The modules that read and check a specification.
BESIDE = """
    text/yaml_text.py text/yaml_sections.py frame/select.py message/library.py
""".split()
SOURCES = (*sorted((PACKAGE / "system").rglob("*.py")), *(PACKAGE / name for name in BESIDE))
# The calls that report faults, and functions that report faults outside the specification's text.
NOTING_METHODS, NOTING_FUNCTIONS = ("error", "_error", "take"), ("fail", "InputError")
OTHER_FAULTS = {
    ("system/views/diagram.py", "diagram"): "a program or package that is not installed",
    ("message/library.py", "libraries"): "an option of the command line",
    ("message/library.py", "_content"): "a message that is no file, in test_hostile_input",
    ("message/library.py", "_note_depth"): "a message of 65 files, in test_hostile_input",
    ("message/library.py", "_bag"): "the file of a bag",
    ("message/library.py", "_check_equal"): "the file of a bag",
    ("system/boards/board.py", "read_board"): "the file of a board",
    ("system/boards/board.py", "_check_keys"): "the file of a board",
    ("system/boards/board.py", "_check_pins"): "the file of a board",
    ("system/boards/board.py", "_check_ports"): "the file of a board",
    ("system/boards/board.py", "_pll"): "the file of a board",
    ("system/boards/board.py", "_check_streams"): "the file of a board",
    ("system/boards/board.py", "check_fits"): "a board that a right specification does not fit on",
    ("system/boards/board.py", "_check_places"): "a board that a right specification does not fit on",
    ("system/boards/overlay.py", "bring_up_files"): "options of the command line",
    ("system/boards/overlay.py", "check_runs_linux"): "an option of the command line",
    ("system/scaffold/core_file.py", "new_core"): "an option of the command line",
    ("system/scaffold/core_file.py", "updated_core"): "the file of a core",
    ("system/scaffold/project.py", "create"): "options of the command line",
    ("system/scaffold/project.py", "new_folder"): "options of the command line",
    ("system/scaffold/project.py", "_check_bench"): "options of the command line",
    ("system/scaffold/project.py", "_check_topics"): "options of the command line",
    ("system/scaffold/example.py", "example_named"): "options of the command line",
    ("system/scaffold/wizard.py", "extend_specification"): "a file that is extended, in test_wizard",
    ("system/message_sources.py", "check_specs_of"): "the file of a core",
    ("system/system_core.py", "load_requested"): "the file of a core",
    ("system/register_files.py", "write_register_files"): "a right specification without a status",
    ("system/hardware/compiled.py", "_of_budget"): "the function of an accelerator, in tests/system/test_limits.py",
    ("system/hardware/compiled.py", "_refuse_limit"): "the function of an accelerator, in tests/system/test_limits.py",
    (
        "system/derived/parameters.py",
        "check_number",
    ): "a system of 1,025 parameters, in tests/system/test_parameters.py",
    ("system/derived/status.py", "_check_id"): "a system of 256 converters, in test_status",
    ("system/derived/status.py", "_check_channels"): "a system of 4,097 converters, in test_status",
    ("system/derived/timing.py", "tasks_of"): "a question that a right specification does not answer",
}


@dataclass(frozen=True)
class Rule:
    """A call that reports a fault: the file below the package, the function, the lines of the call."""

    file: str
    function: str
    lines: range

    def __str__(self) -> str:
        return f"{self.file}:{self.lines[0]} in {self.function}"


def rules() -> list[Rule]:
    return [rule for path in SOURCES for rule in _rules(path) if (rule.file, rule.function) not in OTHER_FAULTS]


def _rules(path: Path) -> Iterator[Rule]:
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    for function in (node for node in nodes if isinstance(node, ast.FunctionDef)):
        for call in ast.walk(function):
            if isinstance(call, ast.Call) and _notes(call.func):
                lines = range(call.lineno, (call.end_lineno or call.lineno) + 1)
                yield Rule(path.relative_to(PACKAGE).as_posix(), function.name, lines)


def _notes(function: ast.expr) -> bool:
    if isinstance(function, ast.Attribute):
        return function.attr in NOTING_METHODS
    return isinstance(function, ast.Name) and function.id in NOTING_FUNCTIONS


@pytest.fixture
def reached(monkeypatch: pytest.MonkeyPatch) -> set[tuple[str, int]]:
    """The lines that were active when a fault was reported: files below the package, and lines."""
    found: set[tuple[str, int]] = set()

    def watched(method: Callable[..., None], self: object, *arguments: object) -> None:
        frame: FrameType | None = sys._getframe(2)
        while frame is not None:
            path = Path(frame.f_code.co_filename)
            if path.is_relative_to(PACKAGE):
                found.add((path.relative_to(PACKAGE).as_posix(), frame.f_lineno))
            frame = frame.f_back
        method(self, *arguments)

    for owner, name in ((Diagnostics, "error"), (InputError, "__init__")):
        method = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda self, *arguments, method=method: watched(method, self, *arguments))
    return found


def test_every_rule_has_a_bad_specification(reached: set[tuple[str, int]], monkeypatch: pytest.MonkeyPatch) -> None:
    # New libraries, since a library reports the faults of a file when it first reads it.
    libraries = make_libraries()
    for path in SPECIFICATIONS:
        with pytest.raises(InputError):
            derive_file(path, libraries, monkeypatch)
    idle = [str(rule) for rule in rules() if not any((rule.file, line) in reached for line in rule.lines)]
    assert not idle, "no specification in tests/errors/spec has these faults:\n" + "\n".join(idle)


def test_every_exception_is_still_there() -> None:
    functions = {(rule.file, rule.function) for path in SOURCES for rule in _rules(path)}
    assert OTHER_FAULTS.keys() <= functions
