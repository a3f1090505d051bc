"""docs/figures/mutants.md: how many mutants the tests find, by kind and by folder."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import PurePath

from fusesoc_firm.scheduling.tables import grid
from tools.bench.figures import FOLDER
from tools.bench.tables import filled
from tools.mutants.mutants import KINDS, Mutant

DOCUMENT = FOLDER / "mutants.md"
FOUND, MISSED, INVALID, ERROR = "found", "missed", "not valid", "not tried"
VERDICTS = (FOUND, MISSED, INVALID, ERROR)

_INTRODUCTION = """# Mutants

For developers who change tests.
After reading it, you can look up how many faults of one line the tests find, by kind and by folder.

`make mutants MUTANTS=--figures` writes this page.
[CONTRIBUTING.md](../../CONTRIBUTING.md#build-and-test) says how to add a mutant.
"""


def table(verdicts: Mapping[Mutant, str]) -> str:
    """The number of mutants by kind and verdict."""
    return _grid("kind", KINDS, ((mutant.kind, verdict) for mutant, verdict in verdicts.items()))


def write(verdicts: Mapping[Mutant, str]) -> None:
    """Write the page."""
    rooms = [(_room(mutant), verdict) for mutant, verdict in verdicts.items()]
    measured = f"Measured with Python {platform.python_version()} and pytest {metadata.version('pytest')}."
    parts = [
        _INTRODUCTION,
        filled(measured),
        "\n## By kind\n",
        table(verdicts),
        "## By folder\n",
        _grid("folder", sorted({room for room, _ in rooms}), rooms),
    ]
    DOCUMENT.write_text("\n".join(parts), encoding="utf-8")


def _room(mutant: Mutant) -> str:
    """`cores/net`, `fusesoc_firm/node`."""
    return "/".join(PurePath(mutant.file).parent.parts[:2])


def _grid(heading: str, names: Iterable[str], verdicts: Iterable[tuple[str, str]]) -> str:
    counts = Counter(verdicts)
    columns = [verdict for verdict in VERDICTS if verdict in VERDICTS[:2] or any(key[1] == verdict for key in counts)]
    rows = ((name, *(str(counts[name, verdict]) for verdict in columns)) for name in names)
    return grid((heading, *columns), tuple(row for row in rows if any(cell != "0" for cell in row[1:])))
