"""Imports between the rooms of the package go one way, as docs/architecture.md says."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tools.rooms import BESIDE, NAME, PACKAGE, arrows, imported_rooms, modules, reduced, room_of

TABLE = PACKAGE.parent / "docs" / "architecture.md"
PICTURE = PACKAGE.parent / "docs" / "pictures" / "house.svg"

# Each room, from the ground up, and the rooms below it that it may import from.
ALLOWED: dict[str, str] = {
    "text": "",
    "tools": "text",
    "storage": "text",
    "message": "storage text tools",
    "core": "message text tools",
    "frame": "message text",
    "converter": "core frame message text tools",
    "compiler": "converter frame text tools",
    "netlist": "text tools",
    "noc": "text",
    "scheduling": "text tools",
    "system": "compiler converter core frame message noc scheduling text tools",
    "cocotb": "converter frame message system",
    "fabric": "message system text tools",
    "accelerator": "compiler converter frame netlist system text tools",
    "node": "accelerator core frame message system text tools",
    "runs": "accelerator converter core frame message node system text tools",
    "builds": "converter core fabric message node runs system text tools",
    "api": "accelerator builds frame message node runs system text",
    "export": "api builds core frame message netlist node system text tools",
    "exploration": "accelerator compiler core frame netlist noc node runs system text tools",
    "studio": "accelerator builds converter core exploration frame message node runs scheduling system text tools",
    "cli": (
        "accelerator builds converter exploration export fabric message node runs scheduling studio system text tools"
    ),
}
# The storeys of rooms that have some, from the ground up; what lies beside them stands on all of them.
STOREYS = {
    "system": ("written", "derived", "hardware", "boards", ".", "views", "scaffold"),
    "scheduling": (".", "models", "evaluation"),
    "runs": ("bags", "simulation", "replay", "emulation", "verify", "."),
    "builds": ("store", "step", "setup", "call", "."),
    "export": ("component", "ip_xact", "wrapper", "pynq", "."),
}


def violations(package: Path) -> Iterator[str]:
    for path in modules(package):
        room = room_of(path, package)
        if room in BESIDE:
            continue
        if room not in ALLOWED:
            yield f"{path}:1: '{room}' is not a room of docs/architecture.md"
            continue
        for line, imported in imported_rooms(ast.parse(path.read_text())):
            # `from fusesoc_firm import __version__` names the package itself.
            if imported not in {*ALLOWED[room].split(), room, "__version__"}:
                yield f"{path}:{line}: '{room}' may not import '{imported}'"


def storey_of(parts: tuple[str, ...], storeys: tuple[str, ...]) -> str:
    return parts[0] if parts[0] in storeys else "."


def steps_down(package: Path, room: str, storeys: tuple[str, ...]) -> Iterator[str]:
    """Imports from a higher storey of the same room."""
    for path in sorted((package / room).rglob("*.py")):
        own = storeys.index(storey_of(path.relative_to(package / room).parts, storeys))
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{NAME}.{room}"):
                parts = [*(node.module or "").split(".")[2:], node.names[0].name]
                if storeys.index(storey_of(tuple(parts), storeys)) > own:
                    yield f"{path}:{node.lineno}: '{'.'.join(parts)}' is in a higher storey"


def imported_modules(path: Path, package: Path) -> Iterator[Path]:
    """The modules of the package that a module names in its imports, wherever these stand in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            named = [package.parent.joinpath(*alias.name.split(".")) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            folder = path.parents[node.level - 1] if node.level else package.parent
            named = [folder.joinpath(*(node.module or "").split("."), alias.name) for alias in node.names]
        else:
            continue
        for name in named:
            # The last part may name a value in the module before it.
            files = (file for module in (name, name.parent) for file in (f"{module}.py", module / "__init__.py"))
            yield from [Path(file) for file in files if Path(file).exists()][:1]


def circle(package: Path) -> list[str]:
    """The modules of a circle of imports, or nothing; the package itself imports others only on demand."""
    inside = [path for path in modules(package) if room_of(path, package) not in BESIDE]
    try:
        TopologicalSorter({path: set(imported_modules(path, package)) for path in inside}).prepare()
    except CycleError as error:
        return [str(path.relative_to(package)) for path in error.args[1]]
    return []


def test_a_room_stands_on_lower_ones() -> None:
    rooms = list(ALLOWED)
    for number, room in enumerate(rooms):
        assert set(ALLOWED[room].split()) <= set(rooms[:number]), room


@pytest.mark.parametrize("room", STOREYS)
def test_a_storey_stands_on_lower_ones(room: str) -> None:
    assert {path.name for path in (PACKAGE / room).iterdir() if path.is_dir()} - {"__pycache__"} <= {*STOREYS[room]}
    found = list(steps_down(PACKAGE, room, STOREYS[room]))
    assert not found, "\n".join(found)


def test_modules_lie_in_rooms() -> None:
    assert [path.name for path in PACKAGE.glob("*.py")] == ["__init__.py", "__main__.py"]


def test_no_folder_has_a_name_that_tools_skip() -> None:
    """pytest, ruff, uv and many ignore files skip these, without a message."""
    skipped = {"build", "dist", "CVS", "venv", "site-packages"}
    for folder in (PACKAGE, PACKAGE.parent / "tests", PACKAGE.parent / "tools"):
        assert not [path for path in folder.rglob("*.py") if skipped & {*path.relative_to(folder).parts}]


def test_a_room_imports_what_it_may() -> None:
    """A right that nobody uses goes."""
    assert {room: set(may.split()) for room, may in ALLOWED.items()} == arrows()


def test_the_picture_is_that_of_the_imports() -> None:
    drawn = re.findall(r"<title>(\w+)&#45;&gt;(\w+)</title>", PICTURE.read_text(encoding="utf-8"))
    command = "; draw it again: python -m tools.rooms -o docs/pictures/house.svg"
    assert sorted(drawn) == sorted((room, other) for room, rooms in reduced(arrows()).items() for other in rooms), (
        command
    )


def test_the_table_of_changes_names_files_that_exist() -> None:
    rows = re.findall(r"^\| .* \| `([\w/.]+)` \| (.*) \|$", TABLE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) >= 30
    for room, files in rows:
        places = [PACKAGE / room, PACKAGE, PACKAGE.parent, PACKAGE.parent / room]
        for name in re.findall(r"`([\w/.]+\.\w+)`", files):
            # A core's files are named by their endings.
            assert name.startswith(".") or any((place / name).exists() for place in places), (room, name)
        assert any((place / room).is_dir() for place in places), room


def test_the_package_needs_neither_tests_nor_tools() -> None:
    for path in modules(PACKAGE):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module or ""]
            assert not {name.partition(".")[0] for name in names} & {"tests", "tools"}, f"{path}:{node}"


def test_modules_import_without_circles() -> None:
    assert not circle(PACKAGE)


@pytest.mark.parametrize(
    "statement",
    [
        "from fusesoc_firm.message.parser import parse",
        "from fusesoc_firm.message import library, parser",
        "import fusesoc_firm.message.parser",
        "if TYPE_CHECKING:\n    from .parser import parse",
        "def f():\n    from . import parser",
    ],
)
def test_circles_are_found(tmp_path: Path, statement: str) -> None:
    room = tmp_path / "fusesoc_firm" / "message"
    room.mkdir(parents=True)
    (room / "model.py").write_text(statement)
    (room / "parser.py").write_text("from fusesoc_firm.message.model import Field")
    assert set(circle(tmp_path / "fusesoc_firm")) == {"message/model.py", "message/parser.py"}


def test_imports_go_one_way() -> None:
    found = list(violations(PACKAGE))
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "statement",
    [
        "from fusesoc_firm.system import spec",
        "from fusesoc_firm import plugin",
        "import fusesoc_firm.cli",
        "def f():\n    from fusesoc_firm.converter.config import x",
        "from ..frame import model",
        "if TYPE_CHECKING:\n    import fusesoc_firm",
    ],
)
def test_the_rule_is_enforced(tmp_path: Path, statement: str) -> None:
    package = tmp_path / "fusesoc_firm"
    (package / "message").mkdir(parents=True)
    (package / "message" / "parser.py").write_text(f"from fusesoc_firm.text.naming import identifier\n{statement}\n")
    (found,) = violations(package)
    assert f"parser.py:{2 + statement.count(chr(10))}: 'message' may not import" in found


def test_a_new_room_must_be_announced(tmp_path: Path) -> None:
    (tmp_path / "fusesoc_firm" / "util").mkdir(parents=True)
    (tmp_path / "fusesoc_firm" / "util" / "__init__.py").write_text("")
    (found,) = violations(tmp_path / "fusesoc_firm")
    assert "'util' is not a room" in found
