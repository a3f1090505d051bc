"""`firm system bring-up`: write the files that bring up a board under Linux."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import command, load_on_board, positive

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


def _write_files(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.boards.overlay import bring_up_files
    from fusesoc_firm.text.outputs import write

    loaded, board = load_on_board(arguments)
    files = bring_up_files(loaded.system, board, arguments.memory, is_reserved=arguments.reserve)
    for name, text in files.items():
        write(arguments.output / name, text)
        print(arguments.output / name)
