"""`firm test`: simulate the tests of many cores; a passed test whose inputs are unchanged does not run again."""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import command, positive
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.building.plan import Plan


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
    from fusesoc_firm.building.steps import Steps
    from fusesoc_firm.cli.cached import Words, report, run_cached
    from fusesoc_firm.plugin.build import How

    started = time.monotonic()
    steps = Steps(("build", "run"), has_outputs=False, is_rerun=arguments.rerun)
    how = How(is_locked=arguments.locked, jobs=arguments.jobs or 0, steps=steps)
    words = Words("test", "passed", ("test", arguments.cores, arguments.targets))
    outcomes = run_cached(words, partial(_plan, arguments), how, arguments.build_root)
    report(words, outcomes, time.monotonic() - started)


def _plan(arguments: argparse.Namespace) -> Plan:
    """Return the plan of the tests. May raise `InputError`."""
    from fusesoc_firm.building.plan import plan_tests

    plan = plan_tests(arguments.cores, arguments.targets, arguments.build_root)
    if not plan.builds:
        fail("no core below this folder has a test", hint="tests are targets named sim* or test* that simulate")
    return plan
