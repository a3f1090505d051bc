"""A design unit that a tool has read: an entity or a module with its ports, and the faults in its files."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef


@dataclass(frozen=True)
class UnitPort:
    """A port; `direction` is `in`, `out` or another mode of the language.

    `bits` is None if the tool does not know the width. `type` is the port's type if the language has types; a
    `std_logic` has one bit. `is_optional` is set for a port with a default value.
    """

    name: str
    place: SourceRef
    direction: str
    bits: int | None
    type: str = ""
    is_optional: bool = False


@dataclass(frozen=True)
class Unit:
    """An entity or a module; `unset` contains the places of generics without a value."""

    name: str
    place: SourceRef
    ports: tuple[UnitPort, ...]
    unset: dict[str, SourceRef] = field(default_factory=dict)


@dataclass(frozen=True)
class Libraries:
    """The VHDL files of other cores that the accelerators may use, each with its library, and GHDL's options.

    An empty `standard` leaves the choice to the accelerators. `packages` are the texts of generated packages, and
    `generated` the names of all generated units. With `is_complete`, a unit that is neither in one of the files nor
    generated is a fault. `core_with` returns the name of a core with a unit in a library, or an empty text.
    """

    files: Sequence[tuple[Path, str]] = ()
    standard: str = ""
    options: Sequence[str] = ()
    is_complete: bool = False
    packages: Sequence[str] = ()
    generated: Container[str] = frozenset()
    core_with: Callable[[str, str], str] = lambda _library, _unit: ""


# Returns the units of the files, and adds the faults in the files to the collector.
Reader = Callable[[Sequence[Path], str, dict[str, int], Diagnostics], list[Unit]]


def lines_of(path: Path) -> list[str]:
    """Return the lines of a source."""
    return path.read_text(encoding="utf-8", errors="replace").splitlines()


def place(path: Path, line: int, column: int, width: int = 1, lines: Sequence[str] | None = None) -> SourceRef:
    """Return a place in a file with these `lines`; a column of 0 is the first character of the line."""
    lines = lines_of(path) if lines is None else lines
    text = lines[line - 1] if 0 < line <= len(lines) else ""
    return SourceRef(str(path), line, column or len(text) - len(text.lstrip()) + 1, text, width)
