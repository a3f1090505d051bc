"""The mutants: faults of one line in the product, each of which some tests must find."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import yaml

from tests.hdl.ghdl import REPOSITORY

FOLDER = Path(__file__).parent
PYTHON, HARDWARE, SOFTWARE, PROGRAM = "Python", "VHDL and templates", "C and C++", "programs (.seq)"
KINDS = (PYTHON, HARDWARE, SOFTWARE, PROGRAM)
_SOFTWARE = (".c", ".h", ".S", ".cpp", ".hpp")


@dataclass(frozen=True)
class Mutant:
    """A fault that stands in the place of a line, or of a part of it, and the arguments of pytest that find it."""

    file: str
    line: str
    fault: str
    tests: str

    @property
    def kind(self) -> str:
        name = self.file.removesuffix(".mustache")
        if name.endswith(_SOFTWARE):
            return SOFTWARE
        if name.endswith(".seq"):
            return PROGRAM
        return PYTHON if self.file.endswith(".py") else HARDWARE

    @property
    def name(self) -> str:
        """`fusesoc_firm/text/naming.py: return a < b -> return a <= b`."""
        line, fault = (" ".join(text.split()) for text in (self.line, self.fault))
        return f"{self.file}: {line} -> {fault}"

    def mistakes(self, root: Path = REPOSITORY) -> Iterator[str]:
        """Why it cannot be tried on the sources below a folder."""
        path = root / self.file
        count = path.read_text(encoding="utf-8").count(self.line) if path.is_file() else 0
        if count != 1:
            yield f"{self.name}: the line is there {count} times instead of once"
        if self.fault == self.line:
            yield f"{self.name}: the fault is the line itself"

    def apply(self, root: Path) -> str:
        """Put the fault into the sources below a folder; the text of the file before."""
        before = (root / self.file).read_text(encoding="utf-8")
        (root / self.file).write_text(before.replace(self.line, self.fault), encoding="utf-8")
        return before


def mutants(patterns: Sequence[str] = ()) -> list[Mutant]:
    """All mutants in the files of this folder whose file's path contains one of the patterns, if there are any."""
    entries = (
        entry for file in sorted(FOLDER.glob("*.yaml")) for entry in yaml.safe_load(file.read_text(encoding="utf-8"))
    )
    known = [Mutant(**entry) for entry in entries]
    return [mutant for mutant in known if not patterns or any(pattern in mutant.file for pattern in patterns)]


def as_json(mutant: Mutant, verdict: str, seconds: float) -> dict[str, str | float]:
    """An entry of a report."""
    return {**asdict(mutant), "kind": mutant.kind, "verdict": verdict, "seconds": round(seconds, 1)}
