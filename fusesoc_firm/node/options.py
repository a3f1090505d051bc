"""The command line of a node: its own options and those of ROS."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from fusesoc_firm.node.queues import Overflow

ROS_ARGUMENTS = "--ros-args"
_REMAPPING = re.compile(r"[~/\w]+:=.*", re.DOTALL)


def add_node_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a node to a parser; the rest of the command line is for `remappings`."""
    parser.add_argument("--name", metavar="NAME", help="the node's name (default: the system's)")
    parser.add_argument(
        "--qos",
        choices=("reliable", "best_effort"),
        default="reliable",
        help="of all topics in ROS 2 (default: reliable)",
    )
    parser.add_argument(
        "--queue",
        type=_positive,
        default=10,
        metavar="N",
        help="messages that each queue holds, those of ROS too (default: %(default)s)",
    )
    parser.add_argument(
        "--overflow",
        choices=[rule.value for rule in Overflow],
        default=Overflow.DROP_OLDEST.value,
        help="what a full queue does with a message; block stops all topics (default: drop_oldest)",
    )
    parser.add_argument(
        "--drain",
        type=_seconds,
        default=10.0,
        metavar="SECONDS",
        help="how long the node works on what it has when it is to end (default: %(default)g)",
    )
    parser.add_argument("--restart", action="store_true", help="start hardware that is gone anew, instead of ending")
    parser.add_argument("--trace", type=Path, metavar="F.csv", help="write each message's way; see `firm trace`")
    parser.add_argument("--ros-python", metavar="PATH", help="the Python that ROS is installed for (default: found)")
    parser.add_argument(
        ROS_ARGUMENTS,
        nargs=argparse.REMAINDER,
        default=[],
        metavar="...",
        help="ROS 2's own arguments, up to the end; NAME:=VALUE may stand anywhere, in both versions of ROS",
    )


def remappings(rest: Sequence[str], error: Callable[[str], object]) -> tuple[str, ...]:
    """Return the arguments that the parser left, if all belong to ROS; otherwise call `error`."""
    if wrong := [argument for argument in rest if not _REMAPPING.fullmatch(argument)]:
        error(f"unrecognized arguments: {' '.join(wrong)}")
    return tuple(rest)


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is no number of messages; legal: 1 and more")
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0 <= seconds < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is no time in seconds")
    return seconds
