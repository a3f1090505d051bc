"""The rooms of the package, read from its imports, and the picture of them in docs/architecture.md.

    python -m tools.rooms -o docs/pictures/house.svg

Each arrow leads from a room to one that it imports from. An arrow is left out where others lead the same way.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterator, Mapping
from graphlib import TopologicalSorter
from pathlib import Path

from fusesoc_firm.tools.pictures import check_picture, draw

PACKAGE = Path(__file__).resolve().parents[1] / "fusesoc_firm"
NAME = "fusesoc_firm"
# Links to cores, demo systems and pages.
LINKS = {"library", "demos", "docs"}
_COLUMNS = 24


# The modules beside the rooms.
BESIDE = {"__init__", "__main__"}


def modules(package: Path) -> Iterator[Path]:
    """Every module of the package, sorted; none of those that links lead to."""
    return (path for path in sorted(package.rglob("*.py")) if room_of(path, package) not in LINKS)


def room_of(path: Path, package: Path) -> str:
    """The folder of the package that a module is in, or its own name if it is beside them."""
    return path.relative_to(package).parts[0].removesuffix(".py")


def imported_rooms(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """The line and room of each import from the package, except from the module's own folder.

    A relative import that leaves the folder counts as room '.'.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level:
            if node.level > 1:
                yield node.lineno, "."
            continue
        elif isinstance(node, ast.ImportFrom) and node.module == NAME:
            names = [f"{NAME}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        else:
            continue
        for name in names:
            if name.split(".")[0] == NAME:
                yield node.lineno, [*name.split("."), ""][1]


def arrows(package: Path = PACKAGE) -> dict[str, set[str]]:
    """The rooms that each room imports from."""
    found: dict[str, set[str]] = {}
    for path in modules(package):
        rooms = {room for _, room in imported_rooms(ast.parse(path.read_text(encoding="utf-8")))}
        found.setdefault(room_of(path, package), set()).update(rooms)
    # `from fusesoc_firm import __version__` names the package itself; its main module starts `cli`.
    return {room: rooms - {room, "__version__"} for room, rooms in found.items() if room not in BESIDE}


def reduced(graph: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """A graph without circles and without arrows that lead where longer ways lead, too (its transitive reduction)."""
    below: dict[str, set[str]] = {}
    for room in TopologicalSorter(graph).static_order():
        below[room] = graph[room].union(*(below[other] for other in graph[room]))
    return {room: rooms - set().union(*(below[other] for other in rooms)) for room, rooms in graph.items()}


def dot(package: Path = PACKAGE) -> str:
    """The rooms as a graph for Graphviz, each with the first sentence of its docstring."""
    lines = [
        "digraph house {",
        '  graph [rankdir=TB, nodesep=0.25, ranksep=0.35, fontname="sans-serif"]',
        '  node [shape=box, style="filled,rounded", fillcolor="#eef3f8", color="#4a6a8a"]',
        '  node [fontname="sans-serif", fontsize=10]',
        '  edge [color="#7a8a9a", arrowsize=0.6]',
    ]
    graph = reduced(arrows(package))
    for room in sorted(graph):
        lines.append(f'  "{room}" [label=<<b>{room}</b><br/>{_wrapped(_meaning(package / room))}>]')
    lines += [f'  "{room}" -> "{other}"' for room in sorted(graph) for other in sorted(graph[room])]
    return "\n".join([*lines, "}", ""])


def _meaning(room: Path) -> str:
    text = ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0].removesuffix(".").replace("`", "").replace("&", "&amp;")


def _wrapped(text: str) -> str:
    """The text in lines of some 24 characters, with the line break of Graphviz' labels."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + len(word) >= _COLUMNS:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "<br/>".join(lines)


def main() -> None:
    """Draw the rooms into the file that the command line names."""
    parser = argparse.ArgumentParser(prog="tools.rooms", description="Draw the rooms of the package.")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="the file of the picture, such as docs/pictures/house.svg"
    )
    path = parser.parse_args().output
    check_picture(path, None)
    draw(dot(), path, None)


if __name__ == "__main__":
    main()
