"""`firm build`: run FuseSoC for many cores and targets in parallel."""

from __future__ import annotations

import argparse
import time
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.build_options import (
    add_fusesoc,
    add_limits,
    add_reports,
    add_sandbox,
    add_selection,
    limits_of,
    outputs_of,
    run_options_of,
    selection_of,
)
from fusesoc_firm.cli.common import command, positive
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.plan import Plan
    from fusesoc_firm.builds.setup.run_options import RunOptions
    from fusesoc_firm.builds.setup.selection import Selection

_NOT_CACHED = ("setup", "cluster")


def add_build(commands: Any) -> None:
    """Declare the command."""
    build = command(
        commands,
        "build",
        "run FuseSoC for many cores and targets in parallel, one build per processor core",
        "firm build robot:sys:quat2euler robot:sys:obstacle --target sim lint",
        _build,
    )
    add_selection(build)
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
    add_sandbox(build)
    build.add_argument(
        "--rerun", action="store_true", help="with --cached or --sandbox, run all steps, also those that are stored"
    )
    build.add_argument("--clean", action="store_true", help="empty each build folder first")
    build.add_argument("--locked", action="store_true", help="report differences from each core's lock file as errors")
    add_limits(build)
    add_reports(build)
    add_fusesoc(build)


def _build_cached(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.cli.build_report import Report, Words
    from fusesoc_firm.cli.cached import how_to_run, run_cached

    if others := [name for name in _NOT_CACHED if getattr(arguments, name)]:
        cached = "--sandbox" if arguments.sandbox else "--cached"
        fail(f"{cached} cannot be combined with --{others[0]}")
    selection, options = selection_of(arguments), run_options_of(arguments)
    names = ("build",) if arguments.build_only else ("build", "run")
    how = how_to_run(arguments, *names)
    chosen = ("build", *selection.words(), options.command_line(), names)
    make = partial(_plan, selection, options, arguments.build_root)
    report = Report(Words(is_cached=True), outputs_of(arguments))
    run_cached(chosen, make, how, arguments.build_root, report)


def _plan(selection: Selection, options: RunOptions, build_root: Path | None) -> Plan:
    from fusesoc_firm.builds.setup.plan import select_plan

    return select_plan(selection, options, build_root)


def _build(arguments: argparse.Namespace) -> None:
    if arguments.cached or arguments.sandbox:
        _build_cached(arguments)
        return
    if arguments.rerun:
        fail("--rerun needs --cached or --sandbox")

    from fusesoc_firm.builds.parallel import How, Listener, build
    from fusesoc_firm.cli.build_report import Report, Words
    from fusesoc_firm.cli.cached import print_failures

    plan = _plan(selection_of(arguments), run_options_of(arguments), arguments.build_root)
    how = How(
        arguments.clean,
        arguments.setup,
        arguments.build_only,
        arguments.locked,
        arguments.jobs or 0,
        arguments.cluster or "",
        arguments.fail_fast,
        limits_of(arguments),
    )
    started = time.time()
    report = Report(Words(), outputs_of(arguments))
    report.plan(plan.builds)
    listener = Listener(report.tell, report.progress, report.begin)
    with closing(report), closing(build(plan, how, listener)) as outcomes:
        for outcome in outcomes:
            report.end(outcome)
    print_failures(started)
    report.finish()
