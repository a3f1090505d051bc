"""Run one build in a separate process: FuseSoC's `run`, with all output in a log.

The process is a copy of a process in which FuseSoC has already read its libraries. It leads a process group with all
programs that it starts, so that all can be ended together. All also end when the parent process ends.
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

from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.setup.run_options import split

Answer = Callable[[list[str], Callable[[], None]], None]
"""A function that answers the generator call with this command line in the current folder, or lets FuseSoC start it."""


Run = Callable[[Any, Build, tuple[str, ...]], None]
"""A function that runs a build with a FuseSoC instance and the options of `fusesoc run`; it exits after a failure."""


def build_in_this_process(
    fusesoc: Any, build: Build, options: tuple[str, ...], alive: tuple[int, int], run: Run
) -> None:
    """Run a build with the options of `fusesoc run`, and exit with its status.

    `alive` is a pipe that ends when the parent ends, once this process has closed the pipe's other end.
    """
    os.setsid()
    os.close(alive[1])
    threading.Thread(target=_end_with, args=(alive[0],), daemon=True).start()
    build.log.parent.mkdir(parents=True, exist_ok=True)
    build.log.unlink(missing_ok=True)
    # Started programs append to the same file.
    log = build.log.open("a", buffering=1, encoding="utf-8", errors="backslashreplace")
    for stream in (1, 2):
        os.dup2(log.fileno(), stream)
    # Line buffering keeps the order with the output of started programs.
    sys.stdout = sys.stderr = log
    run(fusesoc, build, options)


def save_time(answer: Answer) -> None:
    """Avoid two costs of FuseSoC for each generated core: a generator process, and recompiling a schema.

    The change applies to this process and its copies, and only shortens builds. FuseSoC with
    `docs/upstream/fusesoc-generators.patch` has a hook for the first and avoids the second itself. In the releases up
    to 2.4.7, two names are replaced; if FuseSoC lacks these names, builds take longer.
    """
    from fusesoc import edalizer

    if hasattr(edalizer, "Ttptttg") and hasattr(edalizer.Ttptttg, "launcher"):
        edalizer.Ttptttg.launcher = _answering(edalizer.Ttptttg.launcher, answer)
        return
    if hasattr(edalizer, "Launcher"):
        edalizer.Launcher = _answering(edalizer.Launcher, answer)
    if hasattr(edalizer, "Core2Parser"):
        edalizer.Core2Parser = cache(edalizer.Core2Parser)
        # Make FuseSoC's call once here, so that copies of the process inherit the result.
        edalizer.Core2Parser(False, allow_additional_properties=False)


def _answering(launcher: Any, answer: Answer) -> type:
    """Return a subclass of FuseSoC's launcher for generators that calls `answer`."""

    class Launcher(launcher):  # type: ignore[misc]
        def run(self) -> None:
            here, start = Path.cwd(), super().run

            def start_here() -> None:
                with chdir(here):
                    start()

            with chdir(self.cwd):
                answer([self.cmd, *self.args], start_here)

    return Launcher


def set_up(fusesoc: Any, build: Build, options: tuple[str, ...]) -> None:
    """Set up a build in an empty folder, with FuseSoC; exit after a failure."""
    run_all(fusesoc, build, ("--setup", "--clean", *options))


def run_all(fusesoc: Any, build: Build, options: tuple[str, ...]) -> None:
    """Run a build with FuseSoC: all steps, unless the options select some; exit after a failure."""
    from fusesoc.fusesoc import Fusesoc
    from fusesoc.main import parse_args

    Fusesoc.init_logging(False, True)
    words, backend = split(options)
    arguments = parse_args(["run", *words, f"--target={build.target}", build.core, *backend])
    arguments.func(fusesoc, arguments)


def _end_with(alive: int) -> None:
    """Wait until the parent has ended, then kill this process and all processes that it started."""
    os.read(alive, 1)
    os.killpg(0, signal.SIGKILL)


def last_lines(path: Path, count: int) -> list[str]:
    """Return the last lines of a log, or an empty list if there is no log."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()[-count:]
    except FileNotFoundError:
        return []
