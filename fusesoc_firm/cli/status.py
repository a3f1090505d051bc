"""`firm status`: print the status of hardware. `firm registers`: write the registers' description, header and page."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import add_json, add_sources, add_spec, command, load, print_json
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.system.derived.model import BlockParameter


def add_status(commands: Any) -> None:
    """Declare the commands."""
    status = command(
        commands,
        "status",
        "print what a system's hardware has counted; if a node uses the hardware, the node is asked",
        "firm status uart:/dev/ttyUSB1:1000000:rtscts --system robot.yaml",
        _print_status,
    )
    status.add_argument(
        "address",
        metavar="ADDRESS",
        help="the transport to the hardware, node:SYSTEM for the running node of a system, axi:UIO for a status "
        "with AXI4-Lite, such as axi:/dev/uio1, or udp:ADDRESS for a node in fabric, such as udp:192.168.1.20",
    )
    status.add_argument(
        "--system",
        type=Path,
        metavar="SPEC",
        help="the system's specification, for names and to compare the digest; needed if it has 'idBytes: 2'",
    )
    add_json(status)
    add_sources(status)
    registers = command(
        commands,
        "registers",
        "write a system's status registers: SystemRDL, C header, Python package and HTML page",
        "firm registers robot.yaml -o registers",
        _write_registers,
    )
    add_spec(registers)
    registers.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="the folder to write")
    add_sources(registers)


def _print_status(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.node.status.status import (
        check_digest,
        parameters_text,
        read_parameters,
        read_status,
        status_data,
        status_text,
    )
    from fusesoc_firm.node.status.status_socket import NodeTransport, open_status
    from fusesoc_firm.node.transport.transport import TransportError
    from fusesoc_firm.system.derived.ids import ONE_BYTE
    from fusesoc_firm.system.system_core import identity

    names: list[str] = []
    expected, id_bytes = "", ONE_BYTE
    known: Iterable[BlockParameter] = ()
    if arguments.system:
        arguments.spec = arguments.system
        loaded = load(arguments, needs_sources=False)
        names = [item.block for item in (*loaded.system.subscribers, *loaded.system.publishers)]
        expected, id_bytes = identity(loaded).digest, loaded.system.id_bytes
        known = loaded.system.parameters
    try:
        with open_status(arguments.address) as transport:
            if expected:
                check_digest(transport, expected, loaded.system.name, id_bytes)
            elif isinstance(transport, NodeTransport):
                known = transport.parameters()
            status = read_status(transport, id_bytes)
            parameters = read_parameters(transport, [*known], id_bytes)
    except TransportError as error:
        fail(str(error))
    if arguments.json:
        print_json(status_data(status, names, parameters))
        return
    print(status_text(status, names))
    if parameters:
        print(parameters_text(parameters))


def _write_registers(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.register_files import write_register_files

    write_register_files(load(arguments, needs_sources=False), arguments.output)
    print(arguments.output)
