"""`firm accelerator`: the report of an accelerator in Python, and the exploration of its operators and numbers."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import add_json, add_sources, command, core_folders, print_json, print_warnings
from fusesoc_firm.cli.here import check_is_spec, spec_here
from fusesoc_firm.cli.progress import Progress
from fusesoc_firm.text.diagnostics import fail, nearest, nearest_file
from fusesoc_firm.text.outputs import check_output, write

if TYPE_CHECKING:
    from fusesoc_firm.exploration.accuracy import Accuracy
    from fusesoc_firm.exploration.placement import Placed
    from fusesoc_firm.exploration.points import Point
    from fusesoc_firm.system.derived.model import AcceleratorType
    from fusesoc_firm.system.system_core import LoadedSystem


def add_accelerator(commands: Any) -> None:
    """Declare the command and its actions."""
    accelerator = command(
        commands, "accelerator", "look at accelerators that are written in Python", "firm accelerator report robot.yaml"
    )
    actions = accelerator.add_subparsers(title="actions", metavar="ACTION", required=True)
    report = command(
        actions,
        "report",
        "show which operation of an accelerator runs when, on which operator, and what it costs",
        "firm accelerator report robot.yaml --accelerator pid",
        _report,
    )
    _add_accelerator(report)
    add_json(report)
    _add_explore(actions)


def _add_explore(actions: Any) -> None:
    explore = command(
        actions,
        "explore",
        "compare operators and numbers of an accelerator: cycles, cells, clock, and the error of narrower numbers",
        "firm accelerator explore robot.yaml --numbers float32,float64 --svg points.svg",
        _explore,
    )
    _add_accelerator(explore)
    explore.add_argument(
        "--numbers", default="float32,float64", metavar="NAMES", help="types of floats (default: %(default)s)"
    )
    messages = explore.add_mutually_exclusive_group()
    messages.add_argument(
        "--stimuli", type=Path, metavar="FILE", help="the messages that show the error (default: those of the core)"
    )
    messages.add_argument("--bag", type=Path, metavar="BAG", help="a recorded bag with these messages")
    explore.add_argument("--topic", help="the topic in the bag (default: the subscriber's)")
    explore.add_argument("--place", action="store_true", help="place the front with Yosys and nextpnr")
    explore.add_argument("--all", action="store_true", help="show all points also in a long table")
    explore.add_argument("--svg", type=Path, metavar="FILE", help="write a picture: LUT4 over latency")
    add_json(explore)


def _add_accelerator(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "system",
        metavar="SPEC",
        type=Path,
        nargs="?",
        help="the system's specification, its folder, or the accelerator's .py file (default: that of this folder)",
    )
    parser.add_argument("--accelerator", metavar="NAME", help="the type of the accelerator, if there are several")
    add_sources(parser)


def _report(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.exploration.report import Report
    from fusesoc_firm.exploration.report_text import report_text
    from fusesoc_firm.system.hardware.compiled import schedule_of

    with Progress("compiling", is_shown=not arguments.json):
        chosen = _chosen(arguments)
        report = Report(schedule_of(chosen.type, chosen.loaded.folder))
    if arguments.json:
        print_json({"accelerator": str(chosen.type.accelerator.name), **report.data()})
    else:
        print(report_text(report))


def _explore(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.exploration.explored_text import errors_text, picture, table
    from fusesoc_firm.exploration.placement import check_programs
    from fusesoc_firm.exploration.points import explored, possible_numbers

    numbers = _numbers(arguments.numbers)
    if arguments.topic and not arguments.bag:
        fail("--topic names a topic of a bag", hint="add --bag BAG")
    if arguments.svg:
        check_output(arguments.svg, (".svg",))
    if arguments.place:
        check_programs()
    with Progress("compiling", is_shown=not arguments.json) as progress:
        chosen = _chosen(arguments)
        numbers, refused = possible_numbers(chosen.type, chosen.loaded.folder, numbers)
        points = explored(chosen.type, chosen.loaded.folder, numbers, progress.step)
        errors, source = _errors(arguments, chosen, numbers)
        measured = _measured(chosen.type, points, progress) if arguments.place else {}
    name = str(chosen.type.accelerator.name)
    if arguments.svg:
        write(arguments.svg, picture(name, points))
    if arguments.json:
        faults = {item: str(fault) for item, fault in refused.items()}
        print_json(_explored_data(name, points, errors, measured) | ({"notPossible": faults} if faults else {}))
        return
    print(f"{name}: {chosen.type.accelerator.sources[0]}, estimated for an ECP5-8; *: front, =: the specification")
    print("\n".join(table(points, measured, is_whole=arguments.all)))
    for item, fault in refused.items():
        print(f"{item} is not possible:\n{fault}")
    print("\n".join(errors_text(errors, source)) or f"no error: {source}")


def _numbers(text: str) -> list[str]:
    """Return the types of numbers in an option."""
    from fusesoc_firm.system.written.specification import numbers_fault

    # A comma within parentheses is part of a type.
    names = [*dict.fromkeys(name.strip() for name in re.split(r",(?![^(]*\))", text))]
    for name in names:
        if fault := numbers_fault(name):
            fail(f"--numbers {fault[0]}", hint=fault[1])
    return names


def _errors(arguments: argparse.Namespace, chosen: Chosen, numbers: Sequence[str]) -> tuple[dict[str, Accuracy], str]:
    """Return the errors of the narrower numbers, and the name of the messages, or why there are none."""
    from fusesoc_firm.exploration.accuracy import WIDEST, accuracy
    from fusesoc_firm.exploration.messages import Messages

    narrower = [name for name in numbers if name != WIDEST]
    if not narrower:
        return {}, f"only {WIDEST} is explored"
    messages = Messages(arguments.bag or arguments.stimuli, arguments.topic or "")
    calls, source = messages.calls(chosen.spec, chosen.loaded, chosen.type)
    return {name: accuracy(chosen.type, chosen.loaded.folder, calls, name) for name in narrower if calls}, source


def _measured(type_: AcceleratorType, points: Sequence[Point], progress: Progress) -> dict[int, Placed]:
    """Return the measurements of the points of the front."""
    from fusesoc_firm.exploration.placement import place

    front = [number for number, item in enumerate(points) if item.is_front]
    found = {}
    for count, number in enumerate(front):

        def tell(step: str, text: str = f"placing {count + 1} of {len(front)}") -> None:
            progress.step(f"{text}: {step}")

        found[number] = place(type_, points[number].schedule, tell)
    return found


def _explored_data(
    name: str, points: Sequence[Point], errors: Mapping[str, Accuracy], measured: Mapping[int, Placed]
) -> dict[str, Any]:
    rows = [
        item.data() | ({"measured": measured[number].data()} if number in measured else {})
        for number, item in enumerate(points)
    ]
    return {"accelerator": name, "points": rows, "errors": {name: item.data() for name, item in errors.items()}}


@dataclass(frozen=True)
class Chosen:
    """The accelerator that the arguments name, its specification and its system."""

    spec: Path
    loaded: LoadedSystem
    type: AcceleratorType


def _chosen(arguments: argparse.Namespace) -> Chosen:
    """Return the accelerator that the arguments name. May raise `InputError`."""
    from fusesoc_firm.system.message_sources import load_beside

    spec, source = _spec(arguments.system)
    loaded = load_beside(spec, arguments.path, arguments.distro, core_folders=core_folders)
    print_warnings(loaded.warnings)
    types = {str(item.accelerator.name): item.own for item in loaded.system.accelerator_types if _is_compiled(item)}
    if source:
        types = {name: item for name, item in types.items() if source in _sources(item, loaded.folder)}
    if not types:
        fail(f"{spec} has no accelerator with 'type: Python'{f' and the source {source}' if source else ''}")
    if arguments.accelerator is None and len(types) > 1:
        fail(f"which accelerator? {spec} has {', '.join(types)}", hint="name one: --accelerator NAME")
    name = arguments.accelerator or next(iter(types))
    if name not in types:
        fail(f"{spec} has no accelerator '{name}' with 'type: Python'", hint=nearest(name, types))
    return Chosen(spec, loaded, types[name])


def _is_compiled(type_: AcceleratorType) -> bool:
    return type_.own.accelerator.is_compiled


def _sources(type_: AcceleratorType, folder: Path) -> list[Path]:
    return [(folder / source).resolve() for source in type_.accelerator.sources]


def _spec(path: Path | None) -> tuple[Path, Path | None]:
    """Return the specification that a path means and, if the path is a function's file, this file."""
    if path is None or path.is_dir():
        return spec_here(*filter(None, [path])), None
    if path.suffix != ".py":
        check_is_spec(path)
        return path, None
    if not path.is_file():
        fail(f"there is no file {path}", hint=nearest_file(path))
    return _spec_of_source(path), path.resolve()


def _spec_of_source(path: Path) -> Path:
    """Return the specification beside a function's file, or in the folder above."""
    from fusesoc_firm.system.message_sources import specs_in

    folders = path.parent, Path(os.path.normpath(path.parent / ".."))
    found = [spec for folder in folders for spec in specs_in(folder)]
    found = [spec for spec in found if str(path.name) in spec.read_text(encoding="utf-8", errors="replace")]
    if not found:
        fail(f"no specification beside {path}, or in the folder above, lists it in 'sources'", hint="name it: SPEC")
    return found[0]
