"""`firm why`: which lines made a generated line."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import command
from fusesoc_firm.text.diagnostics import SourceRef, fail

if TYPE_CHECKING:
    from fusesoc_firm.plugin.why import Names
    from fusesoc_firm.request.request import Request
    from fusesoc_firm.text.render import TracedLine


def add_why(commands: Any) -> None:
    """Declare the command."""
    why = command(
        commands,
        "why",
        "tell which line of a template, of the specification and of a message made a generated line",
        "firm why build/robot_sys_quat2euler_0.2.0/sim/src/robot_sys_quat2euler-system_0.2.0/quat2euler_system.vhd:80",
        _tell_why,
    )
    why.add_argument("place", metavar="FILE[:LINE]", help="a generated file of a build; without LINE, every line of it")


def _tell_why(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.plugin.answer import read_request
    from fusesoc_firm.plugin.generators import GENERATORS
    from fusesoc_firm.plugin.why import call_file, reasons, rendering_of

    path, number = _split(arguments.place)
    if not path.is_file():
        fail(f"there is no file {path}", hint="after its name stands a line, or nothing: FILE:LINE")
    call, name = call_file(path)
    command_ = _generator(call)
    request = read_request(command_, call, GENERATORS[command_])
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        fail(f"{path} is no text that can be read: {error}")
    loaded = GENERATORS[command_].load(request)
    rendering = rendering_of(loaded.generate, name, text, loaded.inputs)
    found = reasons(rendering, _names(request))
    if number is None:
        for count, reason in enumerate(found, start=1):
            shown = [_shown(place) for place in (*reason.specification, *reason.messages)]
            print(f"{count}: {', '.join([_template(reason.line), *shown])}")
        return
    if not 1 <= number <= len(found):
        fail(f"{path} has no line {number}, its last one is {len(found)}")
    reason = found[number - 1]
    print(reason.line.text)
    print(f"  template       {_template(reason.line)}")
    for kind, places in (("specification", reason.specification), ("message", reason.messages)):
        for place in places:
            print(f"  {kind:13}  {_shown(place)}: {place.text.strip()}")


def _split(text: str) -> tuple[Path, int | None]:
    file, _, number = text.rpartition(":")
    return (Path(file), int(number)) if file and number.isdecimal() else (Path(text), None)


def _generator(call: Path) -> str:
    """The generator that a call is for: FuseSoC does not write it down."""
    from fusesoc_firm.plugin.generators import MESSAGES
    from fusesoc_firm.text.yaml_text import yaml_data

    given = yaml_data(call.read_text(encoding="utf-8")).get("parameters") or {}
    if "spec" in given:
        return "far"
    return "firm" if {"message", "config"} & given.keys() else MESSAGES


def _names(request: Request) -> Names:
    from fusesoc_firm.plugin.why import names_of

    if request.command == "far":
        from fusesoc_firm.system.system_core import load_requested

        loaded = load_requested(request)
        return names_of(loaded.specification, loaded.messages())
    from fusesoc_firm.converter.converter_core import order_of_request

    return names_of(None, [(wanted.message, wanted.definitions) for wanted in order_of_request(request).messages])


def _template(line: TracedLine) -> str:
    return f"{line.template}:{line.line}{f' for {line.scope}' if line.scope else ''}"


def _shown(place: SourceRef) -> str:
    here = Path.cwd()
    file = Path(place.file)
    name = file.relative_to(here) if file.is_absolute() and file.is_relative_to(here) else place.file
    return f"{name}:{place.line}"
