"""Runs one build in a separate process: FuseSoC's `run`, with all output in a log.

The process is a copy of one in which FuseSoC has already read its libraries. The process leads a process group that
contains all programs it starts, so that they can be ended together; they also end when the parent process ends.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import chdir
from functools import cache
from pathlib import Path
from typing import Any

from fusesoc_firm.building.plan import Build

Answer = Callable[[list[str]], bool]
"""Answers the generator call with this command line in the current folder; returns False to leave it to FuseSoC."""


def build_in_this_process(fusesoc: Any, build: Build, options: tuple[str, ...], alive: tuple[int, int]) -> None:
    """Run a build with the options of `fusesoc run`, and exit with its status.

    `alive` is a pipe that ends when the parent ends, once this process has closed the pipe's other end.
    """
    os.setsid()
    os.close(alive[1])
    threading.Thread(target=_end_with, args=(alive[0],), daemon=True).start()
    build.log.parent.mkdir(parents=True, exist_ok=True)
    log = build.log.open("w", buffering=1, encoding="utf-8", errors="backslashreplace")
    for stream in (1, 2):
        os.dup2(log.fileno(), stream)
    # Line buffering keeps the order with the output of started programs.
    sys.stdout = sys.stderr = log
    _run(fusesoc, build, options)


def save_time(answer: Answer) -> None:
    """Save FuseSoC two costs for each generated core: a generator process, and recompiling a schema.

    This applies to the process and its copies. It affects only the time: if FuseSoC lacks the names that are replaced
    here, builds take longer.
    """
    from fusesoc import edalizer

    if hasattr(edalizer, "Launcher"):
        edalizer.Launcher = _answering(edalizer.Launcher, answer)
    if hasattr(edalizer, "Core2Parser"):
        edalizer.Core2Parser = cache(edalizer.Core2Parser)
        # This repeats FuseSoC's call, so that copies of the process inherit the result.
        edalizer.Core2Parser(False, allow_additional_properties=False)


def _answering(launcher: Any, answer: Answer) -> type:
    """Return a subclass of FuseSoC's launcher of generators, which calls `answer` first."""

    class Launcher(launcher):  # type: ignore[misc]
        def run(self) -> None:
            with chdir(self.cwd):
                is_answered = answer([self.cmd, *self.args])
            if not is_answered:
                super().run()

    return Launcher


def _run(fusesoc: Any, build: Build, options: tuple[str, ...]) -> None:
    from fusesoc.fusesoc import Fusesoc
    from fusesoc.main import parse_args

    Fusesoc.init_logging(False, True)
    arguments = parse_args(["run", *options, f"--target={build.target}", build.core])
    arguments.func(fusesoc, arguments)


def _end_with(alive: int) -> None:
    """Wait until the parent has ended, then kill this process and all that it started."""
    os.read(alive, 1)
    os.killpg(0, signal.SIGKILL)


def last_lines(path: Path, count: int) -> list[str]:
    """Return the last lines of a log, or an empty list if there is no log."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()[-count:]
    except FileNotFoundError:
        return []
