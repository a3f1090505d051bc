"""`firm wrap`: write a module of LiteX or Amaranth around a core's netlist."""

from __future__ import annotations

import argparse
from typing import Any

from fusesoc_firm.cli.common import command
from fusesoc_firm.cli.packaged import add_target, packaged

_FRAMEWORKS = ("litex", "amaranth")
_NETLIST = "netlist"


def add_wrap(commands: Any) -> None:
    """Declare the command."""
    parser = command(
        commands,
        "wrap",
        "write a module of LiteX or Amaranth around the Verilog netlist of a core's target",
        "firm wrap --framework litex robot.yaml -o litex/robot",
        _wrap,
    )
    add_target(parser)
    parser.add_argument("--framework", choices=_FRAMEWORKS, required=True, help="the framework of the module")


def _wrap(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.export.wrapper.wrapper import write_wrapper

    made = packaged(arguments, _NETLIST)
    module, *files = write_wrapper(made, arguments.framework, arguments.output)
    interfaces = ", ".join(interface.name for interface in made.component.interfaces)
    print(f"module:     {module}")
    print(f"interfaces: {interfaces or 'none'}; {len(made.component.ports)} ports")
    print(f"files:      {', '.join(map(str, files))}")
