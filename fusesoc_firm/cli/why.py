"""`firm why`: show the source lines of a generated line, or why the steps of a build ran."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import command
from fusesoc_firm.text.diagnostics import SourceRef, fail, nearest_file
from fusesoc_firm.text.outputs import shown

if TYPE_CHECKING:
    from fusesoc_firm.text.render import TracedLine

_MOST_REASONS = 20


def add_why(commands: Any) -> None:
    """Declare the command."""
    why = command(
        commands,
        "why",
        "show the source lines that produced a generated line; with --target, why the steps of a build ran",
        "firm why build/robot_sys_quat2euler_0.2.0/sim/src/robot_sys_quat2euler-system_0.2.0/quat2euler_system.vhd:80",
        _tell_why,
    )
    why.add_argument(
        "place",
        metavar="FILE[:LINE]|CORE",
        help="a generated file in a build, of which all lines are explained without LINE; or, with --target, a core",
    )
    why.add_argument(
        "--target",
        metavar="NAME",
        help="name the inputs that differed when the steps of this target ran in 'firm test' or 'firm build --cached'",
    )
    why.add_argument(
        "--build-root", type=Path, metavar="DIR", help="the folder of the builds (default: FuseSoC's build folder)"
    )


def _tell_why(arguments: argparse.Namespace) -> None:
    if arguments.target:
        _tell_steps(arguments.place, arguments.target, arguments.build_root)
    else:
        _tell_lines(arguments.place)


def _tell_steps(core: str, target: str, build_root: Path | None) -> None:
    from fusesoc_firm.builds.setup.plan import make_plan
    from fusesoc_firm.builds.setup.steps import steps_of

    (build,) = make_plan([core], [target], build_root).builds
    if not (steps := steps_of(build)):
        fail(f"{build} has no cached steps here", hint=f"run 'firm build {build.core} --target {target} --cached'")
    print(build)
    for step in steps:
        reasons = [*step.reasons[:_MOST_REASONS]]
        if more := len(step.reasons) - len(reasons):
            reasons.append(f"and {more} more")
        print(f"  {step.name:5}  {step.state}", *(f"         {reason}" for reason in reasons), sep="\n")


def _tell_lines(written: str) -> None:
    from fusesoc_firm.builds.call.why import why

    path, number = _split(written)
    if not path.is_file():
        fail(f"there is no file {path}", hint=nearest_file(path) or "the form is FILE or FILE:LINE")
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
