"""Imports between the rooms of the package go one way, as docs/architecture.md says."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "fusesoc_firm"

_WORDS = {"diagnostics", "naming"}
# Plain data that says how a middleware serialises.
_WIRE = _WORDS | {"wire"}
_MESSAGE = _WIRE | {"message", "reads"}
_FRAME = _MESSAGE | {"frame"}
# What every stage that makes files may use: it knows no stage.
_WRITING = {"generation", "quoting", "render"}
# What every stage that reads a file of the user may use.
_READING = {"yaml_text", "yaml_sections"}
_CONVERTER = _FRAME | _WRITING | _READING | {"converter"}
_SYSTEM = _CONVERTER | {"system"}

# Each room, and the rooms that it may import from beside itself.
ALLOWED: dict[str, set[str]] = {
    "diagnostics": set(),
    "naming": set(),
    "wire": set(),
    # It reads bags in part.
    "message": _WIRE | {"files", "reads"},
    "frame": _MESSAGE,
    "converter": _FRAME | _WRITING | _READING,
    # It knows requesters, not systems.
    "scheduling": {"diagnostics", "outputs", "workers"},
    "system": _CONVERTER | {"files", "outputs", "prompts", "scheduling"},
    # It builds simulators of systems, by FuseSoC and with the library.
    "host": _SYSTEM | {"files", "interrupts", "library_path", "outputs", "store_files", "tools"},
    "replay": _SYSTEM | {"host"},
    # The cores of its bench lie in the library.
    "verify": _SYSTEM | {"library_path", "outputs", "workers"},
    # Edalize's tool runs it beside a build, which knows files and no systems.
    "netlist": {"launcher", "manifest", "naming", "tools"},
    "quoting": set(),
    "render": {"quoting"},
    "own_code": {"render"},
    "files": set(),
    "outputs": {"diagnostics"},
    "pictures": {"diagnostics", "outputs"},
    "interrupts": set(),
    "reads": {"own_code"},
    "shared_files": {"files"},
    "store_files": {"shared_files"},
    "message_runs": {"files"},
    "design_units": {"files"},
    "recall": {"design_units", "files", "message_runs", "own_code", "store_files"},
    "message_core": _MESSAGE | {"generation", "message_runs"},
    "why": _SYSTEM,
    "lock": _SYSTEM | {"files", "project", "tools"},
    "project": {"diagnostics", "render", "yaml_text"},
    # It knows FuseSoC, and generators only as FuseSoC calls them.
    "building": {"diagnostics", "generation", "workers"},
    "store": {"diagnostics", "files", "recall", "shared_files", "store_files"},
    "library_path": set(),
    "workers": {"diagnostics"},
    "tools": {"own_code"},
    "manifest": {"tools"},
    "launcher": {"diagnostics", "interrupts", "manifest", "tools"},
    "yaml_text": {"diagnostics", "files"},
    "yaml_sections": _WORDS | {"yaml_text"},
    "yaml_schema": {"yaml_sections"},
    "prompts": {"diagnostics"},
    "generation": {"diagnostics"},
    "requesting_core": {"diagnostics", "yaml_text"},
    "parameters": _WORDS | {"generation", "requesting_core"},
}
# The doors join the stages; __init__ holds the version.
DOORS = {"gapi", "batch", "cli"}
_PREFIX = "fusesoc_firm"
# Links to cores and demo systems.
LIBRARIES = {"library", "demos"}


def modules(package: Path) -> Iterator[Path]:
    return (path for path in sorted(package.rglob("*.py")) if room_of(path, package) not in LIBRARIES)


def room_of(path: Path, package: Path) -> str:
    return path.relative_to(package).parts[0].removesuffix(".py")


def imported_rooms(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """The line and room of each import from the package; a relative import counts as room '.'."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level:
            yield node.lineno, "."
            continue
        elif isinstance(node, ast.ImportFrom) and node.module == _PREFIX:
            names = [f"{_PREFIX}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        else:
            continue
        for name in names:
            if name.split(".")[0] == _PREFIX:
                yield node.lineno, [*name.split("."), ""][1]


def violations(package: Path) -> Iterator[str]:
    for path in modules(package):
        room = room_of(path, package)
        if room in DOORS or room == "__init__":
            continue
        if room not in ALLOWED:
            yield f"{path}:1: '{room}' is no room of docs/architecture.md"
            continue
        for line, imported in imported_rooms(ast.parse(path.read_text())):
            # `from fusesoc_firm import __version__` names the package itself.
            if imported not in ALLOWED[room] | {room, "__version__"}:
                yield f"{path}:{line}: '{room}' may not import '{imported}'"


def test_imports_go_one_way() -> None:
    found = list(violations(PACKAGE))
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "statement",
    [
        "from fusesoc_firm.system import spec",
        "from fusesoc_firm import gapi",
        "import fusesoc_firm.cli",
        "def f():\n    from fusesoc_firm.converter.config import x",
        "from ..frame import model",
        "if TYPE_CHECKING:\n    import fusesoc_firm",
    ],
)
def test_the_rule_is_enforced(tmp_path: Path, statement: str) -> None:
    package = tmp_path / "fusesoc_firm"
    (package / "message").mkdir(parents=True)
    (package / "message" / "parser.py").write_text(f"from fusesoc_firm.naming import identifier\n{statement}\n")
    (found,) = violations(package)
    assert f"parser.py:{2 + statement.count(chr(10))}: 'message' may not import" in found


def test_a_new_room_must_be_announced(tmp_path: Path) -> None:
    (tmp_path / "fusesoc_firm" / "util").mkdir(parents=True)
    (tmp_path / "fusesoc_firm" / "util" / "__init__.py").write_text("")
    (found,) = violations(tmp_path / "fusesoc_firm")
    assert "'util' is no room" in found
