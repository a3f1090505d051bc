"""The shared parts of the `firm` commands: declarations, and loading and writing for most commands."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from fusesoc_firm.text.diagnostics import closest, nearest

if TYPE_CHECKING:
    from fusesoc_firm.message.library import MessageLibrary
    from fusesoc_firm.system.boards.board import Board
    from fusesoc_firm.system.system_core import LoadedSystem
    from fusesoc_firm.text.diagnostics import Diagnostic, SourceRef

Handler = Callable[[argparse.Namespace], None]


class Parser(argparse.ArgumentParser):
    """A parser that answers a wrong word with the nearest legal one."""

    def commands(self) -> dict[str, argparse.ArgumentParser]:
        """Return the parsers of the commands or actions by name."""
        groups = [action for action in self._actions if isinstance(action, argparse._SubParsersAction)]  # noqa: SLF001
        return dict(groups[0].choices) if groups else {}

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """End the program because of words that the parser does not know."""
        if "--ros-args" in words:
            self.error("'--ros-args' is an option of 'firm live', which runs a system as a node of ROS")
        known = self._option_string_actions
        near = next((near for word in words if (near := closest(word.partition("=")[0], known))), None)
        self.error(f"unrecognized arguments: {' '.join(words)}{f'; did you mean {near!r}?' if near else ''}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            hint = nearest(str(value), map(str, action.choices))
            raise argparse.ArgumentError(action, f"invalid choice: '{value}'; {hint}")


def command(
    commands: Any, name: str, text: str, example: str, handler: Handler | None = None
) -> argparse.ArgumentParser:
    """Return a command's parser with its help, an example and a description."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}.",
        epilog=f"example: {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(parser=parser)
    if handler:
        parser.set_defaults(handler=handler)
    return parser


def add_spec(parser: argparse.ArgumentParser) -> None:
    """Add the specification as an argument; without it, the command gets that of the current folder."""
    parser.add_argument(
        "spec",
        metavar="SPEC",
        type=Path,
        nargs="?",
        help="the system's YAML specification, or its folder (default: that of this folder)",
    )


def positive(text: str) -> int:
    """Return an argument's value, which must be a positive integer."""
    return _at_least(1, text)


def natural(text: str) -> int:
    """Return an argument's value, which must be a non-negative integer."""
    return _at_least(0, text)


def _at_least(least: int, text: str) -> int:
    if not re.fullmatch(r"[+-]?\d+", text):
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number")
    if int(text) < least:
        raise argparse.ArgumentTypeError(f"{text} is less than {least}")
    return int(text)


def add_definitions(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of commands about the messages of one ROS version."""
    parser.add_argument("--ros", type=int, choices=(1, 2), default=2, help="the ROS version (default: 2)")
    add_sources(parser)


def add_sources(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that locate message definitions."""
    parser.add_argument(
        "--path",
        type=Path,
        action="append",
        default=[],
        metavar="PLACE",
        help="a folder or bag with message definitions; may be repeated",
    )
    parser.add_argument("--distro", metavar="NAME", help="the ROS distribution that provides the standard messages")


def library_of(arguments: argparse.Namespace, ros: int) -> MessageLibrary:
    """Return the library with the messages that the arguments select."""
    from fusesoc_firm.message.library import MessageLibrary
    from fusesoc_firm.message.middleware import middleware_of

    return MessageLibrary(middleware_of(ros), arguments.path, environment=os.environ, store=arguments.distro)


def load(arguments: argparse.Namespace, *, needs_sources: bool = True) -> LoadedSystem:
    """Load the system of the specification in the arguments, and print its warnings.

    Missing sources of accelerators are an error only if `needs_sources` is set. May raise `InputError`.
    """
    from fusesoc_firm.system.message_sources import load_beside

    loaded = load_beside(
        arguments.spec, arguments.path, arguments.distro, needs_sources=needs_sources, core_folders=core_folders
    )
    print_warnings(loaded.warnings)
    return loaded


def load_on_board(arguments: argparse.Namespace) -> tuple[LoadedSystem, Board]:
    """Load the system of the specification in the arguments for the board in them, and print its warnings.

    The board provides the keys that the specification lacks. May raise `InputError`.
    """
    from fusesoc_firm.system.boards.board import on_board, read_board
    from fusesoc_firm.system.message_sources import libraries_beside
    from fusesoc_firm.system.system_core import load_system

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
    return loaded, board


def coloured(text: str, *, is_good: bool) -> str:
    """Return a text in green or red for a terminal, and unchanged for a file or if `NO_COLOR` is set."""
    if not sys.stdout.isatty() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return text
    return f"\033[{32 if is_good else 31}m{text}\033[0m"


def terminal_width() -> int:
    """Return the number of columns of the terminal, or a default."""
    return shutil.get_terminal_size((100, 24)).columns


def print_step(step: str) -> None:
    """Show the current step of long work in the last line of a terminal; an empty step removes the line."""
    print(f"\r\033[K{step[: terminal_width() - 1]}", end="", file=sys.stderr, flush=True)


def print_warnings(warnings: Iterable[Diagnostic]) -> None:
    """Print warnings on standard error."""
    for warning in warnings:
        print(warning, file=sys.stderr)


def check_sources(loaded: LoadedSystem, spec: Path) -> tuple[Diagnostic, ...]:
    """Compare a system's accelerators with their interfaces, and return the warnings. May raise `InputError`."""
    from fusesoc_firm.accelerator.check import check_accelerators
    from fusesoc_firm.accelerator.unit import Libraries
    from fusesoc_firm.builds.setup.sources import vhdl_sources
    from fusesoc_firm.system.message_sources import core_of

    def libraries() -> Libraries:
        core = core_of(spec)
        if core is None:
            return Libraries()
        found = vhdl_sources(str(core.data.get("name", "")), core.path.parent)
        return Libraries(found.files, found.standard, found.options, found.is_complete, core_with=found.core_with)

    return check_accelerators(loaded, libraries)


def core_folders(names: Mapping[str, SourceRef | None]) -> tuple[Path, ...]:
    """Return the folders of message cores that FuseSoC finds from the current folder. May raise `InputError`."""
    # FuseSoC is imported only if needed.
    from fusesoc_firm.builds.project import message_folders

    return message_folders(names) if names else ()


def add_picture(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of commands that draw a graph, for `pictures.draw`."""
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="F.svg",
        help="the file to write; .png, .pdf and .dot are legal, too (default: print the picture)",
    )
    parser.add_argument("--format", choices=("svg", "dot"), help="format of the printed picture (default: svg)")


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add the option for `print_json`."""
    parser.add_argument("--json", action="store_true", help="print the result as JSON, for other programs")


def print_json(data: object) -> None:
    """Print data for other programs."""
    from fusesoc_firm.text.json_text import json_text

    print(json_text(data, 2))
