"""`firm why`: show the source lines of a generated line."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import command
from fusesoc_firm.text.diagnostics import SourceRef, fail
from fusesoc_firm.text.outputs import shown

if TYPE_CHECKING:
    from fusesoc_firm.text.render import TracedLine


def add_why(commands: Any) -> None:
    """Declare the command."""
    why = command(
        commands,
        "why",
        "show the lines in the template, specification and message definition that produced a generated line",
        "firm why build/robot_sys_quat2euler_0.2.0/sim/src/robot_sys_quat2euler-system_0.2.0/quat2euler_system.vhd:80",
        _tell_why,
    )
    why.add_argument(
        "place", metavar="FILE[:LINE]", help="a generated file in a build; without LINE, all its lines are explained"
    )


def _tell_why(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.plugin.why import why

    path, number = _split(arguments.place)
    if not path.is_file():
        fail(f"there is no file {path}", hint="the form is FILE or FILE:LINE")
    found = why(path)
    if number is None:
        for count, reason in enumerate(found, start=1):
            places = [_place(place) for place in (*reason.specification, *reason.messages)]
            print(f"{count}: {', '.join([_template(reason.line), *places])}")
        return
    if not 1 <= number <= len(found):
        fail(f"{path} has no line {number}; its last line is {len(found)}")
    reason = found[number - 1]
    print(reason.line.text)
    print(f"  template       {_template(reason.line)}")
    for kind, sources in (("specification", reason.specification), ("message", reason.messages)):
        for place in sources:
            print(f"  {kind:13}  {_place(place)}: {place.text.strip()}")


def _split(text: str) -> tuple[Path, int | None]:
    file, _, number = text.rpartition(":")
    return (Path(file), int(number)) if file and number.isdecimal() else (Path(text), None)


def _template(line: TracedLine) -> str:
    return f"{line.template}:{line.line}{f' for {line.scope}' if line.scope else ''}"


def _place(place: SourceRef) -> str:
    file = Path(place.file)
    return f"{shown(file) if file.is_absolute() else file}:{place.line}"
