"""Run builds whose steps are cached, for `firm test` and `firm build --cached`."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from fusesoc_firm.cli.build_options import is_sandboxed, limits_of, run_options_of

if TYPE_CHECKING:
    from fusesoc_firm.builds.parallel import How
    from fusesoc_firm.builds.setup.plan import Plan
    from fusesoc_firm.cli.build_report import Report


def how_to_run(arguments: argparse.Namespace, *steps: str, has_outputs: bool = True) -> How:
    """Return how to run these steps of each build. Raise `InputError` if a sandbox is required and impossible."""
    from fusesoc_firm.builds.parallel import How
    from fusesoc_firm.builds.setup.steps import Steps

    flags = tuple(run_options_of(arguments).use_flags().items())
    return How(
        is_locked=arguments.locked,
        jobs=arguments.jobs or 0,
        is_failing_fast=arguments.fail_fast,
        limits=limits_of(arguments),
        steps=Steps(steps, has_outputs, is_rerun=arguments.rerun, flags=flags, is_sandboxed=is_sandboxed(arguments)),
    )


def run_cached(
    options: Sequence[object], make: Callable[[], Plan], how: How, build_root: Path | None, report: Report
) -> None:
    """Run the builds of a plan, and print their reports. Raise `InputError` if a build failed, or as `make` does.

    `options` are all options that select or change the builds.
    """
    from fusesoc_firm.builds.parallel import Listener, recall_or_build
    from fusesoc_firm.builds.setup.outcome import configuration
    from fusesoc_firm.builds.setup.recall import Recall
    from fusesoc_firm.builds.step.results import default_results

    started, results = time.time(), default_results()
    root = Path(build_root or configuration().build_root).absolute()
    recall = Recall(results, results.contents(), options, root)
    listener = Listener(report.tell, report.progress, report.begin, report.plan)
    with closing(report), closing(recall_or_build(recall, make, how, listener)) as found:
        for outcome in found:
            report.end(outcome)
    print_failures(started)
    report.finish()


def print_failures(since: float) -> None:
    """Print the warnings of builds about the remote store since a time in seconds since the epoch, once each."""
    from fusesoc_firm.builds.store.store import default_store

    # The warnings of builds are in their logs.
    remote = default_store().remote
    for warning in remote.failures(since) if remote else ():
        print(warning, file=sys.stderr)
