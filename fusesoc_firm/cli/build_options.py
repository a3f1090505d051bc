"""The options with which commands select builds, limit them, pass options to FuseSoC, and write reports."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fusesoc_firm.cli.common import natural, positive
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.outcome import Limits
    from fusesoc_firm.builds.setup.run_options import RunOptions
    from fusesoc_firm.builds.setup.selection import Selection
    from fusesoc_firm.cli.build_report import Outputs

# Options that are passed to `fusesoc run` unchanged: with a value, and without.
_VALUES = {"--filter": "apply a filter of FuseSoC; may be repeated", "--system-name": "another name for the system"}
_SWITCHES = {
    "--no-export": "use the sources in their folders, and do not copy them",
    "--resolve-env-vars-early": "let FuseSoC resolve environment variables",
    "--allow-additional-properties": "accept unknown keys in .core files",
}


def add_selection(parser: argparse.ArgumentParser, default: str = "") -> None:
    """Add the cores and targets, for `selection_of`; `default` describes the default selection."""
    parser.add_argument(
        "cores",
        metavar="CORE",
        nargs="*",
        help="a core's name in FuseSoC or a pattern such as 'acme:m:*', with targets of its own after @: CORE@sim,lint"
        + f" (default: {default})" * bool(default),
    )
    parser.add_argument(
        "--target",
        dest="targets",
        metavar="NAME",
        nargs="+",
        action="extend",
        default=[],
        help="the targets of all cores without targets of their own; may contain wildcards, such as 'sim*'",
    )
    parser.add_argument("--where-present", action="store_true", help="skip targets that a core does not have")
    parser.add_argument(
        "--affected-since",
        metavar="REV",
        help="only cores that edits since this revision affect; without CORE, all of them where the target is present",
    )


def selection_of(arguments: argparse.Namespace, *, has_default: bool = False) -> Selection:
    """Return the selection in the arguments; with `has_default`, cores and targets may be missing.

    May raise `InputError`.
    """
    from fusesoc_firm.builds.setup.selection import Selection

    revision: str | None = arguments.affected_since
    if not arguments.cores and revision is None and not has_default:
        hint = "name cores, or add --affected-since REV; 'firm bitstream' builds for a board"
        fail("no core is selected", hint=hint)
    every = ("*",) if revision is not None else ()
    selection = Selection(tuple(arguments.cores) or every, tuple(arguments.targets))
    missing = [core for core, targets in selection.parts() if not targets]
    if missing and not has_default:
        fail(f"no target of {missing[0]} is selected", hint=f"add --target NAME, or write {missing[0]}@NAME")
    affected = None
    if revision is not None:
        from fusesoc_firm.builds.project import affected_since

        affected = frozenset(affected_since(revision))
    is_where_present = arguments.where_present or not arguments.cores
    return Selection(selection.cores, selection.targets, is_where_present, affected)


def add_limits(parser: argparse.ArgumentParser) -> None:
    """Add the reactions to failures, for `limits_of`."""
    parser.add_argument("--fail-fast", action="store_true", help="after the first failure, end all builds")
    parser.add_argument("--timeout", type=positive, metavar="SECONDS", help="the time limit of each build")
    parser.add_argument(
        "--retries",
        type=natural,
        default=0,
        metavar="N",
        help="try a failed build up to N times more; a success after a failure is reported as flaky (default: 0)",
    )


def limits_of(arguments: argparse.Namespace) -> Limits:
    """Return the limits of each build."""
    from fusesoc_firm.builds.setup.outcome import Limits

    return Limits(arguments.timeout or 0, arguments.retries)


def add_sandbox(parser: argparse.ArgumentParser) -> None:
    """Add the option for steps that see only their inputs, for `is_sandboxed`."""
    parser.add_argument(
        "--sandbox",
        action="store_true",
        help="run each step where only its inputs and the machine's tools exist, without a network (needs 'bwrap')",
    )


def is_sandboxed(arguments: argparse.Namespace) -> bool:
    """Return whether steps run in a sandbox. Raise `InputError` if that is impossible."""
    if not arguments.sandbox:
        return False
    if arguments.no_export:
        fail("--sandbox cannot be combined with --no-export", hint="without export, a step's inputs are in no folder")
    from fusesoc_firm.builds.step.sandbox import check_sandbox

    check_sandbox()
    return True


def add_selectors(parser: argparse._ActionsContainer) -> None:
    """Add the options that select between cores, for `selectors_of`."""
    parser.add_argument("--flag", action="append", default=[], help="a use flag; -FLAG clears it: --flag=-FLAG")
    parser.add_argument("--mapping", action="append", default=[], metavar="CORE", help="a core whose mapping applies")


def selectors_of(arguments: argparse.Namespace) -> RunOptions:
    """Return the options that select between cores."""
    from fusesoc_firm.builds.setup.run_options import RunOptions

    return RunOptions(flags=tuple(arguments.flag), mappings=tuple(arguments.mapping))


def add_fusesoc(parser: argparse.ArgumentParser) -> None:
    """Add the options of `fusesoc run`, for `run_options_of`."""
    group = parser.add_argument_group("options of 'fusesoc run'")
    add_selectors(group)
    group.add_argument("--tool", default="", help="another tool for targets with 'default_tool'")
    group.add_argument("--lockfile", type=Path, metavar="FILE", help="FuseSoC's lock file, with versions of cores")
    for name, text in _VALUES.items():
        group.add_argument(name, action="append", default=[], metavar="NAME", help=text)
    for name, text in _SWITCHES.items():
        group.add_argument(name, action="store_true", help=text)
    group.add_argument(
        "--backend",
        action="append",
        default=[],
        metavar="ARGUMENT",
        help="an argument for the backend, which follows the core's name there: --backend=--SEED=5",
    )


def run_options_of(arguments: argparse.Namespace) -> RunOptions:
    """Return the options of `fusesoc run` in the arguments."""
    from fusesoc_firm.builds.setup.run_options import RunOptions

    given = vars(arguments)
    words = [f"{name}={value}" for name in _VALUES for value in given[_key(name)]]
    words += [name for name in _SWITCHES if given[_key(name)]]
    return RunOptions(
        tuple(arguments.flag),
        arguments.tool,
        tuple(arguments.mapping),
        arguments.lockfile,
        tuple(words),
        tuple(arguments.backend),
    )


def add_reports(parser: argparse.ArgumentParser) -> None:
    """Add the reports, for `outputs_of`."""
    parser.add_argument("--events", type=Path, metavar="FILE", help="write a line of JSON for each event")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write the results in the format of JUnit, for CI")
    detail = parser.add_mutually_exclusive_group()
    detail.add_argument("-v", "--verbose", action="store_true", help="print the log of each build when it ends")
    detail.add_argument("-q", "--quiet", action="store_true", help="print only failures and the summary")


def outputs_of(arguments: argparse.Namespace) -> Outputs:
    """Return the reports in the arguments."""
    from fusesoc_firm.cli.build_report import Outputs

    return Outputs(arguments.events, arguments.junit, arguments.quiet, arguments.verbose)


def _key(name: str) -> str:
    return name.removeprefix("--").replace("-", "_")
