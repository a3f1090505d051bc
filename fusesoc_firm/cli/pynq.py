"""`firm pynq`: write the overlay of a system as a Python package for PYNQ."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import add_sources, add_spec, command, load_on_board


def add_pynq(commands: Any) -> None:
    """Declare the command."""
    parser = command(
        commands,
        "pynq",
        "write a system's overlay for PYNQ: a Python package with a driver and a notebook",
        "firm pynq robot.yaml --board zynq7000 -o overlay",
        _write_package,
    )
    add_spec(parser)
    add_sources(parser)
    parser.add_argument("--board", metavar="BOARD", required=True, help="the board, or the path of a board file")
    parser.add_argument(
        "--build",
        type=Path,
        metavar="DIR",
        help="the folder of Vivado's project, from which the bitstream and its description are copied",
    )
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="the folder to write")


def _write_package(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.export.pynq.package import built_files, overlay_files, overlay_name
    from fusesoc_firm.text.outputs import write

    loaded, board = load_on_board(arguments)
    files: dict[str, str | bytes] = {**overlay_files(loaded, board)}
    name = overlay_name(loaded, board)
    if arguments.build:
        files |= {path: place.read_bytes() for path, place in built_files(arguments.build, name).items()}
    for path, content in files.items():
        write(arguments.output / path, content)
        print(arguments.output / path)
    if not arguments.build:
        print(f"missing: {name}.bit and {name}.hwh, which Vivado writes; see {arguments.output / 'README.md'}")
