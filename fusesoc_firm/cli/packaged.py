"""The target that a command packages: its arguments, and its component."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import make_folder, shown

if TYPE_CHECKING:
    from fusesoc_firm.export.component.package import Package


def add_target(parser: argparse.ArgumentParser) -> None:
    """Add the core, its target and the folder to write as arguments."""
    parser.add_argument(
        "system",
        metavar="SPEC|CORE",
        nargs="?",
        help="a specification with a core beside it, or a core's name in FuseSoC (default: the core in this folder)",
    )
    parser.add_argument("--target", metavar="TARGET", default="default", help="the core's target (default: default)")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="the folder to write")


def packaged(arguments: argparse.Namespace, view: str) -> Package:
    """Let FuseSoC generate the target's files, and return its component. May raise `InputError`."""
    from fusesoc_firm.cli.failed_build import print_errors
    from fusesoc_firm.cli.here import core_named
    from fusesoc_firm.cli.progress import Progress
    from fusesoc_firm.export.component.design import plan_target
    from fusesoc_firm.export.component.package import package

    core, folder = core_named(arguments.system)
    make_folder(arguments.output)
    target = plan_target(core, folder, arguments.target)
    with Progress(f"generating the files of {target.build}") as progress:
        status = target.set_up(progress.step)
        if not status:
            progress.step(f"reading the top unit of {target.build}")
            made = package(target.read(), view)
    if status:
        print_errors(target.build, folder, None)
        fail(f"FuseSoC cannot set up {target.build}", hint=f"the whole output: {shown(target.build.log)}")
    return made
