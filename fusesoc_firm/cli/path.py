"""`firm path`: print the folders of the library, of the demo systems and of the pages."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import command


def add_path(commands: Any) -> None:
    """Declare the command."""
    path = command(
        commands,
        "path",
        "print the folder of the FuseSoC library of reusable cores and generators",
        'fusesoc library add firm "$(firm path)"',
        _print_path,
    )
    kind = path.add_mutually_exclusive_group()
    kind.add_argument("--demos", action="store_true", help="print the folder of the demo systems instead")
    kind.add_argument("--docs", action="store_true", help="print the folder of the documentation instead")
    path.add_argument(
        "--relative",
        action="store_true",
        help="print a path relative to the current folder, for a fusesoc.conf in version control",
    )


def _print_path(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.tools.library_path import demos_root, docs_root, library_root

    folder = demos_root() if arguments.demos else docs_root() if arguments.docs else library_root()
    # Resolve links on both sides, so that `..` leads to the right folder.
    print(os.path.relpath(folder, Path.cwd().resolve()) if arguments.relative else folder)
