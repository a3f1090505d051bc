"""Run builds on the machines of a Dask cluster that share the folder; each build is a `firm build` on one machine."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex

from fusesoc_firm.builds.setup.outcome import Build, Outcome
from fusesoc_firm.builds.setup.plan import Plan
from fusesoc_firm.builds.setup.pool import SHOWN_LINES
from fusesoc_firm.tools.workers import Workers

# The environment variables that workers need, without paths of programs, which differ between machines.
_PREFIXES = ("FUSESOC", "EDALIZE", "ROS_", "AMENT_")
_POLL_SECONDS = 0.2


@dataclass(frozen=True)
class _Task:
    """A build: the arguments of `firm build`, and a file that exists while the build is wanted."""

    build: Build
    arguments: tuple[str, ...]
    folder: Path
    environment: Mapping[str, str]
    wanted: Path


@dataclass(frozen=True)
class _Result:
    status: int
    seconds: float
    output: str


def build_on(workers: Workers, plan: Plan, arguments: Sequence[str]) -> Iterator[Outcome]:
    """Run `firm build` for each build; yield each outcome when it is ready, and end all builds on exit."""
    wanted = plan.build_root / f".firm_build.{token_hex(8)}"
    plan.build_root.mkdir(parents=True, exist_ok=True)
    wanted.touch()
    environment = {name: value for name, value in os.environ.items() if name.startswith(_PREFIXES)}
    tasks = [_Task(build, tuple(arguments), Path.cwd(), environment, wanted) for build in plan.builds]
    try:
        for task, result in workers.run(_build, tasks):
            # The output of `firm build` ends with the last lines of the log.
            lines = () if result.status == 0 else tuple(result.output.splitlines()[-SHOWN_LINES:])
            yield Outcome(task.build, result.status == 0, result.seconds, lines)
    finally:
        wanted.unlink()


def _build(task: _Task) -> _Result:
    """Run a build on this machine until the build finishes or is no longer wanted."""
    command = [sys.executable, "-m", "fusesoc_firm.cli", "build", task.build.core, "--target", task.build.target]
    started = time.monotonic()
    with subprocess.Popen(
        [*command, "--jobs", "1", *task.arguments],
        cwd=task.folder,
        env={**os.environ, **task.environment},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as running:
        while True:
            try:
                output, _ = running.communicate(timeout=_POLL_SECONDS)
                return _Result(running.returncode, time.monotonic() - started, output)
            except subprocess.TimeoutExpired:
                if not task.wanted.exists():
                    running.terminate()
