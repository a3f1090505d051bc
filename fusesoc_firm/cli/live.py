"""`firm live`: run a simulated system as a ROS node. `firm trace`: draw the stages of the node's messages."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from fusesoc_firm.cli.common import add_sources, add_spec, command, load
from fusesoc_firm.cli.simulator import add_simulator_options, built_board, built_simulator
from fusesoc_firm.cli.studio import add_watch, watched
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.fabric.simulated_board import SimulatedBoard
    from fusesoc_firm.system.system_core import LoadedSystem


# The options that do not apply to a simulated board, since it is the node.
_OF_NODES = ("trace", "watch", "status", "name", "qos", "queue", "restart", "lifecycle", "ros_python", "ros_args")


def add_live(commands: Any) -> None:
    """Declare the commands."""
    from fusesoc_firm.node.interface.options import add_node_options

    live = command(
        commands,
        "live",
        "run a ROS node that connects topics to a system in simulation or on a board",
        "firm live robot.yaml --ros 1 --trace ways.csv sub:=/imu/orientation",
        _live,
    )
    add_spec(live)
    live.add_argument(
        "--ros", type=int, choices=(1, 2), help="connect only topics of this ROS version (default: all topics)"
    )
    live.add_argument(
        "--transport", metavar="ADDRESS", help="the transport to the hardware (default: build and start a simulator)"
    )
    live.add_argument(
        "--network", metavar="TAP", help="the TAP device at which a simulated board with interconnect ethernet is"
    )
    add_watch(live)
    add_node_options(live)
    add_simulator_options(live)
    live.set_defaults(remappings=[])
    trace = command(
        commands,
        "trace",
        "draw the message trace that a node wrote with --trace",
        "firm trace ways.csv -o ways.svg",
        _draw_trace,
    )
    trace.add_argument("table", metavar="F.csv", type=Path, help="the trace that the node wrote")
    trace.add_argument(
        "--system", type=Path, metavar="SPEC", help="the system's specification; required for the trace of a C++ node"
    )
    trace.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="F.svg",
        help="the picture to write; .png and .pdf are legal, too (default: beside the trace)",
    )
    add_sources(trace)


def _live(arguments: argparse.Namespace) -> None:
    loaded = load(arguments)
    if loaded.system.network and not arguments.transport:
        _run_board(arguments, loaded)
    elif arguments.network:
        _fail_for_network(arguments, loaded)
    else:
        _run_node(arguments, loaded)


def _run_board(arguments: argparse.Namespace, loaded: LoadedSystem) -> None:
    """Run the simulated board of a system that is a node itself."""
    from fusesoc_firm.system.written.specification import ETHERNET

    _refuse_options(arguments, loaded)
    is_ethernet = loaded.specification.project.interconnect == ETHERNET
    if bool(arguments.network) != is_ethernet:
        _fail_for_network(arguments, loaded)
    board, line = _at_device(arguments, loaded) if is_ethernet else _in_sockets(arguments, loaded)
    print(f"{line}; Ctrl-C ends it", flush=True)
    try:
        board.run()
    except KeyboardInterrupt:
        print()
    finally:
        board.close()


def _in_sockets(arguments: argparse.Namespace, loaded: LoadedSystem) -> tuple[SimulatedBoard, str]:
    """Return the board of a node in the sockets of a chip, and a line about it."""
    from fusesoc_firm.fabric.ros1 import PORT, node_of
    from fusesoc_firm.fabric.wiznet.board import Board, check_address
    from fusesoc_firm.fabric.wiznet.chips import MODELS
    from fusesoc_firm.system.hardware.interconnect import CHIP_NUMBERS
    from fusesoc_firm.system.scaffold.core_file import NETWORK_HERTZ

    network = loaded.system.network
    assert network is not None
    node = node_of(loaded.system, loaded.libraries)
    check_address(network.address, PORT)
    built = built_board(arguments)
    # The build may have taken minutes.
    check_address(network.address, PORT)
    chip = MODELS[CHIP_NUMBERS[network.kind]]()
    board = Board(built.words, built.folder, chip, NETWORK_HERTZ[network.kind.value])
    master = "{}:{}".format(*node.master)
    return board, f"{node.name} is at {network.address}; its master is {master}"


def _at_device(arguments: argparse.Namespace, loaded: LoadedSystem) -> tuple[SimulatedBoard, str]:
    """Return the board of a node by Ethernet at a TAP device, and a line about it."""
    from fusesoc_firm.fabric.ethernet_board import Board, Tap
    from fusesoc_firm.system.scaffold.core_file import NETWORK_HERTZ

    network = loaded.system.network
    assert network is not None
    Tap(arguments.network).close()
    built = built_board(arguments)
    board = Board(built.words, built.folder, Tap(arguments.network), NETWORK_HERTZ[network.kind.value])
    name = f"{network.namespace.rstrip('/')}/{network.name}"
    place = f"at {arguments.network}, in domain {network.domain}"
    if network.has_dhcp:
        board.on_address = lambda address: print(
            f"{name} {f'is at {address}' if address else 'has lost its address'}, {place}", flush=True
        )
        return board, f"{name} asks for an address by DHCP, {place}"
    return board, f"{name} is at {network.address}, {place}"


def _fail_for_network(arguments: argparse.Namespace, loaded: LoadedSystem) -> NoReturn:
    """Raise `InputError` for a missing or unusable device."""
    from fusesoc_firm.system.written.specification import ETHERNET

    interconnect = loaded.specification.project.interconnect
    if arguments.network:
        fail(f"'--network' is not possible with interconnect '{interconnect}'", hint=f"it is for '{ETHERNET}'")
    hint = "add '--network' with a TAP device, such as '--network tap0'"
    fail(f"a simulated board with interconnect '{interconnect}' needs a network", interconnect.source, hint)


def _refuse_options(arguments: argparse.Namespace, loaded: LoadedSystem) -> None:
    """Raise `InputError` for an option about a node on the host: the simulated board is the node."""
    version = next(iter(loaded.system.frames)).ros.number
    given = [f"--{name.replace('_', '-')}" for name in _OF_NODES if getattr(arguments, name)]
    given += [*arguments.remappings, *([f"--ros {arguments.ros}"] if arguments.ros not in (None, version) else [])]
    if given:
        fail(
            f"'{given[0]}' is not possible with interconnect '{loaded.specification.project.interconnect}'",
            hint="the simulated board is the node; its names are those of the specification",
        )


def _run_node(arguments: argparse.Namespace, loaded: LoadedSystem) -> None:
    from fusesoc_firm.node.interface.description import describe
    from fusesoc_firm.node.live_run import run_node, run_options
    from fusesoc_firm.node.reopening import at_address, of_simulator
    from fusesoc_firm.text.outputs import check_output

    description = describe(loaded)
    options = run_options(arguments, arguments.remappings, description, arguments.ros)
    if arguments.trace:
        # The file is opened only after the simulator is built.
        check_output(arguments.trace)
    if arguments.transport:
        opener = at_address(arguments.transport)
    else:
        opener = of_simulator(built_simulator(arguments), arguments.seed, arguments.stall_percent)
    with watched(arguments, loaded, "firm live") as run:
        settings = replace(options.settings, watch=run.watch if run else None)
        run_node(description, opener, replace(options, settings=settings), loaded, arguments.transport or "")


def _draw_trace(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.node.engine.cpp_trace import are_steps
    from fusesoc_firm.node.engine.trace_picture import draw_trace

    table: Path = arguments.table
    output: Path = arguments.output or table.with_suffix(".svg")
    if are_steps(table):
        table = _ways_of_steps(table, arguments)
    draw_trace(table, output)
    print(output)


def _ways_of_steps(steps: Path, arguments: argparse.Namespace) -> Path:
    """Convert a table of steps to an adjacent table of routes; return the path of the table of routes."""
    from fusesoc_firm.node.engine.cpp_trace import write_ways
    from fusesoc_firm.node.interface.description import describe

    if not arguments.system:
        fail(
            f"{steps} is a C++ node's trace, which contains no names",
            hint="add the system's specification with --system SPEC",
        )
    arguments.spec = arguments.system
    table = steps.with_name(f"{steps.stem}-ways.csv")
    write_ways(steps, table, describe(load(arguments, needs_sources=False)))
    print(table)
    return table
