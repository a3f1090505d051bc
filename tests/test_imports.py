"""Imports between the rooms of the package go one way, as docs/architecture.md says."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.rooms import NAME, PACKAGE, arrows, imported_rooms, modules, reduced, room_of

TABLE = PACKAGE.parent / "docs" / "architecture.md"
PICTURE = PACKAGE.parent / "docs" / "pictures" / "house.svg"

# Each room, from the ground up, and the rooms below it that it may import from.
ALLOWED: dict[str, str] = {
    "text": "",
    "store": "text",
    "message": "store text",
    "request": "message store text",
    "frame": "message text",
    "tools": "store text",
    "converter": "frame message request store text",
    "netlist": "text tools",
    "scheduling": "text tools",
    "action": "store text tools",
    "building": "action request store text tools",
    "system": "converter frame message request scheduling store text tools",
    "fabric": "message system text",
    "accelerator": "converter system text tools",
    "verify": "converter frame message request text tools",
    "bags": "frame message system text",
    "simulation": "bags converter frame message request store system text tools",
    "node": "frame message request simulation system text tools",
    "plugin": "building converter fabric message node request simulation store system text tools",
    "emulation": "frame message node request simulation system text",
    "replay": "bags frame message node simulation system text",
    "studio": "converter frame message node plugin request scheduling simulation store system text tools",
    "cli": (
        "accelerator action building converter emulation fabric message node plugin replay scheduling simulation store"
        " studio system text tools verify"
    ),
}
# The storeys of rooms that have some, from the ground up; what lies beside them stands on all of them.
STOREYS = {
    "system": ("written", "derived", "hardware", "boards", ".", "views", "scaffold"),
    "scheduling": (".", "models", "evaluation"),
}


def violations(package: Path) -> Iterator[str]:
    for path in modules(package):
        room = room_of(path, package)
        if room == "__init__":
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
    assert [path.name for path in PACKAGE.glob("*.py")] == ["__init__.py"]


def test_a_room_imports_what_it_may() -> None:
    """A right that nobody uses goes."""
    assert {room: set(may.split()) for room, may in ALLOWED.items()} == arrows()


def test_the_picture_is_that_of_the_imports() -> None:
    drawn = re.findall(r"<title>(\w+)&#45;&gt;(\w+)</title>", PICTURE.read_text(encoding="utf-8"))
    command = "; draw it again: python -m tests.rooms docs/pictures/house.svg"
    assert sorted(drawn) == sorted((room, other) for room, rooms in reduced(arrows()).items() for other in rooms), (
        command
    )


def test_the_table_of_changes_names_files_that_exist() -> None:
    rows = re.findall(r"^\| .* \| `([\w/.]+)` \| (.*) \|$", TABLE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) >= 30
    for room, files in rows:
        places = [PACKAGE / room, PACKAGE, PACKAGE.parent]
        for name in re.findall(r"`([\w/.]+\.\w+)`", files):
            # A core's files are named by their endings.
            assert name.startswith(".") or any((place / name).exists() for place in places), (room, name)
        assert any((place / room).is_dir() for place in places), room


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
