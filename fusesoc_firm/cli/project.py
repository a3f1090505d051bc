"""`firm graph`, `firm affected` and `firm lock`: the dependencies between a project's cores, and the cores' inputs."""

from __future__ import annotations

import argparse
from typing import Any

from fusesoc_firm.cli.build_options import add_selectors, selectors_of
from fusesoc_firm.cli.common import add_picture, command


def add_project(commands: Any) -> None:
    """Declare the commands."""
    graph = command(
        commands,
        "graph",
        "draw a core's dependencies: cores, generated cores and the files that determine the generated cores",
        "firm graph robot:sys:quat2euler --target sim -o quat2euler.svg",
        _draw_cores,
    )
    graph.add_argument("core", metavar="CORE", help="the core's name in FuseSoC")
    graph.add_argument("--target", default="default", metavar="NAME", help="the core's target (default: default)")
    add_picture(graph)
    affected = command(
        commands,
        "affected",
        "list the cores that an edit affects, each with the reason",
        "firm affected --since main",
        _list_affected,
    )
    affected.add_argument("--since", default="HEAD", metavar="REV", help="the revision before the edit (default: HEAD)")
    lock = command(
        commands,
        "lock",
        "write a core's lock file, which lists the message definitions, cores and tools that the core uses",
        "firm lock robot:sys:quat2euler",
        _lock,
    )
    lock.add_argument("core", metavar="CORE", help="the core's name in FuseSoC")
    add_selectors(lock)
    lock.add_argument(
        "--locked", action="store_true", help="write nothing; report differences from the lock file as errors"
    )


def _draw_cores(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.builds.project import graph
    from fusesoc_firm.tools.pictures import check_picture, draw

    check_picture(arguments.output, arguments.format)
    draw(graph(arguments.core, arguments.target), arguments.output, arguments.format)


def _list_affected(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.builds.project import affected_since

    found = affected_since(arguments.since)
    width = max(map(len, found), default=0)
    for name, reason in found.items():
        print(f"{name:{width}}  {reason}")


def _lock(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.builds.project import check_locked, write_lock
    from fusesoc_firm.text.outputs import shown

    options = selectors_of(arguments)
    if arguments.locked:
        print(f"{shown(check_locked(arguments.core, options))}: nothing differs")
    else:
        print(shown(write_lock(arguments.core, options)))
