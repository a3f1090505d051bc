"""`firm message`: message definitions, their converters, and the verification of the converters."""

from __future__ import annotations

import argparse
import fnmatch
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import add_definitions, command, library_of, positive
from fusesoc_firm.converter.stages import STAGES, stages_text
from fusesoc_firm.text.diagnostics import closest, fail, nearest


def add_message(commands: Any) -> None:
    """Declare the command and its actions."""
    message = command(
        commands, "message", "list, show and verify message definitions", "firm message show geometry_msgs/Pose"
    )
    actions = message.add_subparsers(title="actions", metavar="ACTION", required=True)
    listing = command(
        actions,
        "list",
        "list the known messages, services and actions",
        "firm message list 'sensor_msgs/*'",
        _list_messages,
    )
    listing.add_argument(
        "pattern", nargs="?", default="*", help="list only names that match this pattern; * and ? are wildcards"
    )
    show = command(
        actions,
        "show",
        "print a message, or the messages of a service or action, at any stage from definition to hardware",
        "firm message show geometry_msgs/Quaternion --ros 1 --stage vhdl",
        _show_message,
    )
    show.add_argument("type", metavar="TYPE", help="the message's type, such as geometry_msgs/Quaternion")
    show.add_argument("--stage", choices=STAGES, default="tree", help="the stage to print (default: tree)")
    show.add_argument("--width", type=int, default=8, metavar="BITS", help="the stream's width in bits (default: 8)")
    verify = command(
        actions,
        "verify",
        "compare simulated converters with independent serialisers",
        "firm message verify 'geometry_msgs/*' --ros 1 --report geometry.json",
        _verify_messages,
    )
    for parser in (listing, show, verify):
        add_definitions(parser)
    _add_verification(verify)


def _add_verification(verify: argparse.ArgumentParser) -> None:
    verify.add_argument(
        "types",
        metavar="TYPE",
        nargs="*",
        help="a type, or a pattern with the wildcards * and ? (default: all known types)",
    )
    verify.add_argument(
        "--stimuli", type=positive, default=3, metavar="N", help="number of stimuli for each message (default: 3)"
    )
    verify.add_argument("--width", type=int, default=8, metavar="BITS", help="the stream's width in bits (default: 8)")
    verify.add_argument("--seed", type=int, default=1, metavar="N", help="seed of all random values (default: 1)")
    verify.add_argument(
        "--jobs",
        type=positive,
        metavar="N",
        help="number of messages to verify in parallel (default: one per processor core)",
    )
    verify.add_argument(
        "--cluster", metavar="ADDRESS", help="run on the Dask cluster of the scheduler at ADDRESS, not on this machine"
    )
    verify.add_argument("--report", type=Path, metavar="F.json", help="write the report to F.json and F.html")
    verify.add_argument(
        "--resume",
        action="store_true",
        help="keep the messages that passed in the report at --report, unless their definitions changed",
    )
    verify.add_argument("--json", action="store_true", help="print the report as JSON instead of a summary")
    verify.add_argument("--keep", type=Path, metavar="DIR", help="keep the work folder of each failed message in DIR")


def _list_messages(arguments: argparse.Namespace) -> None:
    library = library_of(arguments, arguments.ros)
    origins = {str(name): library.origin(name) for name in library.names()}
    origins |= {str(interface): str(file) for interface, file in library.interfaces().items()}
    pattern = arguments.pattern
    names = sorted(name for name in origins if fnmatch.fnmatchcase(name, pattern))
    if not names:
        packages = {f"{name.partition('/')[0]}/*" for name in origins}
        near = closest(pattern, {*origins, *packages})
        fail(f"no message matches '{pattern}'", hint=nearest(pattern, [near] if near else packages))
    width = max((len(name) for name in names), default=0)
    for name in names:
        print(f"{name:{width}}  {origins[name]}")


def _show_message(arguments: argparse.Namespace) -> None:
    library = library_of(arguments, arguments.ros)
    print(stages_text(arguments.stage, library, arguments.type, arguments.width))


def _verify_messages(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.runs.verify.campaign import Settings
    from fusesoc_firm.runs.verify.command import Places, verify_messages

    if arguments.resume and not arguments.report:
        fail("--resume needs --report")
    command = ["firm", "message", "verify", "--ros", str(arguments.ros)]
    command += [word for path in arguments.path for word in ("--path", str(path))]
    command += ["--distro", arguments.distro] if arguments.distro else []
    command += ["--width", str(arguments.width), "--stimuli", str(arguments.stimuli), "--seed", str(arguments.seed)]
    verify_messages(
        library_of(arguments, arguments.ros),
        arguments.types,
        Settings(arguments.width, arguments.stimuli, arguments.seed, keeps_files=arguments.keep is not None),
        Places(
            arguments.jobs,
            arguments.cluster,
            arguments.report,
            arguments.keep,
            command,
            arguments.json,
            arguments.resume,
        ),
    )
