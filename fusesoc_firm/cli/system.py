"""`firm system`: specifications, and the files and data derived from them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.bring_up import add_bring_up
from fusesoc_firm.cli.check import add_check, check_system
from fusesoc_firm.cli.common import (
    add_json,
    add_picture,
    add_sources,
    add_spec,
    command,
    core_folders,
    load,
    print_json,
)
from fusesoc_firm.node.package.languages import LANGUAGES, Place


def add_system(commands: Any) -> None:
    """Declare the command and its actions."""
    system = command(
        commands,
        "system",
        "show systems, and write their cores, nodes and diagrams",
        "firm system show robot.yaml",
    )
    actions = system.add_subparsers(title="actions", metavar="ACTION", required=True)
    _add_new(actions)
    add_check(actions)
    for add in (_add_show, _add_skeleton, _add_diagram, _add_report, _add_core, _add_node):
        _add_specification(add(actions))
    _add_specification(add_bring_up(actions))
    _add_schema(actions)


def _add_specification(parser: argparse.ArgumentParser) -> None:
    add_spec(parser)
    add_sources(parser)


def _add_new(actions: Any) -> None:
    new = command(
        actions,
        "new",
        "write or extend a specification by answering questions",
        "firm system new robot.yaml",
        ask_for_system,
    )
    new.add_argument("spec", metavar="SPEC", type=Path, help="the system's YAML specification")
    add_sources(new)


def ask_for_system(arguments: argparse.Namespace) -> None:
    """Ask for the keys of the specification `arguments.spec`, which is created or extended, and check it.

    The core, stimuli and model may follow later.
    """
    from fusesoc_firm.system.message_sources import known_names, sources_of
    from fusesoc_firm.system.scaffold.wizard import extend_specification
    from fusesoc_firm.text.prompts import asker

    def names(paths: Sequence[str]) -> list[str]:
        sources = sources_of(arguments.spec, arguments.path, arguments.distro, core_folders)
        return known_names(arguments.spec, paths, sources, core_folders)

    if arguments.spec.exists():
        check_system(arguments, with_core=False)
    extend_specification(arguments.spec, asker(), names)
    check_system(arguments, with_core=False)


def _add_show(actions: Any) -> argparse.ArgumentParser:
    show = command(
        actions, "show", "print the system derived from a specification", "firm system show robot.yaml", _show_system
    )
    add_json(show)
    return show


def _show_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.views.show import derived_description
    from fusesoc_firm.text.yaml_text import yaml_dump

    description = derived_description(load(arguments).system)
    if arguments.json:
        print_json(description)
    else:
        print(yaml_dump(description), end="")


def _add_skeleton(actions: Any) -> argparse.ArgumentParser:
    return command(
        actions,
        "skeleton",
        "write a first version of each accelerator that has no source",
        "firm system skeleton robot.yaml",
        _write_skeletons,
    )


def _write_skeletons(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.scaffold.skeleton import missing_sources
    from fusesoc_firm.text.outputs import write

    loaded = load(arguments, needs_sources=False)
    texts = missing_sources(loaded.system, loaded.folder)
    for path, text in texts.items():
        write(path, text)
        print(path)
    if not texts:
        print("every accelerator has a source")


def _add_diagram(actions: Any) -> argparse.ArgumentParser:
    draw = command(
        actions,
        "diagram",
        "draw a system: topics, blocks, messages, times, clocks and pins",
        "firm system diagram robot.yaml -o robot.svg",
        _draw_system,
    )
    add_picture(draw)
    draw.add_argument(
        "--theme",
        choices=("light", "dark"),
        help="the colours (default: light, and dark in an SVG whose reader prefers dark pages)",
    )
    return draw


def _draw_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.views.diagram import dark_style, diagram
    from fusesoc_firm.tools.pictures import check_picture, draw

    check_picture(arguments.output, arguments.format)
    style = "" if arguments.theme else dark_style()
    draw(diagram(load(arguments).system, arguments.theme), arguments.output, arguments.format, style)


def _add_report(actions: Any) -> argparse.ArgumentParser:
    report = command(
        actions,
        "report",
        "count the written lines and the lines generated from them",
        "firm system report robot.yaml",
        _report_system,
    )
    report.add_argument(
        "--html",
        type=Path,
        metavar="F.html",
        help="write one page instead: diagram, ports, resources, timing, schedule and coverage of the stimuli",
    )
    report.add_argument(
        "--stimuli",
        type=Path,
        metavar="F",
        help="the stimuli of the page (default: stimuli.yaml beside the specification, if it exists)",
    )
    add_json(report)
    return report


def _report_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.views.report import report

    if arguments.html:
        _write_page(arguments)
        return
    counted = report(arguments.spec, load(arguments))
    if arguments.json:
        print_json({**asdict(counted), "generated": counted.generated, "ratio": counted.ratio})
    else:
        print(counted, end="")


def _write_page(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.runs.simulation.software_run import system_stimuli
    from fusesoc_firm.system.views.diagram import dark_style, diagram
    from fusesoc_firm.system.views.page import page
    from fusesoc_firm.text.outputs import check_output, write
    from fusesoc_firm.tools.pictures import picture

    check_output(arguments.html, (".html",))
    loaded = load(arguments)
    path = arguments.stimuli or loaded.folder / "stimuli.yaml"
    is_known = arguments.stimuli is not None or path.exists()
    stimuli = system_stimuli(path, loaded) if is_known else []
    messages = [(item.subscriber.block, item.message) for item in stimuli]
    drawn = picture(diagram(loaded.system), "svg", dark_style()).decode()
    reports = sorted(loaded.folder.glob("build/*/*/report.json"))
    write(arguments.html, page(loaded.system, drawn, reports, messages))
    print(arguments.html)


def _add_core(actions: Any) -> argparse.ArgumentParser:
    core = command(
        actions,
        "core",
        "write the FuseSoC core of a system, or rewrite the targets of an existing core",
        "firm system core robot.yaml --depend robot:acc:firm_cordic",
        _write_core,
    )
    core.add_argument(
        "-o", "--output", type=Path, metavar="F.core", help="the core file to write (default: beside the specification)"
    )
    new = core.add_argument_group("for a new core; all paths are relative to the core")
    new.add_argument(
        "--name", metavar="VLNV", default="", help="the core's name (default: robot:sys:<the system's name>:0.1.0)"
    )
    new.add_argument("--description", metavar="TEXT", default="", help="a description of the system")
    new.add_argument(
        "--depend",
        metavar="VLNV",
        action="append",
        default=[],
        help="a core that the accelerators need; may be repeated",
    )
    new.add_argument(
        "--stimuli", metavar="F", default="stimuli.yaml", help="stimuli: the messages to send (default: %(default)s)"
    )
    new.add_argument(
        "--model",
        metavar="F",
        help="the model of the expected responses (default: model.py; none if all accelerators are in Python)",
    )
    new.add_argument(
        "--environment",
        metavar="F",
        action="append",
        default=[],
        help="a VHDL file of the environment at the pins; may be repeated",
    )
    return core


def _write_core(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.scaffold.core_file import MODEL, CoreOptions, core_text
    from fusesoc_firm.text.outputs import check_output, write

    path: Path = arguments.output or arguments.spec.with_suffix(".core")
    check_output(path, (".core",))
    options = CoreOptions(
        arguments.name,
        arguments.description,
        arguments.depend,
        arguments.stimuli,
        arguments.model or MODEL,
        arguments.environment,
        arguments.path,
        arguments.distro or "",
    )
    write(path, core_text(load(arguments, needs_sources=False), arguments.spec, path, options))
    print(path)


def _add_node(actions: Any) -> argparse.ArgumentParser:
    node = command(
        actions,
        "node",
        "write a system's software node: a ROS package that connects topics to the hardware",
        "firm system node robot.yaml -o src/robot_node",
        _write_node,
    )
    node.add_argument("-o", "--output", type=Path, metavar="DIR", help="the package's folder (default: <system>_node)")
    node.add_argument("--language", choices=sorted(LANGUAGES), default="cpp", help="the node's language (default: cpp)")
    node.add_argument("--ros", type=int, choices=(1, 2), help="fail unless the system uses this version of ROS")
    return node


def _write_node(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.message.middleware import middleware_of
    from fusesoc_firm.text.outputs import write

    loaded = load(arguments, needs_sources=False)
    folder: Path = arguments.output or Path(f"{loaded.system.name}_node")
    place = Place(folder, arguments.spec, arguments.path, core_folders)
    ros = middleware_of(arguments.ros) if arguments.ros else None
    for path, text in LANGUAGES[arguments.language](loaded, ros, place).items():
        write(folder / path, text)
        if text.startswith("#!"):
            (folder / path).chmod(0o755)
    print(folder)


def _add_schema(actions: Any) -> None:
    command(
        actions,
        "schema",
        "print the JSON Schema of specifications, for editors",
        "firm system schema > specification.schema.json",
        _print_schema,
    )


def _print_schema(_: argparse.Namespace) -> None:
    from fusesoc_firm.system.written.specification import Specification
    from fusesoc_firm.text.yaml_schema import json_schema

    print_json(json_schema(Specification, "System specification of fusesoc_firm"))
