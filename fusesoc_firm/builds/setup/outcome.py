"""One build: a core's target and its folder, its outcome, and FuseSoC's configuration.

A command whose builds are recalled loads this module, but neither FuseSoC nor the modules that plan and run builds.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Build:
    """The full name of a core, a target of the core, and the build folder."""

    core: str
    target: str
    work_root: Path

    @property
    def log(self) -> Path:
        """The file for the build's output."""
        return self.work_root.with_name(f"{self.work_root.name}.log")

    @property
    def lock(self) -> Path:
        """The lock file of the build folder."""
        return self.work_root.with_name(f"{self.work_root.name}.lock")

    def __str__(self) -> str:
        return f"{self.core} {self.target}"


@dataclass(frozen=True)
class Outcome:
    """The result of a build: success, the duration of the last try in seconds, and the number of tries.

    `last_lines` are those of the log of the last failed try. A skipped build was not started.
    """

    build: Build
    is_good: bool
    seconds: float
    last_lines: tuple[str, ...] = ()
    tries: int = 1
    is_skipped: bool = False

    @property
    def result(self) -> str:
        """`ok`, `flaky` for a success after failed tries, `failed` or `skipped`."""
        if self.is_skipped:
            return "skipped"
        return ("ok" if self.tries == 1 else "flaky") if self.is_good else "failed"


@dataclass(frozen=True)
class Limits:
    """The limits of each build: the time of a try in seconds (0: unlimited), and the number of further tries."""

    seconds: float = 0
    retries: int = 0


def ignore(_build: Build, _try: int) -> None:
    """Ignore the start of a build."""


def configuration_file() -> Path:
    """Return the path of the FuseSoC configuration for the current folder, which may be missing."""
    return Path(os.environ.get("FUSESOC_CONFIG") or "fusesoc.conf")


def configuration() -> Any:
    """Return FuseSoC's configuration for the current folder, as the command `fusesoc` reads it."""
    from fusesoc.config import Config

    return Config(path=os.environ.get("FUSESOC_CONFIG"), create_if_missing=False)
