"""The errors of a replay: each is printed in a line, up to a limit."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

from tqdm import tqdm

SHOWN = 100
"""The maximum number of lines; further errors are only counted."""


@dataclass
class Errors:
    """The number of errors in the replay of a bag, and the lines of the first ones."""

    bag: Path
    count: int = 0
    first: list[str] = field(default_factory=list)

    def add(self, fault: str) -> None:
        """Count an error, and print it above the progress bar."""
        self.count += 1
        if self.count <= SHOWN:
            self.first.append(fault)
            tqdm.write(f"error: {self.bag}: {fault}", file=sys.stderr)
