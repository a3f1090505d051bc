"""cores/acc/float/operators.yaml: the operators of the floating-point core in all forms and sizes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from tests.hdl.ghdl import CORES

FILE = CORES / "acc" / "float" / "operators.yaml"
OPERATORS: dict[str, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))["operators"]


@dataclass(frozen=True)
class Form:
    """An operator in one form and size; `facts` are the entries of the file."""

    operator: str
    name: str
    size: str
    facts: dict[str, Any]

    def __str__(self) -> str:
        return "-".join((self.operator, self.name, self.size))

    @property
    def entity(self) -> str:
        return str(OPERATORS[self.operator]["entity"])

    def latency(self, width: int) -> int:
        """The latency, of a conversion for a fixed-point number of `width` bits."""
        latency = self.facts["latency"]
        return int(latency if isinstance(latency, int) else next(latency[top] for top in latency if top >= width))


def _forms() -> Iterator[Form]:
    for operator, facts in OPERATORS.items():
        for name, sizes in facts["forms"].items():
            for size, found in sizes.items():
                yield Form(operator, name, size, found)


FORMS = tuple(_forms())
