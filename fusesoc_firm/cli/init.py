"""`firm init`: start a project that passes its simulation at once."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import add_sources, command


def add_init(commands: Any) -> None:
    """Declare the command."""
    init = command(
        commands,
        "init",
        "start a project: specification, accelerator, stimuli, model and core, which simulate at once",
        "firm init tilt --in sensor_msgs/Imu --out geometry_msgs/Vector3Stamped",
        _init,
    )
    init.add_argument(
        "name",
        metavar="NAME",
        nargs="?",
        help="the name of the folder, the system and the accelerator (default: asked)",
    )
    init.add_argument("--in", dest="input", metavar="TYPE", help="the message that is received (default: asked)")
    init.add_argument("--out", dest="output", metavar="TYPE", help="the message that is sent (default: asked)")
    init.add_argument("--ros", choices=("1", "2"), help="the ROS version (default: 2)")
    init.add_argument(
        "--language",
        choices=("vhdl", "verilog", "hls", "python"),
        help="the accelerator's language; python runs on the host, behind hardware (default: vhdl)",
    )
    init.add_argument(
        "--width", choices=[str(2**n) for n in range(3, 10)], help="width in bits of the streams (default: 8)"
    )
    add_sources(init)


def _init(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.converter.stream import WIDTHS
    from fusesoc_firm.message.library import libraries
    from fusesoc_firm.message.middleware import middleware_of
    from fusesoc_firm.system.scaffold.project import ask, create
    from fusesoc_firm.text.prompts import asker
    from fusesoc_firm.tools.library_path import library_root

    known = libraries(arguments.path, os.environ, arguments.distro)
    given = {
        "name": arguments.name,
        "in": arguments.input,
        "out": arguments.output,
        "ros": arguments.ros,
        "language": arguments.language,
        "width": arguments.width,
    }
    answers = {name: value for name, value in given.items() if value is not None}
    if {"name", "in", "out"} <= answers.keys():
        answers = {"ros": "2", "language": "vhdl", "width": "8"} | answers

    def names(ros: int) -> Sequence[str]:
        return [] if {"in", "out"} <= answers.keys() else [str(name) for name in known[middleware_of(ros)].names()]

    project = ask(answers, asker(), names, [str(width) for width in WIDTHS])
    folder = Path(project.name)
    for path in create(project, folder, known, library_root(), arguments.path):
        if not path.name.startswith(".") and path.name != "FUSESOC_IGNORE":
            print(folder / path)
    print(f"next: cd {folder} && firm sim")
