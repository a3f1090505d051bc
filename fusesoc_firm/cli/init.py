"""`firm init`: start a project that passes its simulation at once."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import add_sources, command, positive
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.message.library import Libraries
    from fusesoc_firm.runs.simulation.excerpt import Recording
    from fusesoc_firm.system.scaffold.project import Project

# The options that describe a new system, which an example already contains.
_DESCRIBING = ("input", "output", "include", "ros", "language", "width", "bench", "from_bag", "limit")
_OPTIONS = {"input": "--in", "output": "--out", "from_bag": "--from-bag"}


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
    init.add_argument(
        "--in",
        "--subscribe",
        dest="input",
        metavar="TYPE|TOPIC",
        help="the message that the accelerator receives, such as sensor_msgs/Imu; with --from-bag, a topic of the bag "
        "(default: asked)",
    )
    init.add_argument(
        "--out",
        "--publish",
        dest="output",
        metavar="TYPE|TOPIC",
        help="the message that the accelerator sends; with --from-bag, also a topic of the bag that has this message "
        "(default: asked)",
    )
    init.add_argument(
        "--include",
        action="append",
        metavar="FIELD",
        help="a field that the accelerator receives, such as pose.position.z; several by commas or by repetition. "
        "Without --out, the accelerator sends it, too, and all other fields of the message pass",
    )
    init.add_argument("--ros", choices=("1", "2"), help="the ROS version (default: 2)")
    init.add_argument(
        "--language",
        type=_language,
        choices=("vhdl", "verilog", "python", "hls", "software"),
        help="the accelerator's language; python is compiled to hardware; hls is C++, which AMD Vitis HLS builds and "
        "g++ simulates; software is Python that runs on the host, behind hardware (default: vhdl)",
    )
    init.add_argument(
        "--width", choices=[str(2**n) for n in range(3, 10)], help="width in bits of the streams (default: 8)"
    )
    init.add_argument(
        "--bench", choices=("cocotb",), help="add a bench in cocotb, which 'firm test' runs (target test_cocotb)"
    )
    init.add_argument(
        "--from-bag",
        type=Path,
        metavar="BAG",
        help="take topics, messages and stimuli from a recorded bag (ROS 1 or ROS 2)",
    )
    init.add_argument(
        "--limit",
        type=positive,
        metavar="N",
        help="take at most N messages from the bag (default: 10, or fewer if they are longer than 100,000 bytes)",
    )
    init.add_argument(
        "--example",
        metavar="DEMO",
        help="copy a demo system by its name or a word, such as quat2euler or pid (NAME is then only the folder)",
    )
    init.add_argument(
        "--extend",
        type=Path,
        metavar="SPEC",
        help="ask for further accelerators and blocks of an existing specification, whose comments remain",
    )
    add_sources(init)


def _language(text: str) -> str:
    """Return a language as this command names it: in lower case, and C++ by its tool."""
    return "hls" if text.lower() in ("c++", "cpp") else text.lower()


def _init(arguments: argparse.Namespace) -> None:
    if arguments.extend:
        _extend(arguments)
        return
    if arguments.limit and not arguments.from_bag:
        fail("--limit needs --from-bag")
    if arguments.example is not None:
        _copy_example(arguments)
    else:
        _start(arguments)


def _extend(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.cli.system import ask_for_system

    if given := [name for name in ("name", "example", *_DESCRIBING) if getattr(arguments, name)]:
        fail(f"--extend asks for all parts, so {_named(given[0])} has no meaning", hint="give only the specification")
    if not arguments.extend.exists():
        fail(f"{arguments.extend} does not exist", hint="'firm init NAME' starts a new project")
    arguments.spec = arguments.extend
    ask_for_system(arguments)


def _named(option: str) -> str:
    return "NAME" if option == "name" else _OPTIONS.get(option, f"--{option}")


def _copy_example(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.scaffold.example import copy_example, example_named
    from fusesoc_firm.tools.library_path import demos_root

    if given := [name for name in _DESCRIBING if getattr(arguments, name)]:
        fail(f"an example has no {_named(given[0])}", hint="only NAME can be chosen")
    example = example_named(arguments.example, demos_root())
    folder = Path(arguments.name or example)
    _print_files(folder, copy_example(example, folder, demos_root()))
    print(f"next: cd {folder} && firm sim {example}.yaml")


def _start(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.message.library import libraries
    from fusesoc_firm.system.scaffold.project import LANGUAGES, create, usual_size_of

    recording = _recording(arguments)
    places = [recording.path] if recording and recording.has_definitions else []
    known = libraries([*arguments.path, *places], os.environ, arguments.distro)
    project = replace(
        _project(arguments, known, recording),
        include=tuple(path for item in arguments.include or () for path in item.split(",")),
    )
    project = replace(project, has_bench=bool(arguments.bench))
    if recording:
        project = replace(project, stimuli=recording.stimuli(project, known[recording.ros], arguments.limit))
    folder = Path(project.name)
    _print_files(folder, create(project, folder, known, arguments.path))
    source = LANGUAGES[project.language].source.format(project.name)
    print(f"ROS {project.ros}: {project.input} in, {project.output} out")
    if usual := usual_size_of(project, known):
        spec = folder / f"{project.name}.yaml"
        print(f"maxLength: messages of up to {usual.bytes} bytes ({usual.example}); change it in {spec}")
    model = f", {folder / 'model.py'} (the responses that it must give)"
    print(f"edit: {folder / source} (the computation){'' if project.language in ('python', 'software') else model}")
    if project.language == "hls":
        print("hardware: AMD Vitis HLS builds the function; 'firm sim' needs only g++ and GHDL")
    print(f"next: cd {folder} && firm sim{' && firm test' if project.has_bench else ''}")


def _recording(arguments: argparse.Namespace) -> Recording | None:
    if arguments.from_bag is None:
        return None
    from fusesoc_firm.runs.simulation.excerpt import Recording

    found = Recording.of(arguments.from_bag)
    if arguments.ros and int(arguments.ros) != found.ros.number:
        fail(f"{found.path} uses {found.ros.title}, not ROS {arguments.ros}", hint="omit --ros")
    return found


def _project(arguments: argparse.Namespace, known: Libraries, recording: Recording | None) -> Project:
    """Return the project from the options and, for the rest, from answers to questions."""
    from fusesoc_firm.converter.stream import WIDTHS
    from fusesoc_firm.message.middleware import middleware_of
    from fusesoc_firm.system.scaffold.project import ask
    from fusesoc_firm.text.prompts import asker

    given = {
        "name": arguments.name,
        "in": arguments.input,
        "out": arguments.output,
        "ros": arguments.ros,
        "language": arguments.language,
        "width": arguments.width,
    }
    answers = {name: value for name, value in given.items() if value is not None}
    if recording:
        answers |= {name: recording.named(answers[name]) for name in ("in", "out") if name in answers}
        answers["ros"] = str(recording.ros.number)
        if not {"in", "out"} <= answers.keys():
            print(*recording.table, sep="\n")
    topics = {topic: str(message) for topic, (message, _) in recording.topics.items()} if recording else {}
    if arguments.include and "in" in answers:
        answers.setdefault("out", topics.get(answers["in"], answers["in"]))
    if {"name", "in", "out"} <= answers.keys():
        answers = {"ros": "2", "language": "vhdl", "width": "8"} | answers

    def names(ros: int) -> Sequence[str]:
        return [] if {"in", "out"} <= answers.keys() else [str(name) for name in known[middleware_of(ros)].names()]

    return ask(answers, asker(), names, [str(width) for width in WIDTHS], topics)


def _print_files(folder: Path, files: Iterable[Path]) -> None:
    for path in files:
        if not path.name.startswith(".") and path.name != "FUSESOC_IGNORE":
            print(folder / path)
