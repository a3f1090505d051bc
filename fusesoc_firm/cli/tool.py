"""`firm tool`: start a program of a build for Edalize."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from fusesoc_firm.cli.common import command


def add_tool(commands: Any) -> None:
    """Declare the command."""
    tool = command(
        commands,
        "tool",
        "start a program for Edalize and record it in manifest.json, or name the package that provides the program",
        "firm tool nextpnr-ecp5 --version",
        _run_tool,
    )
    tool.add_argument("program", metavar="PROGRAM", help="the program, such as nextpnr-ecp5")
    tool.add_argument("arguments", metavar="ARGUMENT", nargs=argparse.REMAINDER, help="arguments for the program")


def _run_tool(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.tools.launcher import launch

    if status := launch(arguments.program, arguments.arguments):
        sys.exit(status)
