"""`firm doctor`: find missing requirements of a node on a board with Linux."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import command


def add_doctor(commands: Any) -> None:
    """Declare the command."""
    doctor = command(
        commands,
        "doctor",
        "find what a board with Linux lacks for a node with AXI DMA, and how to mend it",
        "firm doctor",
        _examine,
    )
    doctor.add_argument(
        "--root", type=Path, metavar="DIR", default=Path("/"), help="the folder with the board's files (default: /)"
    )


def _examine(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.node.doctor import examine, transport_address
    from fusesoc_firm.text.diagnostics import fail

    if not arguments.root.is_dir():
        fail(f"there is no folder {arguments.root}")
    findings = examine(arguments.root)
    width = max(len(finding.subject) for finding in findings)
    for finding in findings:
        state = finding.fault or ("in order" if finding.is_known else "not examined")
        print(f"{finding.subject:{width}}  {state}")
    faults = [finding for finding in findings if finding.fault]
    for number, finding in enumerate(faults, start=1):
        print(f"{number}. {finding.subject}: {finding.remedy}")
    if faults:
        sys.exit(1)
    print(f"the node's transport: {transport_address(arguments.root)}")
