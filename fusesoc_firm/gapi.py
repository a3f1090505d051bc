"""The door for FuseSoC: answers its call of a generator.

FuseSoC starts a generator in an empty folder with one argument, a YAML file that holds the new core's name, the
requesting core's folder and the parameters. It loads every `.core` that it finds in the folder afterwards, so that file
is written last. What the generator prints is shown to the user as it is.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.diagnostics import InputError, SourceRef, fail
from fusesoc_firm.generation import GeneratedCore, Request, as_files
from fusesoc_firm.netlist.programs import explanation, missing_programs
from fusesoc_firm.own_code import digests, used_code
from fusesoc_firm.parameters import Parameter, check_parameters
from fusesoc_firm.render import write_if_changed
from fusesoc_firm.requesting_core import find_requesting_core
from fusesoc_firm.store import Entry, Files, Key, Made, default_store, request_digest

# The generator of cores that carry messages.
MESSAGES = "firm_messages"
# The largest that `math_real.uniform` takes, which draws the stalls.
_LARGEST_SEED = 2147483562


@dataclass(frozen=True)
class Call:
    """What FuseSoC says: the new core's name, the requesting core's folder, and the parameters that it gives."""

    vlnv: str
    files_root: Path
    given: Mapping[str, Any]


MessageCores = Mapping[str, SourceRef | None]
"""Names of cores that carry messages, each with its place."""


@dataclass(frozen=True)
class Generator:
    """A generator: its parameters, the files whose content it depends on, what it makes of them, and what that needs.

    `inputs` is cheap, since it is asked on every run; a path in it need not exist. `generate` raises `InputError` for
    what its user did wrong. `missing_programs` are those without which what was made cannot be run. `tools` are the
    versions of programs that make part of it.
    """

    parameters: tuple[Parameter, ...]
    inputs: Callable[[Request], list[Path]]
    generate: Callable[[Request], GeneratedCore]
    missing_programs: Callable[[Request], list[str]] = lambda _: []
    tools: Callable[[Request], Mapping[str, str]] = lambda _: {}


def _converter_inputs(request: Request) -> list[Path]:
    from fusesoc_firm.converter import generator

    return generator.inputs(request)


def _generate_converters(request: Request) -> GeneratedCore:
    from fusesoc_firm.converter import generator

    return generator.generate(request)


def _message_inputs(request: Request) -> list[Path]:
    from fusesoc_firm import message_core

    return message_core.inputs(request)


def _copy_messages(request: Request) -> GeneratedCore:
    from fusesoc_firm import message_core

    return message_core.generate(request)


def _system_inputs(request: Request) -> list[Path]:
    from fusesoc_firm.host import node_package, simulation
    from fusesoc_firm.system import generator

    if request.parameters["product"] == "live":
        return simulation.live_inputs(request)
    if _is_simulation(request):
        return simulation.inputs(request)
    return [*generator.inputs(request), *node_package.headers()]


def _generate_system(request: Request) -> GeneratedCore:
    from fusesoc_firm.host import node_package, simulation
    from fusesoc_firm.system import generator

    if request.parameters["product"] == "live":
        return simulation.generate_live(request)
    if _is_simulation(request):
        return simulation.generate(request)
    loaded = generator.load_requested(request)
    core = generator.system_core(loaded)
    return replace(core, files={**core.files, **node_package.generated_files(loaded)})


def _simulator_programs(request: Request) -> list[str]:
    return missing_programs(str(request.parameters["simulator"])) if _is_simulation(request) else []


def _compiler(request: Request) -> Mapping[str, str]:
    if not _is_simulation(request):
        return {}
    from fusesoc_firm.host.kernel import toolchain

    return toolchain()


def _is_simulation(request: Request) -> bool:
    return request.parameters["product"] != "system"


_PATHS = Parameter("paths", "list", "folders with message definitions, relative to the core")

_MESSAGES = Parameter(
    "messages", "list", "cores with message definitions, such as robot:msgs:arm; the core depends on them"
)

_DISTRO = Parameter("distro", "str", "the ROS distribution whose standard messages are meant")

GENERATORS: Mapping[str, Generator] = {
    "firm": Generator(
        (
            Parameter(
                "message",
                "str",
                "the type of a message, service or action, such as geometry_msgs/Quaternion",
                is_required=True,
            ),
            Parameter("ros", "int", "the ROS version whose wire format is spoken", is_required=True, choices=(1, 2)),
            Parameter("direction", "str", "which converters", "both", choices=("subscriber", "publisher", "both")),
            Parameter("width", "int", "bits of the stream", 8, choices=(8, 16, 32, 64, 128, 256, 512)),
            Parameter("include", "list", "fields that get ports, such as pose.position; all unless given"),
            Parameter("exclude", "list", "fields that get none of these; a publisher sends their defaults"),
            Parameter(
                "config",
                "str",
                "a file that lists messages and the names of their interfaces, relative to the core",
                replaces=("message", "ros", "direction", "width", "include", "exclude"),
            ),
            _PATHS,
            _MESSAGES,
            _DISTRO,
        ),
        _converter_inputs,
        _generate_converters,
    ),
    "far": Generator(
        (
            Parameter("spec", "str", "the system's YAML specification, relative to the core", is_required=True),
            Parameter("product", "str", "what to make of it", "system", choices=("system", "simulation", "live")),
            Parameter("board", "str", "the board it is for: one of ours, or a YAML file relative to the core"),
            Parameter("stimuli", "str", "messages to send in the simulation: a YAML file or a bag"),
            Parameter("model", "str", "a Python file with the function that says what the system answers"),
            Parameter(
                "environment", "list", "VHDL files that play what is at the pins; the last is called as its entity"
            ),
            Parameter(
                "simulator", "str", "what shall run the simulation", "ghdl", choices=("ghdl", "icarus", "verilator")
            ),
            Parameter("seed", "int", "the seed of the simulation's random stalls", 1, bounds=(1, _LARGEST_SEED)),
            Parameter("stall_percent", "int", "how often the simulation stalls a stream", 25, bounds=(0, 99)),
            _PATHS,
            _MESSAGES,
            _DISTRO,
        ),
        _system_inputs,
        _generate_system,
        _simulator_programs,
        _compiler,
    ),
    MESSAGES: Generator(
        (
            Parameter("paths", "list", "folders with message definitions, relative to the core", is_required=True),
            _MESSAGES,
        ),
        _message_inputs,
        _copy_messages,
    ),
}


def main(command: str, argv: list[str], generators: Mapping[str, Generator] = GENERATORS) -> int:
    """Run the generator `command` on the file that FuseSoC names; the exit status is 1 for faults, 130 for Ctrl-C."""
    start = time.monotonic()
    try:
        if len(argv) != 1:
            fail(f"{command} is a generator that FuseSoC calls with one file; a core uses it in its 'generate' section")
        request = read_request(command, Path(argv[0]), generators[command].parameters)
        entry = obtain(request, generators[command])
        _write(entry.files)
        if command == MESSAGES:
            _mark_run(request)
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    # It can be generated and not be run.
    if missing := generators[command].missing_programs(request):
        print(f"{command}: {explanation(missing)}", flush=True)
    origin = "from store" if entry.is_from_store else "generated"
    print(f"{command}: {request.name} {origin} in {time.monotonic() - start:.2f} s", flush=True)
    return 0


def _mark_run(request: Request) -> None:
    from fusesoc_firm.message_core import mark_run

    mark_run(Path(), find_requesting_core(request.files_root, request.name).name)


def read_request(command: str, path: Path, parameters: tuple[Parameter, ...], *, is_this_run: bool = True) -> Request:
    """The request in FuseSoC's file, with checked parameters; if it `is_this_run`, of the FuseSoC that started us.

    Raises `InputError`.
    """
    try:
        call: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
        vlnv, files_root = str(call["vlnv"]), Path(call["files_root"])
        given = call.get("parameters") or {}
    except (OSError, yaml.YAMLError, KeyError, TypeError) as error:
        fail(f"{path} is no file of FuseSoC's generator call: {error}")

    def beside(names: MessageCores) -> tuple[Path, ...]:
        from fusesoc_firm.message_core import folders_of_run

        return folders_of_run(names, path.absolute().parent.parent, is_this_run=is_this_run)

    return make_request(command, Call(vlnv, files_root, given), parameters, beside)


def make_request(
    command: str,
    call: Call,
    parameters: tuple[Parameter, ...],
    message_folders: Callable[[MessageCores], tuple[Path, ...]],
) -> Request:
    """The request of a call, with checked parameters; `message_folders` finds those of the cores that it names.

    Raises `InputError`.
    """
    origin = find_requesting_core(call.files_root, call.vlnv.split(":")[2])
    checked = check_parameters(call.given, parameters, origin)
    places = {name: origin.items(name) for name, value in checked.items() if isinstance(value, list)}
    request = Request(command, call.vlnv, call.files_root, checked, places)
    return (
        replace(request, message_folders=message_folders(names)) if (names := request.listed("messages")) else request
    )


def obtain(request: Request, generator: Generator) -> Entry:
    """The files of the core that a request asks for, out of the store if it has them. Raises `InputError`."""
    return default_store().obtain(
        lambda: _key(request, generator), lambda: Made(as_files(generator.generate(request), request), used_code())
    )


def used_before(request: Request, generator: Generator) -> list[str] | None:
    """Names of our own files that answered a request when it was last made; None if the store does not know it."""
    return default_store().uses(_key(request, generator))


def _key(request: Request, generator: Generator) -> Key:
    # First, as later the modules are imported that they belong to.
    code = digests()
    asked = {
        "command": request.command,
        "vlnv": request.vlnv,
        "parameters": dict(request.parameters),
        "tools": dict(generator.tools(request)),
    }
    inputs = {_name(path, request): _content(path) for path in generator.inputs(request)}
    return Key(request_digest(asked, inputs, code), code, {"core": request.vlnv, "generator": request.command})


def _write(files: Files) -> None:
    """Write a core into the current folder, the `.core` last."""
    for name, content in files.items():
        try:
            write_if_changed(Path(name), content)
        except OSError as error:
            fail(f"cannot write {Path(name).absolute()}: {error.strerror}")


def _name(path: Path, request: Request) -> str:
    """An input's name in the key: the same for copies of a project in different folders."""
    for root in (request.files_root, *request.message_folders):
        if path.is_relative_to(root):
            number = request.message_folders.index(root) if root != request.files_root else None
            name = str(path.relative_to(root))
            return name if number is None else f"messages/{number}/{name}"
    return str(path)


def _content(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None
