"""The amounts of hand-written and generated code: the dissertation's table 6.2, for any system."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import yaml

from fusesoc_firm.system.system_core import LoadedSystem, Part, artifacts


@dataclass(frozen=True)
class Report:
    """The numbers of hand-written and generated lines of code in a system.

    Empty lines and comment lines do not count. `software` is the size of functions that could also be hardware;
    `configuration` is the size of the templates' data in YAML.
    """

    name: str
    written: int
    configuration: int
    wrappers: int
    converters: int
    components: int
    software: int = 0

    @property
    def generated(self) -> int:
        """The total number of generated lines."""
        return self.configuration + self.wrappers + self.converters + self.components

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
            "accelerators' wrappers": self.wrappers,
            "converters": self.converters,
            "system components": self.components,
            "lines generated": self.generated,
            "generated for each line written": f"{self.ratio:.2f}",
        }
        width = max(map(len, rows))
        return "".join(f"{name:{width}}  {value}\n" for name, value in rows.items())


def report(specification: Path, loaded: LoadedSystem) -> Report:
    """Count the lines of a system and of its specification; may raise `InputError`."""
    lines: Counter[Part] = Counter()
    configuration = 0
    for item in artifacts(loaded):
        lines[item.part] += _lines_of_code(item.text, "--")
        data = yaml.safe_dump(item.configuration, sort_keys=False, width=10**6)
        configuration += _lines_of_code(data, "#")
    return Report(
        loaded.system.name,
        _lines_of_code(specification.read_text(encoding="utf-8"), "#"),
        configuration,
        lines[Part.WRAPPERS],
        lines[Part.CONVERTERS],
        lines[Part.COMPONENTS],
        sum(_lines_of_code(path.read_text(encoding="utf-8"), "#") for path in _software(loaded)),
    )


def _software(loaded: LoadedSystem) -> list[Path]:
    """Return the source files of software, each once."""
    sources = (source for type_ in loaded.system.software.types for source in type_.accelerator.sources)
    return [*dict.fromkeys((loaded.folder / source).resolve() for source in sources)]


def _lines_of_code(text: str, comment: str) -> int:
    return sum(bool(line.strip()) and not line.lstrip().startswith(comment) for line in text.split("\n"))
