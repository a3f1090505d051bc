"""The command `firm`: one module a command."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from fusesoc_firm import __version__
from fusesoc_firm.cli.build import add_build
from fusesoc_firm.cli.cache import add_cache
from fusesoc_firm.cli.common import command
from fusesoc_firm.cli.live import add_live
from fusesoc_firm.cli.message import add_message
from fusesoc_firm.cli.project import add_project
from fusesoc_firm.cli.replay import add_replay
from fusesoc_firm.cli.scheduler import add_scheduler
from fusesoc_firm.cli.simulator import add_simulator
from fusesoc_firm.cli.system import add_system
from fusesoc_firm.cli.tool import add_tool
from fusesoc_firm.cli.why import add_why
from fusesoc_firm.node.options import remappings
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.interrupts import accept_interrupts
from fusesoc_firm.tools.library_path import demos_root, docs_root, library_root


def main(argv: Sequence[str] | None = None) -> int:
    """Run `firm`; return the exit status: 1 for faults, 2 for a wrong command line, 130 for Ctrl-C."""
    accept_interrupts()
    arguments = _parsed(argv)
    try:
        arguments.handler(arguments)
        sys.stdout.flush()
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of the output (`| head`) has closed the pipe, so nothing may be flushed into the pipe at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0


def _parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    """Parse the command line, in which remappings for a ROS node may be at any position."""
    parser = _parser()
    arguments, rest = parser.parse_known_args(argv)
    if rest and not hasattr(arguments, "remappings"):
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    if rest:
        arguments.remappings = remappings(rest, parser.error)
    return arguments


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="firm", description="ROS messages and robot systems as FPGA hardware.")
    parser.add_argument("--version", action="version", version=f"firm {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    path = command(
        commands,
        "path",
        "print the folder of the FuseSoC library of reusable cores and generators",
        'fusesoc library add firm "$(firm path)"',
        _print_path,
    )
    kind = path.add_mutually_exclusive_group()
    kind.add_argument("--demos", action="store_true", help="print the folder of the demo systems instead")
    kind.add_argument("--docs", action="store_true", help="print the folder of the documentation instead")
    path.add_argument(
        "--relative",
        action="store_true",
        help="print a path relative to the current folder, for a fusesoc.conf in version control",
    )
    add_message(commands)
    add_system(commands)
    add_simulator(commands)
    add_live(commands)
    add_scheduler(commands)
    add_build(commands)
    add_replay(commands)
    add_project(commands)
    add_why(commands)
    add_cache(commands)
    add_tool(commands)
    return parser


def _print_path(arguments: argparse.Namespace) -> None:
    folder = demos_root() if arguments.demos else docs_root() if arguments.docs else library_root()
    # Resolve links on both sides, so that `..` leads to the right folder.
    print(os.path.relpath(folder, Path.cwd().resolve()) if arguments.relative else folder)
