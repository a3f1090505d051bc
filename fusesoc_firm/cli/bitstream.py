"""`firm bitstream`: build a system for a board. `firm load`: load the result onto the board."""

from __future__ import annotations

import argparse
import shlex
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import command
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import shown

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.bitstream import BoardBuild

_LOADER = "openFPGALoader"


def add_bitstream(commands: Any) -> None:
    """Declare the commands."""
    bitstream = command(
        commands,
        "bitstream",
        "build a system for a board, and print the area and the clock that it reaches",
        "firm bitstream --board ulx3s",
        _build,
    )
    _add_build(bitstream)
    detail = bitstream.add_mutually_exclusive_group()
    detail.add_argument("-v", "--verbose", action="store_true", help="print the tools' output as it appears")
    detail.add_argument("-q", "--quiet", action="store_true", help="print only errors")
    load = command(
        commands,
        "load",
        f"load a bitstream onto a board with {_LOADER}, or print the command",
        "firm load --board ulx3s",
        _load,
    )
    _add_build(load)
    load.add_argument("--flash", action="store_true", help="write the board's flash memory, which survives power-off")


def _add_build(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "system",
        metavar="SPEC|CORE",
        nargs="?",
        help="a specification with a core beside it, or a core's name in FuseSoC (default: the core in this folder)",
    )
    parser.add_argument("--board", metavar="BOARD", help="the board (default: the only one that has been built)")


def _chosen(arguments: argparse.Namespace) -> tuple[BoardBuild, Path | None]:
    from fusesoc_firm.builds.setup.bitstream import board_builds, choose
    from fusesoc_firm.cli.here import core_named

    core, folder = core_named(arguments.system)
    return choose(board_builds(core, folder), arguments.board), folder


def _build(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.builds.setup.logged_run import run_logged
    from fusesoc_firm.cli.check import check_core_file
    from fusesoc_firm.cli.failed_build import print_errors
    from fusesoc_firm.cli.progress import Progress

    chosen, folder = _chosen(arguments)
    chosen.check_programs()
    loaded = check_core_file(chosen.core_file)
    with Progress(f"building for {chosen.board}", is_shown=not (arguments.verbose or arguments.quiet)) as progress:

        def tell(line: str) -> None:
            if arguments.verbose:
                print(line, flush=True)
            progress.step(f"building for {chosen.board}: {line}")

        status = run_logged(chosen.build, ("--setup", "--build"), (), tell)
    bitstream = chosen.bitstream
    if status or bitstream is None:
        if not arguments.verbose:
            print_errors(chosen.build, folder, loaded)
        for line in chosen.figures():
            print(line)
        fail(f"there is no bitstream for {chosen.board}", hint=f"the whole output: {shown(chosen.build.log)}")
    if not arguments.quiet:
        print(f"bitstream: {shown(bitstream)}", *chosen.figures(), f"log:       {shown(chosen.build.log)}", sep="\n")
        print(f"next:      firm load {_words(arguments.system, chosen.board)}")


def _words(system: str | None, board: str) -> str:
    return " ".join([*([system] if system else []), f"--board {board}"])


def _load(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.boards.board import read_board
    from fusesoc_firm.system.derived.model import LinkKind
    from fusesoc_firm.system.message_sources import spec_of
    from fusesoc_firm.tools.programs import find, ways

    chosen, _ = _chosen(arguments)
    bitstream = chosen.bitstream
    if bitstream is None:
        step = f"firm bitstream {_words(arguments.system, chosen.board)}"
        fail(f"there is no bitstream for {chosen.board}", hint=f"build it: {step}")
    board = read_board(chosen.board)
    if board.loader is None:
        fail(
            f"{_LOADER} has no name for the board '{chosen.board}'",
            hint=f"load {shown(bitstream)} with the board's own program, or add the key 'loader' to the board's file",
        )
    words = ["-b", str(board.loader), *(["-f"] if arguments.flash else []), shown(bitstream)]
    line = shlex.join([_LOADER, *words])
    if not (program := find(_LOADER)):
        fail(f"{_LOADER} is not installed: {ways(_LOADER)}", hint=f"then run: {line}")
    if status := subprocess.run([program, *words], check=False).returncode:
        fail(f"{line} ended with status {status}", hint="check the cable, the power and the rights of the USB device")
    if board.interconnect == LinkKind.UART.value and (spec := spec_of(chosen.core_file)):
        print(f"next: firm live {shown(spec)} --transport uart:/dev/ttyUSB1:1000000")
