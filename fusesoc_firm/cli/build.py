"""`firm build`: FuseSoC for many cores and targets at once."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import command, positive
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.building.plan import Plan
    from fusesoc_firm.building.pool import Outcome

_LAUNCHER = "EDALIZE_LAUNCHER"


def add_build(commands: Any) -> None:
    """Declare the command."""
    build = command(
        commands,
        "build",
        "run FuseSoC for many cores and targets, as many at once as the machine has cores",
        "firm build robot:sys:quat2euler robot:sys:obstacle --target sim lint",
        _build,
    )
    build.add_argument("cores", metavar="CORE", nargs="+", help="a core's name as FuseSoC has it")
    build.add_argument(
        "--target",
        dest="targets",
        metavar="NAME",
        nargs="+",
        action="extend",
        required=True,
        help="targets, of which every core must have each",
    )
    stages = build.add_mutually_exclusive_group()
    stages.add_argument("--setup", action="store_true", help="only generate and set up what the tools are started on")
    stages.add_argument("--build-only", action="store_true", help="build, but run nothing: no simulation, no board")
    build.add_argument("--jobs", type=positive, metavar="N", help="builds at once (default: one a core)")
    build.add_argument("--cluster", metavar="ADDRESS", help="do it on the Dask cluster of this scheduler instead")
    build.add_argument("--build-root", type=Path, metavar="DIR", help="where to build (default: FuseSoC's)")
    build.add_argument("--clean", action="store_true", help="empty the place of each build first")
    build.add_argument(
        "--locked", action="store_true", help="refuse what differs from a core's lock file, and say what does"
    )


def _build(arguments: argparse.Namespace) -> None:
    from tqdm import tqdm

    from fusesoc_firm.building.plan import make_plan

    # Processes are copied here, which goes well as long as there are no threads; this one only watches the bar.
    tqdm.monitor_interval = 0
    os.environ.setdefault(_LAUNCHER, shlex.join([sys.executable, "-m", "fusesoc_firm.cli", "tool"]))
    plan = make_plan(arguments.cores, arguments.targets, arguments.build_root)
    if arguments.locked:
        _check_locks(plan)
    started = time.monotonic()
    outcomes = []
    bar = tqdm(total=len(plan.builds), unit="build", disable=None, file=sys.stderr)
    with bar, closing(_outcomes(plan, arguments, bar)) as found:
        for outcome in found:
            outcomes.append(outcome)
            failed = sum(not outcome.is_good for outcome in outcomes)
            bar.set_postfix_str(f"{outcome.build}, {failed} failed", refresh=False)
            bar.update()
    _report(sorted(outcomes, key=lambda outcome: plan.builds.index(outcome.build)), time.monotonic() - started)


def _outcomes(plan: Plan, arguments: argparse.Namespace, bar: Any) -> Generator[Outcome, None, None]:
    from fusesoc_firm.building.cluster import build_on
    from fusesoc_firm.building.pool import Pool
    from fusesoc_firm.building.process import save_time
    from fusesoc_firm.tools.workers import cluster_workers

    options = ["--setup"] * arguments.setup + ["--clean"] * arguments.clean
    if arguments.cluster:
        options += ["--build-only"] * arguments.build_only + ["--build-root", str(plan.build_root)]
        with cluster_workers(arguments.cluster) as workers:
            yield from build_on(workers, plan, options)
        return
    jobs = arguments.jobs or len(os.sched_getaffinity(0))
    plan.fetch()
    # What is locked is checked by each call.
    if not arguments.locked and _generators_run_here():
        _generate(plan, jobs, bar)
        save_time(_answer)
    options += ["--setup", "--build"] * arguments.build_only
    yield from Pool(tuple(options), jobs, partial(bar.write, file=sys.stderr)).run(plan)


def _generators_run_here() -> bool:
    """Whether the Python that runs this is the one that generators are to run in."""
    chosen = os.environ.get("FUSESOC_FIRM_PYTHON")
    return not chosen or Path(chosen).absolute() == Path(sys.executable).absolute()


def _generate(plan: Plan, jobs: int, bar: Any) -> None:
    """Have everything generated that is not in the store yet."""
    from fusesoc_firm.plugin.batch import prepare

    calls = plan.generator_calls()
    with closing(prepare(calls, jobs)) as steps:
        for number, _ in enumerate(steps, start=1):
            bar.set_postfix_str(f"generated {number} of {len(calls)}")


def _answer(line: Sequence[str]) -> bool:
    """Answer a call of one of our generators, of which this is the command line, from the store."""
    from fusesoc_firm.plugin.answer import answer_from_store
    from fusesoc_firm.plugin.generators import GENERATORS
    from fusesoc_firm.tools.library_path import library_root

    *_, script, path = line
    commands = {library_root() / "generators" / f"{name}_generator.py": name for name in GENERATORS}
    name = next((name for known, name in commands.items() if known.resolve() == Path(script).resolve()), None)
    return name is not None and answer_from_store(name, Path(path))


def _check_locks(plan: Plan) -> None:
    """Raise `InputError` with what differs from the lock file of a core."""
    from fusesoc_firm.cli.project import check_locked

    for core in dict.fromkeys(build.core for build in plan.builds):
        check_locked(core)


def _report(outcomes: Sequence[Outcome], seconds: float) -> None:
    """Print what came of the builds. Raises `InputError` if one failed."""
    from fusesoc_firm.cli.project import shown

    failed = [outcome for outcome in outcomes if not outcome.is_good]
    for outcome in failed:
        print(f"{outcome.build} failed; {shown(outcome.build.log)} ends with")
        print(*(f"    {line}" for line in outcome.last_lines), sep="\n")
    rows = [("core", "target", "result", "seconds", "log")]
    rows += [
        (
            outcome.build.core,
            outcome.build.target,
            "ok" if outcome.is_good else "failed",
            f"{outcome.seconds:.1f}",
            shown(outcome.build.log),
        )
        for outcome in outcomes
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())
    print(f"{len(outcomes)} builds in {seconds:.1f} s")
    if failed:
        fail(f"{len(failed)} of {len(outcomes)} builds failed")
