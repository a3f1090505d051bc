"""Run builds whose steps are cached, for `firm test` and `firm build --cached`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fusesoc_firm.building.plan import Plan
    from fusesoc_firm.cli.build_report import Report
    from fusesoc_firm.plugin.build import How


def run_cached(
    options: Sequence[object], make: Callable[[], Plan], how: How, build_root: Path | None, report: Report
) -> None:
    """Run the builds of a plan, and print their reports. Raise `InputError` if a build failed, or as `make` does.

    `options` are all options that select or change the builds.
    """
    from fusesoc_firm.action.results import default_results
    from fusesoc_firm.building.build import configuration
    from fusesoc_firm.building.recall import Recall
    from fusesoc_firm.plugin.build import Listener, recall_or_build

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
    from fusesoc_firm.store.store import default_store

    # The warnings of builds are in their logs.
    remote = default_store().remote
    for warning in remote.failures(since) if remote else ():
        print(warning, file=sys.stderr)
