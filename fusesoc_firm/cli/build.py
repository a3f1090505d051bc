"""`firm build`: run FuseSoC for many cores and targets in parallel."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import command, positive
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.building.pool import Outcome


def add_build(commands: Any) -> None:
    """Declare the command."""
    build = command(
        commands,
        "build",
        "run FuseSoC for many cores and targets in parallel, one build per processor core",
        "firm build robot:sys:quat2euler robot:sys:obstacle --target sim lint",
        _build,
    )
    build.add_argument("cores", metavar="CORE", nargs="+", help="a core's name in FuseSoC")
    build.add_argument(
        "--target",
        dest="targets",
        metavar="NAME",
        nargs="+",
        action="extend",
        required=True,
        help="the targets to build; every core must have all of them",
    )
    stages = build.add_mutually_exclusive_group()
    stages.add_argument("--setup", action="store_true", help="only generate the cores and prepare the tools' inputs")
    stages.add_argument(
        "--build-only", action="store_true", help="only build: do not run simulations or program boards"
    )
    build.add_argument(
        "--jobs", type=positive, metavar="N", help="number of parallel builds (default: one per processor core)"
    )
    build.add_argument(
        "--cluster", metavar="ADDRESS", help="run on the Dask cluster of the scheduler at ADDRESS, not on this machine"
    )
    build.add_argument(
        "--build-root", type=Path, metavar="DIR", help="folder for the builds (default: FuseSoC's build folder)"
    )
    build.add_argument(
        "--cached",
        action="store_true",
        help="take the results of steps with unchanged inputs from the store; each build starts in an empty folder",
    )
    build.add_argument("--clean", action="store_true", help="empty each build folder first")
    build.add_argument("--locked", action="store_true", help="report differences from each core's lock file as errors")


def _build_cached(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.building.plan import make_plan
    from fusesoc_firm.building.steps import Steps
    from fusesoc_firm.cli.cached import Words, report, run_cached
    from fusesoc_firm.plugin.build import How

    if arguments.setup or arguments.cluster:
        fail("--cached cannot be combined with --setup or --cluster", hint="a setup is not cached")
    started = time.monotonic()
    steps = Steps(("build",) if arguments.build_only else ("build", "run"))
    how = How(is_locked=arguments.locked, jobs=arguments.jobs or 0, steps=steps)
    words = Words("build", "ok", ("build", arguments.cores, arguments.targets, steps.names))
    make = partial(make_plan, arguments.cores, arguments.targets, arguments.build_root)
    report(words, run_cached(words, make, how, arguments.build_root), time.monotonic() - started)


def _build(arguments: argparse.Namespace) -> None:
    if arguments.cached:
        _build_cached(arguments)
        return

    from tqdm import tqdm

    from fusesoc_firm.building.plan import make_plan
    from fusesoc_firm.plugin.build import How, build

    # Build processes are forked, which is safe only without other threads, such as tqdm's monitor.
    tqdm.monitor_interval = 0
    plan = make_plan(arguments.cores, arguments.targets, arguments.build_root)
    how = How(
        arguments.clean,
        arguments.setup,
        arguments.build_only,
        arguments.locked,
        arguments.jobs or 0,
        arguments.cluster or "",
    )
    started = time.monotonic()
    outcomes = []
    bar = tqdm(total=len(plan.builds), unit="build", disable=None, file=sys.stderr)
    with bar, closing(build(plan, how, partial(bar.write, file=sys.stderr), bar.set_postfix_str)) as found:
        for outcome in found:
            outcomes.append(outcome)
            failed = sum(not outcome.is_good for outcome in outcomes)
            bar.set_postfix_str(f"{outcome.build}, {failed} failed", refresh=False)
            bar.update()
    _report(sorted(outcomes, key=lambda outcome: plan.builds.index(outcome.build)), time.monotonic() - started)


def _report(outcomes: Sequence[Outcome], seconds: float) -> None:
    """Print the results of the builds. Raise `InputError` if a build failed."""
    from fusesoc_firm.text.outputs import shown

    failed = [outcome for outcome in outcomes if not outcome.is_good]
    for outcome in failed:
        print(f"{outcome.build} failed; the last lines of {shown(outcome.build.log)}")
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
