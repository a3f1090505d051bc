"""The door for FuseSoC: answers its call of a generator.

FuseSoC starts a generator in an empty folder with one argument, a YAML file that holds the new core's name, the
requesting core's folder and the parameters. It loads every `.core` that it finds in the folder afterwards, so that file
is written last. What the generator prints is shown to the user as it is.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.request.parameters import Parameter, check_parameters
from fusesoc_firm.request.request import GeneratedCore, Request, as_files
from fusesoc_firm.request.requesting_core import find_requesting_core
from fusesoc_firm.store.design_units import clash, note_units, units_of
from fusesoc_firm.store.message_runs import mark_run, run_of
from fusesoc_firm.store.own_code import PACKAGE, digests, used_code
from fusesoc_firm.store.reads import Input, Reads, noted
from fusesoc_firm.store.recall import LOCKED, SEARCHED, Fact, call_digest, facts
from fusesoc_firm.store.store import Call as StoredCall
from fusesoc_firm.store.store import Entry, Files, Key, Made, default_store, request_digest
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, SourceRef, fail
from fusesoc_firm.text.files import hide_generated, write_if_changed
from fusesoc_firm.text.naming import PREFIX_RULE, is_prefix
from fusesoc_firm.text.yaml_text import yaml_data
from fusesoc_firm.tools.programs import explanation, missing, simulation_programs
from fusesoc_firm.tools.simulators import SIMULATORS, default_simulator

# The generator of cores that carry messages.
MESSAGES = "firm_messages"
# The largest that `math_real.uniform` takes, which draws the stalls.
_LARGEST_SEED = 2147483562
# FuseSoC does so at the start of every run of a target.
_REMOVED = """the folder that this generator was started in was removed: the same target is being run twice at once
      = 'firm build' does this without harm"""


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
    what its user did wrong. `programs` are those without which what was made cannot be run. `tools` are the versions
    of programs that make part of it. `cores` carry messages and are named by the files of a request.
    """

    parameters: tuple[Parameter, ...]
    inputs: Callable[[Request], Sequence[Input]]
    generate: Callable[[Request], GeneratedCore]
    programs: Callable[[Request], Sequence[str]] = lambda _: ()
    tools: Callable[[Request], Mapping[str, str]] = lambda _: {}
    cores: Callable[[Request], MessageCores] = lambda _: {}


def _converter_inputs(request: Request) -> list[Input]:
    from fusesoc_firm.converter import converter_core

    return converter_core.inputs(request)


def _generate_converters(request: Request) -> GeneratedCore:
    from fusesoc_firm.converter import converter_core

    return converter_core.generate(request)


def _message_inputs(request: Request) -> Sequence[Input]:
    from fusesoc_firm.request import message_core

    return message_core.inputs(request)


def _copy_messages(request: Request) -> GeneratedCore:
    from fusesoc_firm.request import message_core

    return message_core.generate(request)


def _system_inputs(request: Request) -> list[Input]:
    from fusesoc_firm.node import package
    from fusesoc_firm.simulation import simulation_core
    from fusesoc_firm.system import system_core

    if request.parameters["product"] == "live":
        return simulation_core.live_inputs(request)
    if _is_simulation(request):
        return simulation_core.inputs(request)
    return [*system_core.inputs(request), *package.headers()]


def _generate_system(request: Request) -> GeneratedCore:
    from fusesoc_firm.node import package
    from fusesoc_firm.simulation import simulation_core
    from fusesoc_firm.system import system_core

    if request.parameters["product"] == "live":
        return simulation_core.generate_live(request)
    if _is_simulation(request):
        return simulation_core.generate(request)
    loaded = system_core.load_requested(request)
    for warning in loaded.warnings:
        print(warning, file=sys.stderr)
    core = system_core.system_core(loaded)
    return replace(core, files={**core.files, **package.generated_files(loaded)})


def _simulator_programs(request: Request) -> Sequence[str]:
    return simulation_programs(str(request.parameters["simulator"])) if _is_simulation(request) else []


def _compiler(request: Request) -> Mapping[str, str]:
    if not _is_simulation(request):
        return {}
    from fusesoc_firm.simulation.kernel import toolchain

    return toolchain()


def _cores_of_specification(request: Request) -> MessageCores:
    from fusesoc_firm.system.system_core import message_cores

    return message_cores(request)


def _is_simulation(request: Request) -> bool:
    return request.parameters["product"] != "system"


_PATHS = Parameter("paths", "list", "folders and bags with message definitions, relative to the core")

_MESSAGES = Parameter(
    "messages", "list", "cores with message definitions, such as robot:msgs:arm; the core depends on them"
)

_DISTRO = Parameter("distro", "str", "the ROS distribution of standard messages")

_LOCKED = Parameter("locked", "str", "a lock file, relative to the core; any difference from it is an error")

GENERATORS: Mapping[str, Generator] = {
    "firm": Generator(
        (
            Parameter(
                "message",
                "str",
                "the type of a message, service or action, such as geometry_msgs/Quaternion",
                is_required=True,
            ),
            Parameter("ros", "int", "the version of ROS", is_required=True, choices=(1, 2)),
            Parameter("direction", "str", "converters to generate", "both", choices=("subscriber", "publisher", "both")),
            Parameter("width", "int", "bits of the stream", 8, choices=(8, 16, 32, 64, 128, 256, 512)),
            Parameter(
                "name",
                "str",
                "prefix of the names of all generated units, such as left; required for a second core of the same message",
                rule=(PREFIX_RULE, is_prefix),
            ),
            Parameter("include", "list", "fields with ports, such as pose.position; default all fields"),
            Parameter("exclude", "list", "fields without ports; a publisher sends their defaults"),
            Parameter(
                "config",
                "str",
                "a file that lists messages and the names of their interfaces, relative to the core",
                replaces=("message", "ros", "direction", "width", "name", "include", "exclude"),
            ),
            _PATHS,
            _MESSAGES,
            _DISTRO,
            _LOCKED,
        ),
        _converter_inputs,
        _generate_converters,
    ),
    "far": Generator(
        (
            Parameter("spec", "str", "the system's YAML specification, relative to the core", is_required=True),
            Parameter("product", "str", "the product to generate", "system", choices=("system", "simulation", "live")),
            Parameter("board", "str", "the board: the name of a supported one, or a YAML file relative to the core"),
            Parameter("stimuli", "str", "messages to send in the simulation: a YAML file or a bag"),
            Parameter("model", "str", "a Python file with a function that computes the system's answers"),
            Parameter(
                "environment", "list", "VHDL files of the environment at the pins; the last has the name of its entity"
            ),
            Parameter(
                "simulator",
                "str",
                "the simulator",
                default_simulator(),
                choices=tuple(SIMULATORS),
            ),
            Parameter("seed", "int", "the seed of the simulation's random stalls", 1, bounds=(1, _LARGEST_SEED)),
            Parameter("stall_percent", "int", "probability of a stall of a stream in a cycle, in percent", 25, bounds=(0, 99)),
            Parameter("files", "list", "further files that the model or functions in software read"),
            _PATHS,
            _MESSAGES,
            _DISTRO,
            _LOCKED,
        ),
        _system_inputs,
        _generate_system,
        _simulator_programs,
        _compiler,
        _cores_of_specification,
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
        path = Path(argv[0])
        request = read_request(command, path, generators[command])
        absent = missing(generators[command].programs(request))
        is_locked = _check_locked(request)
        # What is locked is compared on every run, and what is missing is said.
        entry = obtain(request, generators[command], None if absent or is_locked else path)
        _write_core(entry.files, request, run_of(os.getppid()))
        if marks := _marks(request):
            mark_run("", marks)
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    except FileNotFoundError:
        if _is_here():
            raise
        print(f"{command}: error: {_REMOVED}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    # It can be generated and not be run.
    if absent:
        print(f"{command}: {explanation(absent)}", flush=True)
    origin = "from store" if entry.is_from_store else "generated"
    print(f"{command}: {request.name} {origin} in {time.monotonic() - start:.2f} s", flush=True)
    return 0


def _is_here() -> bool:
    """Whether the current folder has not been removed."""
    try:
        return bool(Path.cwd())
    except FileNotFoundError:
        return False


def _check_locked(request: Request) -> bool:
    """Tell whether a request is held to a lock file. Raises `InputError` with what differs from one."""
    places: list[Path] = []
    if name := request.parameters.get("locked"):
        places.append(request.files_root / str(name))
    if name := os.environ.get(LOCKED):
        if not Path(name).is_absolute():
            fail(f"{LOCKED} is '{name}'", hint=f"a generator has a folder of its own; write {LOCKED}=$PWD/{name}")
        places.append(Path(name))
    for place in places:
        from fusesoc_firm.plugin.lock_file import check_request

        check_request(place, request, has_messages=request.command != MESSAGES)
    return bool(places)


def _marks(request: Request) -> str:
    """The core whose messages a request generates; "" for all else."""
    return find_requesting_core(request.files_root, request.name).name if request.command == MESSAGES else ""


def read_request(command: str, path: Path, generator: Generator, *, is_this_run: bool = True) -> Request:
    """The request in FuseSoC's file, with checked parameters; if it `is_this_run`, of the FuseSoC that started us.

    Raises `InputError`.
    """
    call = read_call(path)

    def beside(names: MessageCores) -> tuple[Path, ...]:
        from fusesoc_firm.request.message_core import folders_of_run

        return folders_of_run(names, path.absolute().parent.parent, is_this_run=is_this_run)

    return make_request(command, call, generator, beside)


def read_call(path: Path) -> Call:
    """What FuseSoC's file says. Raises `InputError`."""
    try:
        call: dict[str, Any] = yaml_data(path.read_text(encoding="utf-8"))
        return Call(str(call["vlnv"]), Path(call["files_root"]), call.get("parameters") or {})
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError) as error:
        fail(f"{path} is no file of FuseSoC's generator call: {error}")


def make_request(
    command: str,
    call: Call,
    generator: Generator,
    message_folders: Callable[[MessageCores], tuple[Path, ...]],
) -> Request:
    """The request of a call, with checked parameters; `message_folders` finds those of the cores that it names.

    Raises `InputError`.
    """
    origin = find_requesting_core(call.files_root, call.vlnv.split(":")[2])
    checked = check_parameters(call.given, generator.parameters, origin)
    places = {name: origin.items(name) for name, value in checked.items() if isinstance(value, list)}
    request = Request(command, call.vlnv, call.files_root, checked, places)
    folders: dict[str, tuple[Path, ...]] = {}
    faults = Diagnostics()
    for name, source in {**request.listed("messages"), **generator.cores(request)}.items():
        try:
            folders[name] = message_folders({name: source})
        except InputError as error:
            faults.take(error, source)
    faults.raise_if_any()
    return replace(request, message_folders=folders)


def obtain(request: Request, generator: Generator, path: Path | None = None) -> Entry:
    """The files of the core that a request asks for, out of the store if it has them. Raises `InputError`.

    If `path` is FuseSoC's file of the call, the answer is noted, so that it can be recalled.
    """
    of_key = Reads()

    def key() -> Key:
        with noted(of_key):
            return _key(request, generator, of_key)

    def build() -> Made:
        of_build = Reads()
        with noted(of_build):
            core = generator.generate(request)
        _check_declared(of_build, of_key)
        return Made(as_files(core, request), used_code())

    return default_store().obtain(key, build, _stored_call(request, generator, path, of_key) if path else None)


class _NotStoredError(Exception):
    """The store does not have what was asked for."""


def answer_from_store(command: str, path: Path) -> bool:
    """Write what FuseSoC's file asks for into the current folder; False, and nothing is written, if that must be made.

    So it is where anything is out of the ordinary, too: then whoever makes it says what.
    """

    def refuse() -> Made:
        raise _NotStoredError

    generator = GENERATORS[command]
    start = time.monotonic()
    try:
        request = read_request(command, path, generator)
        if missing(generator.programs(request)) or _check_locked(request) or _marks(request):
            return False
        files = default_store().obtain(lambda: _key(request, generator, Reads()), refuse).files
        # This process is FuseSoC itself.
        _write_core(files, request, run_of(os.getpid()))
    except (InputError, _NotStoredError):
        return False
    print(f"{command}: {request.name} from store in {time.monotonic() - start:.2f} s", flush=True)
    return True


def used_before(request: Request, generator: Generator) -> list[str] | None:
    """Names of our own files that answered a request when it was last made; None if the store does not know it."""
    return default_store().uses(_key(request, generator, Reads()))


def _key(request: Request, generator: Generator, reads: Reads) -> Key:
    """The key of a request; the inputs are added to `reads`, also where there is none."""
    # First, as later the modules are imported that they belong to.
    code = digests()
    asked = {
        "command": request.command,
        "vlnv": request.vlnv,
        # What is locked is so beside what is made.
        "parameters": {name: value for name, value in request.parameters.items() if name != "locked"},
        "tools": dict(generator.tools(request)),
    }
    given = generator.inputs(request)
    reads.files |= dict.fromkeys(str(item.absolute()) for item in given if isinstance(item, Path))
    inputs = dict(_named_content(item, request) for item in given)
    return Key(request_digest(asked, inputs, code), code, {"core": request.vlnv, "generator": request.command})


def _check_declared(of_build: Reads, of_key: Reads) -> None:
    """Raise `InputError` if something was read that the key does not cover: an edit of it would never be noticed."""
    faults = Diagnostics()
    known = {os.path.realpath(file) for file in of_key.files}
    parts = {os.path.realpath(file) for file in of_key.parts}
    found = [(file, known) for file in of_build.files] + [(file, known | parts) for file in of_build.parts]
    for file, covered in found:
        if os.path.realpath(file) not in covered and Path(file).is_file():
            faults.error(f"{file} was read, which is no input", hint="list it under the generator's parameter 'files'")
    faults.raise_if_any()


def _stored_call(request: Request, generator: Generator, path: Path, reads: Reads) -> StoredCall:
    """How a call is noted, of which FuseSoC's file is at `path`; `reads` are those of the key."""

    def facts_of_key(used: Iterable[str]) -> list[Fact]:
        from fusesoc_firm.request.core_reader import core_name

        entries = [entry for name in SEARCHED for entry in os.environ.get(name, "").split(os.pathsep) if entry]
        environment = [folder for entry in entries for folder in (entry, str(Path(entry, "share")))]
        generated = str(path.absolute().parent.parent)
        return [
            *facts("file", [*reads.files, *(str(PACKAGE / name) for name in used)]),
            *facts("part", [*reads.parts]),
            *facts("folder", [*reads.folders, *environment]),
            *facts("code", [""]),
            *facts("program", sorted({*generator.tools(request), *generator.programs(request)})),
            *facts("messages", [json.dumps([generated, core_name(name)]) for name in request.message_folders]),
        ]

    digest = call_digest(request.command, path.read_bytes())
    return StoredCall(digest, facts_of_key, {"name": request.name, "core": request.vlnv, "marks": _marks(request)})


def _write_core(files: Files, request: Request, run: str) -> None:
    """Write a core into the current folder, unless another one of the run defines one of its units otherwise."""
    units = units_of(files)
    if found := clash("", units, run):
        fail(
            f"{request.vlnv} and {found.core} define the design unit '{found.unit}' in two ways, and a tool keeps one",
            find_requesting_core(request.files_root, request.name).instance(),
            "the parameter 'name' of generator 'firm' gives the units of a core names of their own: name: left",
        )
    _write(files)
    note_units("", request.vlnv, units, run)


def _write(files: Files) -> None:
    """Write a core into the current folder, the `.core` last."""
    hide_generated()
    for name, content in files.items():
        try:
            write_if_changed(Path(name), content)
        except OSError as error:
            fail(f"cannot write {Path(name).absolute()}: {error.strerror}")


def _name(path: Path, request: Request) -> str:
    """An input's name in the key: the same for copies of a project in different folders."""
    folders = request.folders_of(request.message_folders)
    for root in (request.files_root, *folders):
        if path.is_relative_to(root):
            number = folders.index(root) if root != request.files_root else None
            name = str(path.relative_to(root))
            return name if number is None else f"messages/{number}/{name}"
    return str(path)


def _named_content(item: Input, request: Request) -> tuple[str, bytes | None]:
    """An input's name in the key, and what counts of it."""
    if isinstance(item, Path):
        return _name(item, request), _content(item)
    return f"{_name(item.path, request)}:{item.name}", item.content


def _content(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None
