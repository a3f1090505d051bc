"""`firm ip-xact`: package a core's target as an IP-XACT component, for block designs."""

from __future__ import annotations

import argparse
from typing import Any

from fusesoc_firm.cli.common import command
from fusesoc_firm.cli.packaged import add_target, packaged

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
    add_target(parser)
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


def _package(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.export.ip_xact.package import write_package
    from fusesoc_firm.export.ip_xact.writer import STANDARDS, vlnv

    made = packaged(arguments, arguments.view)
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
