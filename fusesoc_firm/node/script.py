"""The entry point of a generated node in Python (`firm system node --language python`)."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from fusesoc_firm.node.interface.description import NodeDescription
from fusesoc_firm.node.interface.options import ROS_ARGUMENTS, add_node_options, remappings
from fusesoc_firm.node.interface.parameters import PARAMETERS, option_words, parameters_of
from fusesoc_firm.node.live_run import run_node, run_options
from fusesoc_firm.node.reopening import at_address
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.interrupts import accept_interrupts


def main(description: NodeDescription, script: str = "", specification: str = "", paths: Sequence[str] = ()) -> None:
    """Run the node as the command line requests.

    Exit with 0 after a stop request, 1 for faults, 2 for a bad command line.

    For a system with software, `specification` is the specification's path, and `paths` are the folders with the
    messages, all relative to `script`.
    """
    accept_interrupts()
    parser = argparse.ArgumentParser(description=f"Run the node of the system {description.name}.")
    parser.epilog = f"Each option is also a parameter of the node in ROS: {', '.join(PARAMETERS)}."
    parser.add_argument("--transport", metavar="ADDRESS", help="the transport to the hardware")
    add_node_options(parser)
    arguments, rest = parser.parse_known_args()
    passed = remappings(rest, parser.error)
    try:
        ros_arguments = [*passed, ROS_ARGUMENTS, *arguments.ros_args]
        name = arguments.name or description.name
        given = option_words(parameters_of(description.versions, name, ros_arguments, _say))
        # The command line has priority.
        arguments, _ = parser.parse_known_args([*given, *sys.argv[1:]])
        if not arguments.transport:
            parser.error("the following arguments are required: --transport")
        folder = Path(script).resolve().parent
        places = [folder / path for path in paths]
        # `places` includes the folders of message cores.
        loaded = load_beside(folder / specification, places, core_folders=lambda _: ()) if specification else None
        options = run_options(arguments, passed, description)
        run_node(description, at_address(arguments.transport), options, loaded, arguments.transport)
    except InputError as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        sys.exit(130)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
