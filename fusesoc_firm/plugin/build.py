"""Many builds at once, with what our generators make for them made beforehand: what `firm build` does."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.building.cluster import build_on
from fusesoc_firm.building.plan import Plan
from fusesoc_firm.building.pool import Outcome, Pool
from fusesoc_firm.building.process import save_time
from fusesoc_firm.plugin.answer import answer_from_store
from fusesoc_firm.plugin.batch import prepare
from fusesoc_firm.plugin.generators import GENERATORS
from fusesoc_firm.plugin.project import check_locked
from fusesoc_firm.tools.library_path import library_root
from fusesoc_firm.tools.workers import cluster_workers

_LAUNCHER = "EDALIZE_LAUNCHER"


@dataclass(frozen=True)
class How:
    """How to build: in which places, how far, how many at once (0 for one a core), and on which cluster, if on one."""

    is_clean: bool = False
    is_setup_only: bool = False
    is_build_only: bool = False
    is_locked: bool = False
    jobs: int = 0
    cluster: str = ""


def build(
    plan: Plan, how: How, tell: Callable[[str], None], progress: Callable[[str], None]
) -> Generator[Outcome, None, None]:
    """Each build's outcome, as they come. Whenever it is left, nothing that it started runs on.

    `tell` hears of builds that wait, `progress` of what is generated. Raises `InputError`, also for what differs from
    the lock file of a core.
    """
    os.environ.setdefault(_LAUNCHER, shlex.join([sys.executable, "-m", "fusesoc_firm.cli", "tool"]))
    if how.is_locked:
        for core in dict.fromkeys(build.core for build in plan.builds):
            check_locked(core)
    options = ["--setup"] * how.is_setup_only + ["--clean"] * how.is_clean
    if how.cluster:
        options += ["--build-only"] * how.is_build_only + ["--build-root", str(plan.build_root)]
        with cluster_workers(how.cluster) as workers:
            yield from build_on(workers, plan, options)
        return
    jobs = how.jobs or len(os.sched_getaffinity(0))
    plan.fetch()
    # What is locked is checked by each call.
    if not how.is_locked and _generators_run_here():
        calls = plan.generator_calls()
        with closing(prepare(calls, jobs)) as steps:
            for number, _ in enumerate(steps, start=1):
                progress(f"generated {number} of {len(calls)}")
        save_time(_answer)
    options += ["--setup", "--build"] * how.is_build_only
    yield from Pool(tuple(options), jobs, tell).run(plan)


def _generators_run_here() -> bool:
    """Whether the Python that runs this is the one that generators are to run in."""
    chosen = os.environ.get("FUSESOC_FIRM_PYTHON")
    return not chosen or Path(chosen).absolute() == Path(sys.executable).absolute()


def _answer(line: Sequence[str]) -> bool:
    """Answer a call of one of our generators, of which this is the command line, from the store."""
    *_, script, path = line
    commands = {library_root() / "generators" / f"{name}_generator.py": name for name in GENERATORS}
    name = next((name for known, name in commands.items() if known.resolve() == Path(script).resolve()), None)
    return name is not None and answer_from_store(name, Path(path))
