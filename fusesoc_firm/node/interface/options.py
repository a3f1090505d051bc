"""The command line of a node: the node's options, and arguments to ROS."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from fusesoc_firm.node.engine.queues import Overflow
from fusesoc_firm.node.interface.topics import DEFAULT_DEPTH
from fusesoc_firm.system.written.specification import RELIABILITIES

ROS_ARGUMENTS = "--ros-args"
_REMAPPING = re.compile(r"[~/\w]+:=.*", re.DOTALL)


def add_node_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a node to a parser; `remappings` handles the arguments that the parser leaves."""
    parser.add_argument(
        "--status",
        default="",
        metavar="ADDRESS",
        help="the registers of a system with 'status: axi_lite', such as axi:/dev/uio1 (default on a board: the UIO "
        "device that the overlay names)",
    )
    parser.add_argument("--name", metavar="NAME", help="the node's name (default: the system's name)")
    parser.add_argument(
        "--qos",
        choices=RELIABILITIES,
        help="reliability of all ROS 2 topics (default: that of the specification's qos)",
    )
    parser.add_argument(
        "--queue",
        type=_positive,
        metavar="N",
        help=f"capacity of each queue, including ROS queues, in messages (default: that of qos, {DEFAULT_DEPTH})",
    )
    parser.add_argument(
        "--overflow",
        choices=[rule.value for rule in Overflow],
        default=Overflow.DROP_OLDEST.value,
        help="action if a queue is full; block stops all topics (default: drop_oldest)",
    )
    parser.add_argument(
        "--drain",
        type=_seconds,
        default=10.0,
        metavar="SECONDS",
        help="time limit for pending messages when the node ends (default: %(default)g)",
    )
    parser.add_argument(
        "--restart",
        action="store_true",
        help="restart hardware after its connection is lost; without this option, the node ends",
    )
    parser.add_argument(
        "--trace", type=Path, metavar="F.csv", help="write the trace of each message to this table; see `firm trace`"
    )
    parser.add_argument(
        "--lifecycle",
        action="store_true",
        help="start a node of ROS 2 with lifecycle states, which carries messages only while it is active",
    )
    parser.add_argument(
        "--ros-python", metavar="PATH", help="a Python that can import ROS (default: the first one found)"
    )
    parser.add_argument(
        ROS_ARGUMENTS,
        nargs=argparse.REMAINDER,
        default=[],
        metavar="...",
        help="arguments for ROS 2, up to the end of the line; NAME:=VALUE is legal anywhere, for both ROS versions",
    )


def remappings(rest: Sequence[str], error: Callable[[str], object]) -> tuple[str, ...]:
    """Return the arguments that the parser left, all of which must be for ROS; call `error` for any other argument."""
    if wrong := [argument for argument in rest if not _REMAPPING.fullmatch(argument)]:
        error(f"unrecognized arguments: {' '.join(wrong)}")
    return tuple(rest)


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of messages; legal: 1 or more")
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0 <= seconds < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a time in seconds")
    return seconds
