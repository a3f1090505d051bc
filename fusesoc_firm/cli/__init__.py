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
from fusesoc_firm.cli.common import Parser
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.terminal import safe_output
from fusesoc_firm.tools.interrupts import accept_interrupts
from fusesoc_firm.tools.verilator_package import provide_verilator

# The module with each command; its function `add_<module>` declares it. The order is that of the help.
_MODULES = {
    "init": "init",
    "check": "check",
    "sim": "sim",
    "live": "live",
    "replay": "replay",
    "studio": "studio",
    "message": "message",
    "bitstream": "bitstream",
    "load": "bitstream",
    "doctor": "doctor",
    "system": "system",
    "scheduler": "scheduler",
    "accelerator": "accelerator",
    "fabric": "fabric",
    "test": "test",
    "build": "build",
    "emulate": "emulate",
    "simulator": "simulator",
    "trace": "live",
    "status": "status",
    "registers": "status",
    "ip-xact": "ip_xact",
    "wrap": "wrap",
    "pynq": "pynq",
    "why": "why",
    "graph": "project",
    "affected": "project",
    "lock": "project",
    "query": "query",
    "cache": "cache",
    "path": "path",
    "ros": "ros",
    "tool": "tool",
    "completion": "completion",
    "help": "help",
}
# The commands of `firm --help`, at most ten; `firm help --all` adds the others as 'more'.
GROUPS = {
    "start": ("init", "check"),
    "run": ("sim", "live", "replay"),
    "look": ("studio", "message", "doctor"),
    "use hardware": ("bitstream", "load"),
}
# Other names of commands, which do the same.
ALIASES = {"new": "init", "run": "sim", "simulate": "sim", "program": "load"}


def main(argv: Sequence[str] | None = None) -> int:
    """Run `firm`; return the exit status: 1 for faults, 2 for a wrong command line, 130 for Ctrl-C."""
    accept_interrupts()
    provide_verilator(os.environ)
    with safe_output():
        return _run(argv)


def _run(argv: Sequence[str] | None) -> int:
    try:
        arguments = _parsed(argv)
        if hasattr(arguments, "spec") and (arguments.spec is None or arguments.spec.is_dir()):
            from fusesoc_firm.cli.here import spec_here

            arguments.spec = spec_here(*filter(None, [arguments.spec]))
        elif hasattr(arguments, "spec"):
            from fusesoc_firm.cli.here import check_is_spec

            check_is_spec(arguments.spec)
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

        autocomplete(parser_of(_MODULES))
    if not words:
        parser_of(_MODULES).print_help(sys.stderr)
        sys.exit(2)
    first = words[0]
    name = ALIASES.get(first, first)
    if name and not name.startswith("-") and name not in _MODULES:
        from fusesoc_firm.cli.guesses import fail_unknown

        fail_unknown(name, parser_of(_MODULES))
    parser = parser_of([name] if name in _MODULES else _MODULES)
    arguments, rest = parser.parse_known_args(words)
    if hasattr(arguments, "remappings"):
        _take_remappings(arguments, rest)
    elif rest:
        arguments.parser.refuse(rest)
    return arguments


def _take_remappings(arguments: argparse.Namespace, rest: list[str]) -> None:
    """Add the remappings in the rest of the command line to the arguments; without SPEC, the first one is there."""
    from fusesoc_firm.node.interface.options import remappings

    if ":=" in str(arguments.spec):
        rest.insert(0, str(arguments.spec))
        arguments.spec = None
    arguments.remappings = remappings(rest, lambda _: arguments.parser.refuse(rest))


def parser_of(names: Iterable[str]) -> Parser:
    """Return the parser of these commands, which lists the first ones in its help."""
    parser = Parser(
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
    known = dict(commands.choices)
    if _MODULES.keys() <= known.keys():
        more = len(known) - sum(map(len, GROUPS.values()))
        parser.epilog = "\n".join(
            [
                *_grouped(known, GROUPS),
                f"'firm help --all' lists {more} more commands for experts.",
                "'firm COMMAND --help' describes a command and shows an example.",
            ]
        )
    for alias, name in ALIASES.items():
        if name in known:
            commands.choices[alias] = known[name]
    return parser


def all_commands() -> str:
    """Return the list of all commands, with their other names."""
    known = {name: parser for name, parser in parser_of(_MODULES).commands().items() if name not in ALIASES}
    shown = {name for names in GROUPS.values() for name in names}
    groups = {**GROUPS, "more": tuple(name for name in known if name not in shown)}
    others = ", ".join(f"'{alias}' is '{name}'" for alias, name in ALIASES.items())
    return "\n".join([*_grouped(known, groups), f"other names: {others}"])


def _grouped(commands: Mapping[str, argparse.ArgumentParser], groups: Mapping[str, Iterable[str]]) -> list[str]:
    """Return the lines of a help about these groups of commands."""
    width = max(map(len, commands)) + 2
    lines: list[str] = []
    for title, names in groups.items():
        lines.append(f"{title}:")
        for name in names:
            text = str(commands[name].description).rstrip(".")
            indent = " " * (width + 2)
            words = f"  {name:{width}}{text[0].lower()}{text[1:]}"
            lines += textwrap.wrap(words, shutil.get_terminal_size((100, 24)).columns - 2, subsequent_indent=indent)
        lines.append("")
    return lines
