"""Run builds whose steps are cached, and print the results: for `firm test` and `firm build --cached`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.building.plan import Plan
    from fusesoc_firm.building.pool import Outcome
    from fusesoc_firm.building.steps import Step
    from fusesoc_firm.plugin.build import How


@dataclass(frozen=True)
class Words:
    """A build's name and a good result in the output; `options` are all options that select or change the builds."""

    unit: str
    good: str
    options: tuple[object, ...]

    @property
    def column(self) -> str:
        """The title of the column with targets."""
        return "test" if self.unit == "test" else "target"


def print_failures(since: float) -> None:
    """Print the warnings of builds about the remote store since a time in seconds since the epoch, once each."""
    from fusesoc_firm.store.store import default_store

    # The warnings of builds are in their logs.
    remote = default_store().remote
    for warning in remote.failures(since) if remote else ():
        print(warning, file=sys.stderr)


def run_cached(words: Words, make: Callable[[], Plan], how: How, build_root: Path | None) -> list[Outcome]:
    """Return the outcomes of the builds of a plan, sorted by core and target. May raise `InputError`."""
    from tqdm import tqdm

    from fusesoc_firm.action.results import default_results
    from fusesoc_firm.building.cores import configuration
    from fusesoc_firm.building.recall import Recall
    from fusesoc_firm.plugin.build import Listener, recall_or_build

    # Build processes are forked, which is safe only without other threads, such as tqdm's monitor.
    tqdm.monitor_interval = 0
    started, results = time.time(), default_results()
    root = Path(build_root or configuration().build_root).absolute()
    recall = Recall(results, results.contents(), words.options, root)
    outcomes = []
    bar = tqdm(unit=words.unit, disable=None, file=sys.stderr)
    listener = Listener(partial(bar.write, file=sys.stderr), bar.set_postfix_str)
    with bar, closing(recall_or_build(recall, make, how, listener)) as found:
        for bar.total, outcome in found:
            outcomes.append(outcome)
            bar.set_postfix_str(str(outcome.build), refresh=False)
            bar.update()
    print_failures(started)
    return sorted(outcomes, key=lambda outcome: (outcome.build.core, outcome.build.target))


def report(words: Words, outcomes: Sequence[Outcome], seconds: float) -> None:
    """Print the results of the builds. Raise `InputError` if a build failed."""
    from fusesoc_firm.building.steps import steps_of
    from fusesoc_firm.text.outputs import shown

    steps = [steps_of(outcome.build) for outcome in outcomes]

    for outcome in outcomes:
        if not outcome.is_good and not outcome.is_skipped:
            print(f"{outcome.build} failed; the last lines of {shown(outcome.build.log)}")
            print(*(f"    {line}" for line in outcome.last_lines), sep="\n")
    rows = [("core", words.column, "result", "seconds", "log")]
    rows += [
        (
            outcome.build.core,
            outcome.build.target,
            _result(words, outcome, done),
            f"{outcome.seconds:.1f}",
            shown(outcome.build.log),
        )
        for outcome, done in zip(outcomes, steps, strict=True)
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())
    for reason in dict.fromkeys(
        f"'{step.name}' of {item.build} is not cached: {step.fault}"
        for item, done in zip(outcomes, steps, strict=True)
        for step in done
        if step.fault
    ):
        print(reason)
    results = [row[2] for row in rows[1:]]
    saved = sum(step.seconds for done in steps for step in done if step.state == "cached")
    counts = ", ".join(f"{results.count(word)} {word}" for word in ("cached", words.good, "failed"))
    print(f"{len(outcomes)} {words.unit}s in {seconds:.1f} s: {counts}; {saved:.1f} s saved")
    if failed := results.count("failed"):
        fail(f"{failed} of {len(outcomes)} {words.unit}s failed")


def _result(words: Words, outcome: Outcome, steps: Sequence[Step]) -> str:
    if outcome.is_skipped or not outcome.is_good:
        return outcome.result
    return "cached" if steps and all(step.state == "cached" for step in steps) else words.good
