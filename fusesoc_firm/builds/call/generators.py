"""The table of generators, with each generator's parameters and functions.

A generator imports its stages only when it is called, since these imports take longer than most of the work.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from fusesoc_firm.builds.call import message_core
from fusesoc_firm.builds.call.parameters import Parameter
from fusesoc_firm.converter.pipeline import PIPELINES
from fusesoc_firm.core.request import GeneratedCore, GeneratedFile, LoadedRequest, Request
from fusesoc_firm.text.naming import PREFIX_RULE, is_library, is_prefix
from fusesoc_firm.tools.programs import has_package, simulation_programs
from fusesoc_firm.tools.simulators import SIMULATORS, default_simulator

# The generator of message cores.
MESSAGES = "firm_messages"
# The largest seed of `math_real.uniform`, which draws the stalls.
_LARGEST_SEED = 2147483562


@dataclass(frozen=True)
class Generator:
    """A generator: its parameters, and the function that derives the data for a request.

    `load` derives all the data needed for a request, and raises `InputError` for faults in the user's input. `programs`
    returns the programs required to run the core. `tools` returns the versions of the programs that generate part of
    the core.
    """

    parameters: tuple[Parameter, ...]
    load: Callable[[Request], LoadedRequest]
    programs: Callable[[Request], Sequence[str]] = lambda _: ()
    tools: Callable[[Request], Mapping[str, str]] = lambda _: {}


def _load_converters(request: Request) -> LoadedRequest:
    from fusesoc_firm.converter import converter_core

    loaded = converter_core.load(request)
    library = str(request.parameters["logical_name"] or "")
    return replace(loaded, generate=lambda: _in_library(loaded.generate(), library)) if library else loaded


def _in_library(core: GeneratedCore, library: str) -> GeneratedCore:
    return replace(core, files={name: replace(file, logical_name=library) for name, file in core.files.items()})


def _load_system(request: Request) -> LoadedRequest:
    from fusesoc_firm.converter.converter_core import VHDL
    from fusesoc_firm.fabric.ethernet import node_files
    from fusesoc_firm.fabric.ros1 import rom_files
    from fusesoc_firm.node.package import cpp_package
    from fusesoc_firm.runs.simulation import simulation_core
    from fusesoc_firm.system import system_core

    def make_system(_: Request, loaded: system_core.LoadedSystem) -> GeneratedCore:
        for warning in loaded.warnings:
            print(warning, file=sys.stderr)
        core = system_core.system_core(loaded)
        made = rom_files(loaded.system, loaded.libraries) | node_files(loaded.system, loaded.libraries)
        parts = {name: GeneratedFile(text, VHDL) for name, text in made.items()}
        node = {} if loaded.system.network else cpp_package.generated_files(loaded)
        return replace(core, files={**parts, **core.files, **node})

    loaded = system_core.load_requested(request)
    make: Callable[[Request, system_core.LoadedSystem], GeneratedCore]
    if request.parameters["product"] in {"live", "network"}:
        live = {"live": simulation_core.live_core, "network": simulation_core.network_core}
        inputs, make = simulation_core.live_inputs(request, loaded), live[str(request.parameters["product"])]
    elif _is_simulation(request):
        inputs, make = simulation_core.inputs(request, loaded), simulation_core.simulation_core
    else:
        inputs, make = [*system_core.inputs(request, loaded), *cpp_package.headers()], make_system
    return LoadedRequest(request, inputs, lambda: make(request, loaded), loaded.definitions)


def _simulator_programs(request: Request) -> Sequence[str]:
    """Return the programs of a simulation, except those without a package, which few machines have.

    Such a machine generates and locks the target all the same; the build names the missing program.
    """
    programs = simulation_programs(str(request.parameters["simulator"])) if _is_simulation(request) else ()
    return [program for program in programs if has_package(program)]


def _compiler(request: Request) -> Mapping[str, str]:
    if not _is_simulation(request):
        return {}
    from fusesoc_firm.runs.simulation.kernel_library import toolchain

    return toolchain()


def _is_simulation(request: Request) -> bool:
    return request.parameters["product"] != "system"


_PATHS = Parameter("paths", "list", "folders and bags with message definitions, relative to the core")

_MESSAGES = Parameter(
    "messages",
    "list",
    "cores with message definitions, such as robot:msgs:arm; the requesting core depends on these cores",
)

_DISTRO = Parameter("distro", "str", "the ROS distribution that provides the standard messages")

_LOCKED = Parameter("locked", "str", "a lock file, relative to the core; any difference from this file is an error")

GENERATORS: Mapping[str, Generator] = {
    "firm": Generator(
        (
            Parameter(
                "message",
                "str",
                "the type of a message, service or action, such as geometry_msgs/Quaternion",
                is_required=True,
            ),
            Parameter("ros", "int", "the ROS version", is_required=True, choices=(1, 2)),
            Parameter(
                "direction", "str", "converters to generate", "both", choices=("subscriber", "publisher", "both")
            ),
            Parameter("width", "int", "the stream's width in bits", 8, choices=(8, 16, 32, 64, 128, 256, 512)),
            Parameter(
                "name",
                "str",
                "prefix for the names of all generated units, such as left; required for a second core of a message",
                rule=(PREFIX_RULE, is_prefix),
            ),
            Parameter(
                "logical_name",
                "str",
                "the VHDL library of all generated files (default: the one of files without a library)",
                rule=(f"{PREFIX_RULE}, and no library of the language", is_library),
            ),
            Parameter(
                "pipeline",
                "str",
                "register stages of subscribers of variable size (default: full if the message has more than 256 bytes"
                " of fields, otherwise none)",
                choices=PIPELINES,
            ),
            Parameter("include", "list", "fields with ports, such as pose.position (default: all fields)"),
            Parameter("exclude", "list", "fields without ports; a publisher sends the default values of these fields"),
            Parameter(
                "config",
                "str",
                "a file, relative to the core, that lists messages and the names of their interfaces",
                replaces=("message", "ros", "direction", "width", "name", "include", "exclude"),
            ),
            _PATHS,
            _MESSAGES,
            _DISTRO,
            _LOCKED,
        ),
        _load_converters,
    ),
    "far": Generator(
        (
            Parameter("spec", "str", "the system's YAML specification, relative to the core", is_required=True),
            Parameter(
                "product",
                "str",
                "the product to generate",
                "system",
                choices=("system", "simulation", "live", "network"),
            ),
            Parameter("board", "str", "the name of a supported board, or a YAML file relative to the core"),
            Parameter(
                "interconnect",
                "str",
                "the connection to the host, instead of the specification's",
                choices=("axi_stream", "uart", "spi"),
            ),
            Parameter("clock", "str", "the frequency of clk, such as 10 MHz, instead of the specification's"),
            Parameter("stimuli", "str", "messages to send in the simulation: a YAML file or a bag"),
            Parameter("model", "str", "a Python file with a function that computes the system's responses"),
            Parameter(
                "environment",
                "list",
                "VHDL files of the environment at the pins; the last file has the name of its entity",
            ),
            Parameter(
                "simulator",
                "str",
                "the simulator",
                default_simulator(),
                choices=tuple(SIMULATORS),
            ),
            Parameter("seed", "int", "the seed of the simulation's random stalls", 1, bounds=(1, _LARGEST_SEED)),
            Parameter(
                "stall_percent", "int", "percentage of cycles in which the host stalls a stream", 25, bounds=(0, 99)
            ),
            Parameter("files", "list", "other files that the model or software functions read"),
            _PATHS,
            _MESSAGES,
            _DISTRO,
            _LOCKED,
        ),
        _load_system,
        _simulator_programs,
        _compiler,
    ),
    MESSAGES: Generator(
        (
            Parameter("paths", "list", "folders with message definitions, relative to the core", is_required=True),
            _MESSAGES,
        ),
        message_core.load,
    ),
}
