"""`firm live`: run a simulated system as a ROS node. `firm trace`: draw the stages of the node's messages."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import add_sources, command, load
from fusesoc_firm.cli.simulator import add_simulator_options, built_board, built_simulator
from fusesoc_firm.cli.studio import add_watch, watched
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.system.system_core import LoadedSystem


# The options that a simulated board cannot serve, since it is the node.
_OF_NODES = ("trace", "watch", "status", "name", "qos", "queue", "restart", "lifecycle", "ros_python", "ros_args")


def add_live(commands: Any) -> None:
    """Declare the commands."""
    from fusesoc_firm.node.options import add_node_options

    live = command(
        commands,
        "live",
        "run a ROS node that connects topics to a system in simulation or on a board",
        "firm live robot.yaml --ros 1 --trace ways.csv sub:=/imu/orientation",
        _live,
    )
    live.add_argument("spec", metavar="SPEC", type=Path, help="the system's YAML specification")
    live.add_argument(
        "--ros", type=int, choices=(1, 2), help="connect only topics of this ROS version (default: all topics)"
    )
    live.add_argument(
        "--transport", metavar="ADDRESS", help="the transport to the hardware (default: build and start a simulator)"
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
    else:
        _run_node(arguments, loaded)


def _run_board(arguments: argparse.Namespace, loaded: LoadedSystem) -> None:
    """Run the simulated board of a system that is a node in the sockets of a chip."""
    from fusesoc_firm.fabric.ros1 import PORT, node_of
    from fusesoc_firm.fabric.wiznet.board import Board, check_address
    from fusesoc_firm.fabric.wiznet.chips import MODELS
    from fusesoc_firm.system.hardware.interconnect import CHIP_NUMBERS
    from fusesoc_firm.system.scaffold.core_file import NETWORK_HERTZ
    from fusesoc_firm.system.system_core import refuse_network

    refuse_network(loaded)
    _refuse_options(arguments, loaded)
    network = loaded.system.network
    assert network is not None
    node = node_of(loaded.system, loaded.libraries)
    check_address(network.address, PORT)
    built = built_board(arguments)
    # The build may have taken minutes.
    check_address(network.address, PORT)
    chip = MODELS[CHIP_NUMBERS[network.kind]]()
    board = Board(built.words, built.folder, chip, NETWORK_HERTZ)
    master = "{}:{}".format(*node.master)
    print(f"{node.name} is at {network.address}; its master is {master}; Ctrl-C ends it", flush=True)
    try:
        board.run()
    except KeyboardInterrupt:
        print()
    finally:
        board.close()


def _refuse_options(arguments: argparse.Namespace, loaded: LoadedSystem) -> None:
    """Raise `InputError` for an option about a node on the host: the simulated board is the node."""
    given = [f"--{name.replace('_', '-')}" for name in _OF_NODES if getattr(arguments, name)]
    given += [*arguments.remappings, *([f"--ros {arguments.ros}"] if arguments.ros == 2 else [])]
    if given:
        fail(
            f"'{given[0]}' is not possible with interconnect '{loaded.specification.project.interconnect}'",
            hint="the simulated board is the node; its names are those of the specification",
        )


def _run_node(arguments: argparse.Namespace, loaded: LoadedSystem) -> None:
    from fusesoc_firm.node.description import describe
    from fusesoc_firm.node.reopening import at_address, of_simulator
    from fusesoc_firm.node.run import run_node, run_options
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
    from fusesoc_firm.node.cpp_trace import are_steps
    from fusesoc_firm.node.trace_picture import draw_trace

    table: Path = arguments.table
    output: Path = arguments.output or table.with_suffix(".svg")
    if are_steps(table):
        table = _ways_of_steps(table, arguments)
    draw_trace(table, output)
    print(output)


def _ways_of_steps(steps: Path, arguments: argparse.Namespace) -> Path:
    """Convert a table of steps to an adjacent table of routes; return the path of the table of routes."""
    from fusesoc_firm.node.cpp_trace import write_ways
    from fusesoc_firm.node.description import describe

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
