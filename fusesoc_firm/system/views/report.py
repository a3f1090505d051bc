"""The amounts of hand-written and generated code of a system."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import yaml

from fusesoc_firm.converter.sources import Artifact
from fusesoc_firm.system.system_core import LoadedSystem, artifacts


@dataclass(frozen=True)
class Report:
    """The numbers of hand-written and generated lines of code in a system.

    Empty lines and comment lines do not count. `software` is the size of functions that could also be hardware;
    `configuration` is the size of the templates' data in YAML.
    """

    name: str
    written: int
    configuration: int
    files: int
    software: int = 0

    @property
    def generated(self) -> int:
        """The total number of generated lines."""
        return self.configuration + self.files

    @property
    def ratio(self) -> float:
        """The number of generated lines per hand-written line."""
        return self.generated / (self.written + self.software)

    def __str__(self) -> str:
        rows = {
            "system": self.name,
            "lines written: specification": self.written,
            **({"lines written: software": self.software} if self.software else {}),
            "template configuration": self.configuration,
            "generated files": self.files,
            "lines generated": self.generated,
            "generated for each line written": f"{self.ratio:.2f}",
        }
        width = max(map(len, rows))
        return "".join(f"{name:{width}}  {value}\n" for name, value in rows.items())


def report(specification: Path, loaded: LoadedSystem) -> Report:
    """Count the lines of a system and of its specification; may raise `InputError`."""
    made = artifacts(loaded)
    return Report(
        loaded.system.name,
        lines_of_code(specification.read_text(encoding="utf-8"), "#"),
        sum(_configuration_lines(item) for item in made),
        sum(lines_of_code(item.text, "--") for item in made),
        sum(lines_of_code(path.read_text(encoding="utf-8"), "#") for path in _software(loaded)),
    )


def _configuration_lines(item: Artifact) -> int:
    """Return the number of lines of a template's data in YAML."""
    return lines_of_code(yaml.safe_dump(item.configuration, sort_keys=False, width=10**6), "#")


def _software(loaded: LoadedSystem) -> list[Path]:
    """Return the source files of software, each once."""
    sources = (source for type_ in loaded.system.software.types for source in type_.accelerator.sources)
    return [*dict.fromkeys((loaded.folder / source).resolve() for source in sources)]


def lines_of_code(text: str, comment: str) -> int:
    """Return the number of lines that are neither empty nor comments."""
    return sum(bool(line.strip()) and not line.lstrip().startswith(comment) for line in text.split("\n"))
