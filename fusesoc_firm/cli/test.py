"""`firm test`: simulate the tests of many cores; a passed test whose inputs are unchanged does not run again."""

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
    from fusesoc_firm.building.steps import Step


def add_test(commands: Any) -> None:
    """Declare the command."""
    test = command(
        commands,
        "test",
        "simulate the tests of many cores in parallel; passed tests with unchanged inputs do not run again",
        "firm test robot:sys:quat2euler --target sim",
        _test,
    )
    test.add_argument(
        "cores", metavar="CORE", nargs="*", help="a core's name in FuseSoC (default: all cores below this folder)"
    )
    test.add_argument(
        "--target",
        dest="targets",
        metavar="NAME",
        nargs="+",
        action="extend",
        default=[],
        help="the tests (default: all targets named sim* and test* that simulate)",
    )
    test.add_argument("--rerun", action="store_true", help="run all tests, also those that have passed")
    test.add_argument(
        "--jobs", type=positive, metavar="N", help="number of parallel tests (default: one per processor core)"
    )
    test.add_argument(
        "--build-root", type=Path, metavar="DIR", help="folder for the builds (default: FuseSoC's build folder)"
    )
    test.add_argument("--locked", action="store_true", help="report differences from each core's lock file as errors")


def _test(arguments: argparse.Namespace) -> None:
    from tqdm import tqdm

    from fusesoc_firm.building.plan import plan_tests
    from fusesoc_firm.building.steps import Steps, steps_of
    from fusesoc_firm.plugin.build import How, Listener, build

    # Test processes are forked, which is safe only without other threads, such as tqdm's monitor.
    tqdm.monitor_interval = 0
    started = time.monotonic()
    plan = plan_tests(arguments.cores, arguments.targets, arguments.build_root)
    if not plan.builds:
        fail("no core below this folder has a test", hint="tests are targets named sim* or test* that simulate")
    steps = Steps(("build", "run"), has_outputs=False, is_rerun=arguments.rerun)
    how = How(is_locked=arguments.locked, jobs=arguments.jobs or 0, steps=steps)
    outcomes = []
    bar = tqdm(total=len(plan.builds), unit="test", disable=None, file=sys.stderr)
    listener = Listener(partial(bar.write, file=sys.stderr), bar.set_postfix_str)
    with bar, closing(build(plan, how, listener)) as found:
        for outcome in found:
            outcomes.append(outcome)
            bar.set_postfix_str(str(outcome.build), refresh=False)
            bar.update()
    outcomes.sort(key=lambda outcome: plan.builds.index(outcome.build))
    _report(outcomes, [steps_of(outcome.build) for outcome in outcomes], time.monotonic() - started)


def _report(outcomes: Sequence[Outcome], steps: Sequence[Sequence[Step]], seconds: float) -> None:
    """Print the results of the tests. Raise `InputError` if a test failed."""
    from fusesoc_firm.text.outputs import shown

    for outcome in outcomes:
        if not outcome.is_good:
            print(f"{outcome.build} failed; the last lines of {shown(outcome.build.log)}")
            print(*(f"    {line}" for line in outcome.last_lines), sep="\n")
    rows = [("core", "test", "result", "seconds", "log")]
    rows += [
        (
            outcome.build.core,
            outcome.build.target,
            _result(outcome, done),
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
    counts = ", ".join(f"{results.count(word)} {word}" for word in ("cached", "passed", "failed"))
    print(f"{len(outcomes)} tests in {seconds:.1f} s: {counts}; {saved:.1f} s saved")
    if failed := results.count("failed"):
        fail(f"{failed} of {len(outcomes)} tests failed")


def _result(outcome: Outcome, steps: Sequence[Step]) -> str:
    if not outcome.is_good:
        return "failed"
    return "cached" if steps and all(step.state == "cached" for step in steps) else "passed"
