"""`firm system`: specifications and what is derived from them."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from fusesoc_firm.cli.common import add_sources, as_yaml, command, library_of, load, write


def add_system(commands: Any) -> None:
    """Declare the command and its actions."""
    system = command(commands, "system", "look at system specifications", "firm system check robot.yaml")
    actions = system.add_subparsers(title="actions", metavar="ACTION", required=True)
    new = command(
        actions,
        "new",
        "ask for a specification and write it, or extend one that is there",
        "firm system new robot.yaml",
        _new_system,
    )
    check = command(
        actions, "check", "report all faults of a specification", "firm system check robot.yaml", _check_system
    )
    show = command(
        actions, "show", "print the system derived from a specification", "firm system show robot.yaml", _show_system
    )
    skeletons = command(
        actions,
        "skeleton",
        "write a first version of each accelerator that has no source",
        "firm system skeleton robot.yaml",
        _write_skeletons,
    )
    draw = command(
        actions,
        "diagram",
        "draw a system: blocks, messages, widths and ids",
        "firm system diagram robot.yaml -o robot.svg",
        _draw_system,
    )
    draw.add_argument("-o", "--output", type=Path, metavar="F.svg", help="where to write it (default: print it)")
    draw.add_argument("--format", choices=("svg", "dot"), default="svg", help="of the picture (default: svg)")
    report = command(
        actions,
        "report",
        "count the lines that are written and those that are generated of them",
        "firm system report robot.yaml",
        _report_system,
    )
    for parser in (new, check, show, skeletons, draw, report):
        parser.add_argument("spec", metavar="SPEC", type=Path, help="the system's YAML specification")
        add_sources(parser)
    command(
        actions,
        "schema",
        "print the grammar of specifications as a JSON Schema, for editors",
        "firm system schema > specification.schema.json",
        _print_schema,
    )


def _check_system(arguments: argparse.Namespace) -> None:
    system = load(arguments).system
    counts = [
        (len(system.subscribers), "subscriber"),
        (len(system.accelerators), "accelerator"),
        (len(system.publishers), "publisher"),
    ]
    if system.software.blocks:
        counts.append((len(system.software.blocks), "accelerator"))
    words = ", ".join(f"{count} {word}{'' if count == 1 else 's'}" for count, word in counts)
    words += " in software" if system.software.blocks else ""
    print(f"{arguments.spec}: {system.name} is right: {words}")


def _show_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.show import derived_description

    print(as_yaml(derived_description(load(arguments).system)), end="")


def _new_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.prompts import asker
    from fusesoc_firm.system.wizard import extend_specification

    if arguments.spec.exists():
        _check_system(arguments)
    extend_specification(arguments.spec, asker(), lambda: _message_names(arguments))
    _check_system(arguments)


def _message_names(arguments: argparse.Namespace) -> list[str]:
    return sorted({str(name) for ros in (1, 2) for name in library_of(arguments, ros).names()})


def _write_skeletons(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.skeleton import missing_sources

    loaded = load(arguments, needs_sources=False)
    texts = missing_sources(loaded.system, loaded.folder)
    for path, text in texts.items():
        write(path, text)
        print(path)
    if not texts:
        print("every accelerator has a source")


def _draw_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.diagram import diagram

    picture = diagram(load(arguments).system, arguments.format)
    if arguments.output:
        write(arguments.output, picture)
    else:
        print(picture, end="")


def _report_system(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.system.report import report

    print(report(arguments.spec, load(arguments)), end="")


def _print_schema(_: argparse.Namespace) -> None:
    from fusesoc_firm.system.specification import Specification
    from fusesoc_firm.yaml_schema import json_schema

    print(json.dumps(json_schema(Specification, "System specification of fusesoc_firm"), indent=2))
