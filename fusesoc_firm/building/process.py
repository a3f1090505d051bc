"""One build, in a process of its own: FuseSoC's `run`, with all output in a log.

The process is a copy of one in which FuseSoC has read its libraries already. It leads a group of its own, in which all
programs that it starts are too, so that they can be ended together; they are also ended if the process that started it
is no more.
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
"""Answers a generator call, of which it takes the command line, in the current folder; False if FuseSoC is to do it."""


def build_in_this_process(fusesoc: Any, build: Build, options: tuple[str, ...], alive: tuple[int, int]) -> None:
    """Do a build with the options of `fusesoc run`; exits with its status.

    `alive` is a pipe that ends when the parent does, once its other end is closed here.
    """
    os.setsid()
    os.close(alive[1])
    threading.Thread(target=_end_with, args=(alive[0],), daemon=True).start()
    build.log.parent.mkdir(parents=True, exist_ok=True)
    log = build.log.open("w", buffering=1, encoding="utf-8", errors="backslashreplace")
    for stream in (1, 2):
        os.dup2(log.fileno(), stream)
    # By lines, so that they stand in order with those of the programs that are started.
    sys.stdout = sys.stderr = log
    _run(fusesoc, build, options)


def save_time(answer: Answer) -> None:
    """Spare FuseSoC two costs of each generated core: a process for its generator, and compiling a schema anew.

    This holds for the process and its copies. It changes nothing but the time: where FuseSoC does not have the names
    that are replaced here, it takes longer.
    """
    from fusesoc import edalizer

    if hasattr(edalizer, "Launcher"):
        edalizer.Launcher = _answering(edalizer.Launcher, answer)
    if hasattr(edalizer, "Core2Parser"):
        edalizer.Core2Parser = cache(edalizer.Core2Parser)
        # As FuseSoC does, so that copies of the process have it.
        edalizer.Core2Parser(False, allow_additional_properties=False)


def _answering(launcher: Any, answer: Answer) -> type:
    """FuseSoC's class that starts a generator, which asks `answer` first."""

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
    """Wait until the parent is no more, then end this process and all that it started."""
    os.read(alive, 1)
    os.killpg(0, signal.SIGKILL)


def last_lines(path: Path, count: int) -> list[str]:
    """The end of a log; none if there is none."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()[-count:]
    except FileNotFoundError:
        return []
