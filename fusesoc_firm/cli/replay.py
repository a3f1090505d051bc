"""`firm replay`: send a recorded bag through a simulated system."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import add_spec, command, load, positive
from fusesoc_firm.cli.simulator import add_simulator_options, built_simulator
from fusesoc_firm.cli.studio import add_watch, watched

_QUIET = 1000


def add_replay(commands: Any) -> None:
    """Declare the command."""
    replay = command(
        commands,
        "replay",
        "replay a recorded bag through a simulated system, and record the responses",
        "firm replay robot.yaml --in drive.bag --out answers.bag --tool verilator",
        _replay,
    )
    add_spec(replay)
    replay.add_argument(
        "--in",
        dest="source",
        metavar="BAG",
        type=Path,
        required=True,
        help="the ROS 1 or ROS 2 (sqlite3, MCAP) bag to replay",
    )
    replay.add_argument(
        "--out",
        dest="target",
        metavar="BAG",
        type=Path,
        required=True,
        help="the bag to write: a folder, F.bag, F.mcap or F.db3",
    )
    replay.add_argument(
        "--format",
        choices=("ros1", "sqlite3", "mcap"),
        help="format of the written bag (default: from its extension, otherwise the format of --in)",
    )
    replay.add_argument("--force", action="store_true", help="replace the bag at --out if it exists")
    replay.add_argument(
        "--map",
        type=_mapping,
        action="append",
        default=[],
        metavar="TOPIC=BLOCK",
        help="use TOPIC for a subscriber or publisher, not the topic in the specification; may be repeated",
    )
    replay.add_argument("--limit", type=positive, metavar="N", help="replay at most N messages")
    replay.add_argument(
        "--start", type=_seconds, default=0, metavar="S", help="start S seconds after the beginning of the bag"
    )
    replay.add_argument("--duration", type=_seconds, metavar="S", help="replay at most S seconds of the bag")
    replay.add_argument(
        "--latency",
        action="store_true",
        help="add the hardware's latency to the recorded time stamps; requires the system's clock frequency",
    )
    replay.add_argument(
        "--quiet",
        type=positive,
        default=_QUIET,
        metavar="CYCLES",
        help="number of cycles without a beat after which the system is considered idle (default: %(default)s)",
    )
    add_watch(replay)
    replay.add_argument("--json", action="store_true", help="print the summary as JSON, for other programs")
    add_simulator_options(replay)


def _mapping(text: str) -> tuple[str, str]:
    topic, equals, block = text.rpartition("=")
    if not equals or not topic or not block:
        raise argparse.ArgumentTypeError(f"'{text}' does not have the form TOPIC=BLOCK, such as /arm/left=arm_in")
    return block, topic


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of seconds")
    return value


def _replay(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.message.bag_reader import Form
    from fusesoc_firm.node.engine.watch import Control
    from fusesoc_firm.node.transport.simulator import Simulator
    from fusesoc_firm.runs.replay.command import replay
    from fusesoc_firm.runs.replay.options import Settings, Source, Target

    def start() -> Simulator:
        built = built_simulator(arguments)
        return Simulator(built.command(seed=arguments.seed, stall_percent=arguments.stall_percent), built.folder)

    loaded, control = load(arguments), Control() if arguments.watch else None
    with watched(arguments, loaded, f"replay of {arguments.source.name}", control, stays=True) as run:
        watch = run.watch if run else None
        replay(
            loaded,
            Source(arguments.source, arguments.limit, arguments.start, arguments.duration),
            Target(arguments.target, Form(arguments.format) if arguments.format else None, arguments.force),
            Settings(dict(arguments.map), arguments.quiet, arguments.latency, arguments.json, watch, control),
            start,
        )
