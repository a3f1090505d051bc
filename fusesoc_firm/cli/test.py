"""`firm test`: simulate the tests of many cores; a passed test whose inputs are unchanged does not run again."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.build_options import (
    add_fusesoc,
    add_limits,
    add_reports,
    add_sandbox,
    add_selection,
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


def add_test(commands: Any) -> None:
    """Declare the command."""
    test = command(
        commands,
        "test",
        "simulate the tests of many cores in parallel; passed tests with unchanged inputs do not run again",
        "firm test robot:sys:quat2euler --target sim",
        _test,
    )
    add_selection(test, "all targets named sim* and test* that simulate, of the cores below this folder")
    test.add_argument("--rerun", action="store_true", help="run all tests, also those that have passed")
    test.add_argument(
        "--jobs", type=positive, metavar="N", help="number of parallel tests (default: one per processor core)"
    )
    test.add_argument(
        "--build-root", type=Path, metavar="DIR", help="folder for the builds (default: FuseSoC's build folder)"
    )
    test.add_argument("--locked", action="store_true", help="report differences from each core's lock file as errors")
    add_sandbox(test)
    add_limits(test)
    add_reports(test)
    add_fusesoc(test)


def _test(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.cli.build_report import Report, Words
    from fusesoc_firm.cli.cached import how_to_run, run_cached

    selection, options = selection_of(arguments, has_default=True), run_options_of(arguments)
    how = how_to_run(arguments, "build", "run", has_outputs=False)
    report = Report(Words("test", "passed", is_cached=True), outputs_of(arguments))
    chosen = ("test", *selection.words(), options.command_line())
    run_cached(chosen, partial(_plan, selection, options, arguments.build_root), how, arguments.build_root, report)


def _plan(selection: Selection, options: RunOptions, build_root: Path | None) -> Plan:
    """Return the plan of the tests. May raise `InputError`."""
    from fusesoc_firm.builds.setup.plan import plan_tests

    plan = plan_tests(selection, options, build_root)
    if not plan.builds and not selection.cores and selection.affected is None:
        fail("no core below this folder has a test", hint="tests are targets named sim* or test* that simulate")
    return plan
