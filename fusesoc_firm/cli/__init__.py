"""The command `firm`: one module a command."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

from fusesoc_firm import __version__
from fusesoc_firm.cli.bring_up import add_doctor
from fusesoc_firm.cli.build import add_build
from fusesoc_firm.cli.cache import add_cache
from fusesoc_firm.cli.common import command
from fusesoc_firm.cli.emulate import add_emulate
from fusesoc_firm.cli.init import add_init
from fusesoc_firm.cli.live import add_live
from fusesoc_firm.cli.message import add_message
from fusesoc_firm.cli.project import add_project
from fusesoc_firm.cli.query import add_query
from fusesoc_firm.cli.replay import add_replay
from fusesoc_firm.cli.ros import add_ros
from fusesoc_firm.cli.scheduler import add_scheduler
from fusesoc_firm.cli.sim import add_sim
from fusesoc_firm.cli.simulator import add_simulator
from fusesoc_firm.cli.status import add_status
from fusesoc_firm.cli.studio import add_studio
from fusesoc_firm.cli.system import add_system
from fusesoc_firm.cli.test import add_test
from fusesoc_firm.cli.tool import add_tool
from fusesoc_firm.cli.why import add_why
from fusesoc_firm.node.options import remappings
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.interrupts import accept_interrupts
from fusesoc_firm.tools.library_path import demos_root, docs_root, library_root

# The commands of `firm --help`; commands that are not listed here follow as 'more'.
GROUPS = {
    "start": ("init", "system"),
    "run": ("sim", "live", "replay", "emulate"),
    "look": ("studio", "message", "trace", "why", "graph"),
    "build": ("build", "test", "query", "affected", "lock", "cache", "path"),
}


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
    if "_ARGCOMPLETE" in os.environ:
        from argcomplete import autocomplete

        autocomplete(parser)
    arguments, rest = parser.parse_known_args(argv)
    if rest and not hasattr(arguments, "remappings"):
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    if rest:
        arguments.remappings = remappings(rest, parser.error)
    return arguments


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="firm",
        usage="firm [-h] [--version] COMMAND ...",
        description="ROS messages and robot systems as FPGA hardware.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"firm {__version__}")
    # The epilog lists the commands in groups, which argparse does not support.
    commands = parser.add_subparsers(prog="firm", metavar="COMMAND", required=True, help=argparse.SUPPRESS)
    add_init(commands)
    add_sim(commands)
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
    add_studio(commands)
    add_simulator(commands)
    add_emulate(commands)
    add_live(commands)
    add_ros(commands)
    add_status(commands)
    add_doctor(commands)
    add_scheduler(commands)
    add_build(commands)
    add_test(commands)
    add_replay(commands)
    add_project(commands)
    add_query(commands)
    add_why(commands)
    add_cache(commands)
    add_tool(commands)
    completion = command(
        commands,
        "completion",
        "print the code with which a shell completes commands, options and their values",
        'eval "$(firm completion bash)"',
        _print_completion,
    )
    completion.add_argument("shell", choices=("bash", "zsh", "fish"), help="the shell")
    parser.epilog = _grouped(commands.choices)
    return parser


def _grouped(commands: Mapping[str, argparse.ArgumentParser]) -> str:
    """Return the list of the commands for the help: the commands of `GROUPS`, then all others."""
    rest = [name for name in commands if not any(name in names for names in GROUPS.values())]
    width = max(map(len, commands)) + 2
    lines: list[str] = []
    for title, names in {**GROUPS, "more": rest}.items():
        lines.append(f"{title}:")
        for name in names:
            text = str(commands[name].description).rstrip(".")
            indent = " " * (width + 2)
            words = f"  {name:{width}}{text[0].lower()}{text[1:]}"
            lines += textwrap.wrap(words, shutil.get_terminal_size((100, 24)).columns - 2, subsequent_indent=indent)
        lines.append("")
    return "\n".join([*lines, "'firm COMMAND --help' describes a command and shows an example."])


def _print_completion(arguments: argparse.Namespace) -> None:
    from argcomplete.shell_integration import shellcode

    print(shellcode(["firm"], shell=arguments.shell), end="")


def _print_path(arguments: argparse.Namespace) -> None:
    folder = demos_root() if arguments.demos else docs_root() if arguments.docs else library_root()
    # Resolve links on both sides, so that `..` leads to the right folder.
    print(os.path.relpath(folder, Path.cwd().resolve()) if arguments.relative else folder)
