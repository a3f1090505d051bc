"""`firm system bring-up`: write the files that bring up a board under Linux. `firm doctor`: find what a board lacks."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import command, core_folders, positive, print_warnings

_MEBIBYTES = 16


def add_bring_up(actions: Any) -> argparse.ArgumentParser:
    """Declare the action of `firm system`, and return its parser."""
    bring_up = command(
        actions,
        "bring-up",
        "write device-tree overlays and a script that load a system on a board with Linux",
        "firm system bring-up robot.yaml --board zcu104 -o board",
        _write_files,
    )
    bring_up.add_argument("--board", metavar="BOARD", required=True, help="the board, or the path of a board file")
    bring_up.add_argument("-o", "--output", type=Path, metavar="DIR", default=Path(), help="the folder (default: .)")
    bring_up.add_argument(
        "--memory",
        type=positive,
        metavar="MIB",
        default=_MEBIBYTES,
        help="the memory that processor and DMA engine share (default: %(default)s)",
    )
    bring_up.add_argument(
        "--reserve",
        action="store_true",
        help="reserve the memory when Linux boots, by a second overlay for the boot loader",
    )
    return bring_up


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


def _write_files(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.boards.board import on_board, read_board
    from fusesoc_firm.system.boards.overlay import bring_up_files
    from fusesoc_firm.system.message_sources import libraries_beside
    from fusesoc_firm.system.system_core import load_system
    from fusesoc_firm.text.outputs import write

    board = read_board(arguments.board)
    known = libraries_beside(arguments.spec, arguments.path, arguments.distro, core_folders=core_folders)
    loaded = load_system(
        arguments.spec,
        known,
        needs_sources=False,
        changed=partial(on_board, board=board),
        core_folders=core_folders,
    )
    print_warnings(loaded.warnings)
    files = bring_up_files(loaded.system, board, arguments.memory, is_reserved=arguments.reserve)
    for name, text in files.items():
        write(arguments.output / name, text)
        print(arguments.output / name)


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
