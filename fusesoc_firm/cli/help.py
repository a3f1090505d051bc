"""`firm help`: describe a command, or list all commands."""

from __future__ import annotations

import argparse
from typing import Any

from fusesoc_firm.cli.common import command


def add_help(commands: Any) -> None:
    """Declare the command."""
    about = command(commands, "help", "describe a command, or list all commands", "firm help --all", _help)
    about.add_argument("words", metavar="COMMAND", nargs="*", help="a command, such as sim, or 'system show'")
    about.add_argument("--all", action="store_true", help="list all commands, also those for experts")


def _help(arguments: argparse.Namespace) -> None:
    from fusesoc_firm import cli

    if arguments.all:
        print(cli.all_commands())
    else:
        cli.main([*arguments.words, "--help"])
