"""`firm ip-xact`: package a core's target as an IP-XACT component, for block designs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import command
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import make_folder, shown

_VIEWS = ("sources", "netlist")
_YEARS = (2009, 2014, 2022)


def add_ip_xact(commands: Any) -> None:
    """Declare the command."""
    parser = command(
        commands,
        "ip-xact",
        "package a core's target as an IP-XACT component, for the block designs of Vivado and other tools",
        "firm ip-xact robot.yaml -o ip/robot",
        _package,
    )
    parser.add_argument(
        "system",
        metavar="SPEC|CORE",
        nargs="?",
        help="a specification with a core beside it, or a core's name in FuseSoC (default: the core in this folder)",
    )
    parser.add_argument("--target", metavar="TARGET", default="default", help="the core's target (default: default)")
    parser.add_argument(
        "--view",
        choices=_VIEWS,
        default=_VIEWS[0],
        help="the files of the component: the sources, or a Verilog netlist of the VHDL (default: sources)",
    )
    parser.add_argument(
        "--standard",
        type=int,
        choices=_YEARS,
        default=_YEARS[0],
        help="the year of IEEE 1685; Vivado reads only 2009, with its own extensions (default: 2009)",
    )
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="the folder to write")


def _package(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.cli.failed_build import print_errors
    from fusesoc_firm.cli.here import core_named
    from fusesoc_firm.cli.progress import Progress
    from fusesoc_firm.ip_xact.design import plan_target
    from fusesoc_firm.ip_xact.package import package, write_package
    from fusesoc_firm.ip_xact.writer import STANDARDS, vlnv

    core, folder = core_named(arguments.system)
    make_folder(arguments.output)
    target = plan_target(core, folder, arguments.target)
    with Progress(f"generating the files of {target.build}") as progress:
        status = target.set_up(progress.step)
        if not status:
            progress.step(f"reading the top unit of {target.build}")
            made = package(target.read(), arguments.view)
    if status:
        print_errors(target.build, folder, None)
        fail(f"FuseSoC cannot set up {target.build}", hint=f"the whole output: {shown(target.build.log)}")
    write_package(made, arguments.standard, arguments.output)
    component = made.component
    name = ":".join(vlnv(component, STANDARDS[arguments.standard]))
    interfaces = ", ".join(interface.name for interface in component.interfaces)
    print(f"component:  {name}, IEEE 1685-{arguments.standard}, {arguments.view}")
    print(f"interfaces: {interfaces or 'none'}; {len(component.ports)} ports")
    print(f"written:    {arguments.output / 'component.xml'} and {len(made.places)} files of the hardware")
    if arguments.standard == _YEARS[0]:
        print(
            f"next:       in Vivado's Tcl console: set_property ip_repo_paths {{{arguments.output}}} [current_project]"
        )
