"""`firm bitstream`: build a system for a board. `firm load`: load the result onto the board."""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import command
from fusesoc_firm.text.diagnostics import InputError, fail
from fusesoc_firm.text.json_text import json_text
from fusesoc_firm.text.outputs import shown

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.bitstream import BoardBuild, Figures, Step
    from fusesoc_firm.system.system_core import LoadedSystem

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
    _add_json(detail)
    load = command(
        commands,
        "load",
        f"load a bitstream onto a board with {_LOADER}, or print the command",
        "firm load --board ulx3s",
        _load,
    )
    _add_build(load)
    load.add_argument("--flash", action="store_true", help="write the board's flash memory, which survives power-off")
    _add_json(load)


def _add_build(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "system",
        metavar="SPEC|CORE",
        nargs="?",
        help="a specification with a core beside it, or a core's name in FuseSoC (default: the core in this folder)",
    )
    parser.add_argument("--board", metavar="BOARD", help="the board (default: the only one that has been built)")


def _add_json(parser: argparse._ActionsContainer) -> None:
    parser.add_argument(
        "--json", action="store_true", help="print steps and result as lines of JSON, for other programs"
    )


def _chosen(arguments: argparse.Namespace) -> tuple[BoardBuild, Path | None]:
    from fusesoc_firm.builds.setup.bitstream import board_builds, choose
    from fusesoc_firm.cli.here import core_named

    core, folder = core_named(arguments.system)
    return choose(board_builds(core, folder), arguments.board), folder


@contextmanager
def _answer(arguments: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Within the context, collect the result of a command; with `--json`, print it or the faults at the end."""
    answer: dict[str, Any] = {}
    try:
        yield answer
    except InputError as error:
        if not arguments.json:
            raise
        _print_line(answer | {"state": "failed", "faults": [item.data() for item in error.shown()]})
        sys.exit(1)
    if arguments.json:
        _print_line(answer | {"state": "done"})


def _print_line(data: object) -> None:
    print(json_text(data), flush=True)


def _build(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.cli.failed_build import error_lines

    with _answer(arguments) as answer:
        chosen, folder = _chosen(arguments)
        chosen.check_programs()
        status, loaded = _run(arguments, chosen)
        figures, log, bitstream = chosen.figures(), shown(chosen.build.log), chosen.bitstream
        answer.update(figures.data(), log=log)
        if status or bitstream is None:
            answer["output"] = [*error_lines(chosen.build, folder, loaded)]
            _print_failure(arguments, answer["output"], figures)
            cure = "; register stages in the accelerator shorten its longest path" if figures.is_too_slow else ""
            fail(f"there is no bitstream for {chosen.board}", hint=f"the whole output: {log}{cure}")
        limits = _limits(chosen, loaded) if loaded else []
        next_command = f"firm load {_words(arguments.system, chosen.board)}"
        answer.update(bitstream=shown(bitstream), limits=limits, next=next_command)
    if not (arguments.quiet or arguments.json):
        lines = [*figures.lines(), *(f"limit:     {limit}" for limit in limits)]
        print(f"bitstream: {answer['bitstream']}", *lines, f"log:       {log}", sep="\n")
        print(f"next:      {answer['next']}")


def _limits(chosen: BoardBuild, loaded: LoadedSystem) -> list[str]:
    """Return the longest payloads on the board, which are shorter on a link, where the specification has none."""
    from fusesoc_firm.system.scaffold.board_targets import placed
    from fusesoc_firm.system.views.show import default_lengths

    return default_lengths(placed(loaded, chosen.board_file))


def _print_failure(arguments: argparse.Namespace, errors: Sequence[str], figures: Figures) -> None:
    """Print the errors of the tools, if they are not printed yet, and what is known of the layout."""
    if arguments.json:
        return
    for line in () if arguments.verbose else errors:
        print(line, file=sys.stderr)
    for line in figures.lines():
        print(line)


def _run(arguments: argparse.Namespace, chosen: BoardBuild) -> tuple[int, LoadedSystem | None]:
    """Check and build a system; print the steps or show them as progress. Return FuseSoC's status and the system."""
    from fusesoc_firm.builds.setup.bitstream import CHECK
    from fusesoc_firm.cli.check import check_core_file
    from fusesoc_firm.cli.progress import Progress

    is_shown = not (arguments.verbose or arguments.quiet or arguments.json)
    with Progress(f"building for {chosen.board}", is_shown=is_shown) as progress:

        def tell(step: Step) -> None:
            if arguments.json:
                _print_line(asdict(step))
            elif arguments.verbose and step.line:
                print(step.line, flush=True)
            progress.step(f"building for {chosen.board}: {step}")

        tell(chosen.step(CHECK))
        loaded = check_core_file(chosen.core_file)
        return chosen.run(tell), loaded


def _words(system: str | None, board: str) -> str:
    return " ".join([*([system] if system else []), f"--board {board}"])


def _load(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.derived.model import LinkKind
    from fusesoc_firm.system.message_sources import spec_of
    from fusesoc_firm.tools.programs import find, ways

    with _answer(arguments) as answer:
        chosen, _ = _chosen(arguments)
        bitstream = chosen.bitstream
        if bitstream is None:
            step = f"firm bitstream {_words(arguments.system, chosen.board)}"
            fail(f"there is no bitstream for {chosen.board}", hint=f"build it: {step}")
        board = chosen.board_file
        if board.loader is None:
            fail(
                f"{_LOADER} has no name for the board '{chosen.board}'",
                hint=f"load {shown(bitstream)} with the board's own program, "
                "or add the key 'loader' to the board's file",
            )
        words = ["-b", str(board.loader), *(["-f"] if arguments.flash else []), shown(bitstream)]
        line = shlex.join([_LOADER, *words])
        if not (program := find(_LOADER)):
            fail(f"{_LOADER} is not installed: {ways(_LOADER)}", hint=f"then run: {line}")
        if status := _run_loader([str(program), *words], arguments):
            fail(
                f"{line} ended with status {status}", hint="check the cable, the power and the rights of the USB device"
            )
        if board.interconnect == LinkKind.UART.value and (spec := spec_of(chosen.core_file)):
            answer["next"] = f"firm live {shown(spec)} --transport uart:/dev/ttyUSB1:1000000"
    if "next" in answer and not arguments.json:
        print(f"next: {answer['next']}")


def _run_loader(words: list[str], arguments: argparse.Namespace) -> int:
    """Run the loader, whose output belongs to the terminal or, with `--json`, to the steps; return its status."""
    if not arguments.json:
        return subprocess.run(words, check=False).returncode
    # In text mode, each state of a bar that the loader draws over the former one is a line.
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace") as run:
        assert run.stdout
        for line in run.stdout:
            _print_line({"step": "load", "number": 1, "count": 1, "line": line.strip()})
    return run.returncode
