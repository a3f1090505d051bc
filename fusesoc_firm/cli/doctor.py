"""`firm doctor`: the tools on this machine, and missing requirements of a node on a board with Linux."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import command

_MACHINE = Path("/")


def add_doctor(commands: Any) -> None:
    """Declare the command."""
    doctor = command(
        commands,
        "doctor",
        "list tools and what works with them; find what a board with Linux lacks for a node with AXI DMA",
        "firm doctor",
        _examine,
    )
    doctor.add_argument(
        "--root", type=Path, metavar="DIR", help="examine only the board with these files (default: this machine)"
    )


def _examine(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.node.doctor import is_board
    from fusesoc_firm.text.diagnostics import fail

    if arguments.root is None:
        _print_tools()
        if is_board(_MACHINE):
            print()
            _examine_board(_MACHINE)
    elif arguments.root.is_dir():
        _examine_board(arguments.root)
    else:
        fail(f"there is no folder {arguments.root}")


def _print_tools() -> None:
    from fusesoc_firm.tools.inventory import inventory

    tools = inventory()
    names, versions = (
        max(map(len, column)) for column in zip(*((tool.name, tool.version) for tool in tools), strict=True)
    )
    for tool in tools:
        print(f"{tool.name:{names}}  {tool.version or 'missing':{max(versions, len('missing'))}}  {tool.use}")


def _examine_board(root: Path) -> None:
    """Print the state of a board; exit with status 1 if something is missing."""
    from fusesoc_firm.node.doctor import examine, transport_address

    findings = examine(root)
    width = max(len(finding.subject) for finding in findings)
    for finding in findings:
        state = finding.fault or ("in order" if finding.is_known else "not examined")
        print(f"{finding.subject:{width}}  {state}")
    faults = [finding for finding in findings if finding.fault]
    for number, finding in enumerate(faults, start=1):
        print(f"{number}. {finding.subject}: {finding.remedy}")
    if faults:
        sys.exit(1)
    print(f"the node's transport: {transport_address(root)}")
