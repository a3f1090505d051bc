"""`firm simulator`: build a system's simulator, which another program starts."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import add_sources, add_spec, command, core_folders
from fusesoc_firm.cli.progress import Progress
from fusesoc_firm.tools.simulators import default_simulator, fitting


def add_simulator(commands: Any) -> None:
    """Declare the command."""
    simulator = command(
        commands,
        "simulator",
        "build a system's simulator, and print the command that starts it (docs/reference/transports.md)",
        'robot_node --transport "pipe:$(firm simulator robot.yaml)"',
        _build_simulator,
    )
    add_simulator_options(simulator)
    add_spec(simulator)


def add_simulator_options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of commands that simulate a system live; `built_simulator` reads them, and `spec`."""
    tools, default = [*fitting(is_live=True)], default_simulator(is_live=True)
    parser.add_argument("--tool", choices=tools, default=default, help="default: %(default)s")
    parser.add_argument(
        "--build-root", type=Path, metavar="DIR", help="folder for the build (default: a folder in the user's cache)"
    )
    parser.add_argument(
        "--seed", type=_seed, default=1, metavar="N", help="seed of all random values (default: %(default)s)"
    )
    parser.add_argument(
        "--stall-percent",
        type=_percent,
        default=0,
        metavar="N",
        help="percentage of cycles in which the host stalls a stream, 0 to 99 (default: %(default)s)",
    )
    add_sources(parser)
    core = parser.add_argument_group("required only if no core beside the specification lists them")
    core.add_argument(
        "--depend",
        metavar="VLNV",
        action="append",
        default=[],
        help="a core that the accelerators need; may be repeated",
    )
    core.add_argument(
        "--environment",
        metavar="F",
        type=Path,
        action="append",
        default=[],
        help="a VHDL file of the environment at the pins; may be repeated",
    )


def built_simulator(arguments: argparse.Namespace) -> Any:
    """Build the simulator that the arguments describe, and return it as a `BuiltSimulator`."""
    return _built(arguments, "")


def built_board(arguments: argparse.Namespace) -> Any:
    """Build the simulated board that the arguments describe, and return it as a `BuiltSimulator`."""
    from fusesoc_firm.system.scaffold.core_file import NETWORK

    is_first = arguments.tool == default_simulator(is_live=True)
    return _built(arguments, NETWORK if is_first else f"{NETWORK}_{arguments.tool}")


def _built(arguments: argparse.Namespace, target: str) -> Any:
    from fusesoc_firm.node.transport.built_simulator import CoreSources, build_simulator

    sources = CoreSources(arguments.path, arguments.distro or "", arguments.depend, arguments.environment, core_folders)
    with Progress(f"building the simulator of {arguments.spec} in {arguments.tool}"):
        return build_simulator(
            arguments.spec, arguments.tool, build_root=arguments.build_root, sources=sources, target=target
        )


def _build_simulator(arguments: argparse.Namespace) -> None:
    script = built_simulator(arguments).script(seed=arguments.seed, stall_percent=arguments.stall_percent)
    print(shlex.quote(str(script)))


def _seed(text: str) -> int:
    from fusesoc_firm.node.transport.built_simulator import MOST_SEED

    return _within(1, MOST_SEED, text)


def _percent(text: str) -> int:
    from fusesoc_firm.node.transport.built_simulator import MOST_STALL_PERCENT

    return _within(0, MOST_STALL_PERCENT, text)


def _within(least: int, greatest: int, text: str) -> int:
    if not text.isdecimal() or not least <= int(text) <= greatest:
        raise argparse.ArgumentTypeError(f"{text} is not a whole number from {least} to {greatest}")
    return int(text)
