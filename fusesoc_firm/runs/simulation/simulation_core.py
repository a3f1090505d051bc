"""Generate the simulation of a system as a core: test bench, stimuli, expected frames and simulated kernels.

A live simulation has no files of frames. Its test bench carries out the requests that another program sends over a pipe
(docs/reference/transports.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from fusesoc_firm.accelerator.functions import compiled_model
from fusesoc_firm.accelerator.user_code import UserFunction
from fusesoc_firm.converter.converter_core import VHDL
from fusesoc_firm.core.request import GeneratedCore, GeneratedFile, Request
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.runs.simulation.environment import environment_files
from fusesoc_firm.runs.simulation.host_files import SOFTWARE_FILE, expected_text, software_text, stimulus_text
from fusesoc_firm.runs.simulation.kernel_library import check_compiles, kernel_files
from fusesoc_firm.runs.simulation.model_text import check_model
from fusesoc_firm.runs.simulation.reference import Response, load_model
from fusesoc_firm.runs.simulation.software_run import (
    answered,
    published,
    responses_of,
    system_stimuli,
    traffic,
)
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.runs.simulation.ways import ways_of
from fusesoc_firm.system import system_core
from fusesoc_firm.system.derived.model import DerivedSystem, NetworkKind
from fusesoc_firm.system.hardware.configuration import (
    NODE_BENCH_TEMPLATE,
    PHY_BENCH_TEMPLATE,
    SYSTEM_TEMPLATE,
    TEST_BENCH_TEMPLATE,
    system_configuration,
    test_bench_configuration,
)
from fusesoc_firm.system.hardware.verilog_bench import (
    ENVIRONMENT_TEMPLATE,
    VERILOG_BENCH_TEMPLATE,
    VERILOG_NODE_BENCH_TEMPLATE,
    VERILOG_PHY_BENCH_TEMPLATE,
    translated_unit,
    verilog_bench_configuration,
)
from fusesoc_firm.system.hardware.waits import watched_entity
from fusesoc_firm.system.system_core import LoadedSystem, flow_file
from fusesoc_firm.system.written.specification import NETWORKS
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, fail
from fusesoc_firm.text.render import Context, render
from fusesoc_firm.tools.flows import simulator_flow
from fusesoc_firm.tools.reads import Input
from fusesoc_firm.tools.simulators import SIMULATORS, fitting
from fusesoc_firm.tools.yosys import is_system_verilog

# The number of messages to which the model responds in a check.
_MOST_CHECKED = 100
# Synthesis and the translation to Verilog must not use a test bench.
_BENCH_TAGS = ("simulation",)


def inputs(request: Request, loaded: LoadedSystem) -> list[Input]:
    """Return the files of the system, stimuli, model and environment, and the files that the user's code reads."""
    found = [*live_inputs(request, loaded), *_files(request)]
    model = [_path(request, "model")] if request.parameters["model"] else []
    return [*found, *_stimuli_files(_path(request, "stimuli")), *model]


def simulation_core(request: Request, loaded: LoadedSystem) -> GeneratedCore:
    """Return the simulation core, which complements the system's core from the same specification.

    May raise `InputError`.
    """
    system = loaded.system
    _check_possible(request, loaded)
    faults = Diagnostics()
    with faults.noting(request.place("stimuli")):
        stimuli = system_stimuli(_path(request, "stimuli"), loaded)
    with faults.noting(request.place("model")):
        model = _model(request, loaded)
    faults.raise_if_any()
    found = traffic(system, loaded.folder, stimuli, responses_of(model, stimuli, system))
    seed, stall_percent = request.parameters["seed"], request.parameters["stall_percent"]
    assert isinstance(seed, int)
    assert isinstance(stall_percent, int)
    environment = environment_files(_environment(request), system)
    configuration = test_bench_configuration(system, seed, stall_percent, _entity(environment), is_live=False)
    files = _surroundings(loaded, environment, str(request.parameters["simulator"]))
    if SIMULATORS[str(request.parameters["simulator"])].reads_vhdl:
        files |= _vhdl_bench(configuration)
    else:
        frames = max(len(found.stimuli), len(found.responses))
        files |= _verilog_bench(configuration, system, frames, _beats(found.responses, system.width))
    ways = ways_of(found.responses, found.stimuli, system)
    expected = expected_text(found.responses, system.publishers, system.id_bytes, ways)
    files |= {
        "stimulus.txt": _host_file("stimulus.txt", stimulus_text(found.stimuli, system.subscribers, system.id_bytes)),
        "expected.txt": _host_file("expected.txt", expected),
    }
    if found.published:
        files[SOFTWARE_FILE] = _host_file(SOFTWARE_FILE, software_text(found.published))
    return GeneratedCore(f"Simulation of system {system.name}", files)


def check(request: Request, loaded: LoadedSystem, *, may_run: bool) -> None:
    """Raise `InputError` with the faults of a simulation that are known before anything is compiled.

    The text of the model is checked. If it `may_run`, it responds to the messages or, if there are many, to the first
    ones.
    """
    faults = Diagnostics()
    stimuli: list[Stimulus] = []
    with faults.noting():
        _check_possible(request, loaded)
        environment_files(_environment(request), loaded.system)
    for kernel in loaded.system.kernels:
        with faults.noting():
            check_compiles(kernel, loaded.folder)
    with faults.noting(request.place("stimuli")):
        stimuli = system_stimuli(_path(request, "stimuli"), loaded, _MOST_CHECKED + 1)
    with faults.noting(request.place("model")):
        if request.parameters["model"]:
            frames = {topic.block: topic.frame for topic in answered(loaded.system)}
            check_model(_path(request, "model"), frames, published(loaded.system), faults)
    faults.raise_if_any()
    if may_run:
        found = responses_of(_model(request, loaded), stimuli[:_MOST_CHECKED], loaded.system)
        if len(stimuli) <= _MOST_CHECKED:
            traffic(loaded.system, loaded.folder, stimuli, found)


def _model(request: Request, loaded: LoadedSystem) -> UserFunction:
    """Return the model that the request names, or the functions from which all accelerators are compiled."""
    if request.parameters["model"]:
        return load_model(_path(request, "model"))
    return compiled_model(loaded.system, loaded.folder) or load_model(_path(request, "model"))


def _check_possible(request: Request, loaded: LoadedSystem) -> None:
    _check_simulator(loaded.system, str(request.parameters["simulator"]), "sim")
    _refuse_node(loaded)


def _host_file(name: str, text: str) -> GeneratedFile:
    return GeneratedFile(text, "user", copyto=name)


def live_inputs(request: Request, loaded: LoadedSystem) -> list[Input]:
    """Return the files of the system and the environment."""
    return [*system_core.inputs(request, loaded), *_environment(request)]


def live_core(request: Request, loaded: LoadedSystem) -> GeneratedCore:
    """Return the core of a live simulation, whose start sets the seed and the stall rate. May raise `InputError`."""
    _check_simulator(loaded.system, str(request.parameters["simulator"]), "live")
    _refuse_node(loaded)
    files = _watched_system(request, loaded)
    files |= _with_open_end(request, loaded, TEST_BENCH_TEMPLATE, VERILOG_BENCH_TEMPLATE)
    return GeneratedCore(f"Live simulation of system {loaded.system.name}", files)


def network_core(request: Request, loaded: LoadedSystem) -> GeneratedCore:
    """Return the core of a simulated board whose chip or network is at the other end of a pipe.

    May raise `InputError`.
    """
    _check_simulator(loaded.system, str(request.parameters["simulator"]), "network")
    if loaded.system.network is None:
        fail(f"the product 'network' needs one of the interconnects {', '.join(NETWORKS)}")
    benches = NODE_BENCH_TEMPLATE, VERILOG_NODE_BENCH_TEMPLATE
    if loaded.system.network.kind is NetworkKind.ETHERNET:
        benches = PHY_BENCH_TEMPLATE, VERILOG_PHY_BENCH_TEMPLATE
    files = _with_open_end(request, loaded, *benches)
    return GeneratedCore(f"Simulated board of system {loaded.system.name}", files)


def _watched_system(request: Request, loaded: LoadedSystem) -> dict[str, GeneratedFile]:
    """Return the top level that exposes waiting messages; in Verilog, the test bench reads the netlist's signals."""
    if not SIMULATORS[str(request.parameters["simulator"])].reads_vhdl:
        return {}
    text = render(SYSTEM_TEMPLATE, system_configuration(loaded.system, is_watched=True))
    return {f"{watched_entity(loaded.system)}.vhd": GeneratedFile(text, VHDL, tags=_BENCH_TAGS)}


def _with_open_end(request: Request, loaded: LoadedSystem, vhdl: str, verilog: str) -> dict[str, GeneratedFile]:
    """Return the files of a simulation that runs until its user ends it; `vhdl` and `verilog` are its benches."""
    system = loaded.system
    environment = environment_files(_environment(request), system)
    configuration = test_bench_configuration(system, 1, 0, _entity(environment), is_live=True)
    files = _surroundings(loaded, environment, str(request.parameters["simulator"]))
    if SIMULATORS[str(request.parameters["simulator"])].reads_vhdl:
        return files | _vhdl_bench(configuration, vhdl)
    return files | _verilog_bench(configuration, system, template=verilog)


def _refuse_node(loaded: LoadedSystem) -> None:
    """Raise `InputError` for a system that is a node itself: its frames have no host."""
    if loaded.system.network:
        fail(
            f"a system with interconnect '{loaded.specification.project.interconnect}' has no host to simulate",
            loaded.specification.project.interconnect.source,
            "add the parameter 'interconnect: axi_stream' to both generators of the target, as 'firm system core' does",
        )


def _surroundings(
    loaded: LoadedSystem, environment: Mapping[PurePosixPath, GeneratedFile], simulator: str
) -> dict[str, GeneratedFile]:
    """Return the files that every test bench of a system needs: its flow, simulation kernels and the environment."""
    sources = [Path(source) for item in loaded.system.accelerator_types for source in item.accelerator.sources]
    unit = translated_unit(loaded.system, has_environment=bool(environment))
    files = flow_file(simulator_flow(simulator, unit, is_system_verilog=is_system_verilog(sources)))
    for kernel in loaded.system.kernels:
        files |= kernel_files(kernel, loaded.folder)
    return files | {str(path): file for path, file in environment.items()}


def _entity(environment: Mapping[PurePosixPath, GeneratedFile]) -> str | None:
    """Return the environment's entity, or None without an environment."""
    return [*environment][-1].stem if environment else None


def _check_simulator(system: DerivedSystem, simulator: str, target: str) -> None:
    """Raise `InputError` if the simulator does not support ids of two bytes or the language of an accelerator.

    The hint names the `target` of the default simulator.
    """
    known = SIMULATORS[simulator]
    if system.id_bytes > 1 and not known.reads_vhdl:
        fail(
            f"{simulator} cannot simulate a system with 'idBytes: {system.id_bytes}'",
            hint=f"only the simulated host in VHDL has ids of two bytes; use --target={target}",
        )
    for type_ in system.accelerator_types:
        accelerator = type_.accelerator
        if known.reads_vhdl and accelerator.type == "Verilog":
            others = " or ".join(f"'{name}'" for name in fitting(has_verilog=True)).replace("'", "'simulator: ", 1)
            hint = f"use {others}, for which GHDL translates the VHDL to Verilog"
            message = f"{known.title} cannot simulate Verilog, the language of '{accelerator.name}'"
            fail(message, accelerator.name.source, hint)
        if not known.calls_functions and accelerator.type == "HLS":
            hint = f"only GHDL can call C++ functions during a simulation; use --target={target}"
            fail(
                f"{simulator} cannot simulate '{accelerator.name}', which has the type HLS",
                accelerator.name.source,
                hint,
            )


def _vhdl_bench(configuration: Context, template: str = TEST_BENCH_TEMPLATE) -> dict[str, GeneratedFile]:
    text = render(template, configuration)
    return {f"{configuration['bench']}.vhd": GeneratedFile(text, VHDL, tags=_BENCH_TAGS)}


def _verilog_bench(
    configuration: Context,
    system: DerivedSystem,
    frames: int = 0,
    beats: int = 0,
    template: str = VERILOG_BENCH_TEMPLATE,
) -> dict[str, GeneratedFile]:
    """Return the test bench and, if there is an environment, the entity that connects the environment to the system."""
    has_environment = configuration["environment"] is not None
    bench = verilog_bench_configuration(configuration, system, frames, beats, has_environment=has_environment)
    files = {
        f"{configuration['bench']}.v": GeneratedFile(render(template, bench), "verilogSource-2005", tags=_BENCH_TAGS)
    }
    if has_environment:
        unit = translated_unit(system, has_environment=True)
        files[f"{unit}.vhd"] = GeneratedFile(render(ENVIRONMENT_TEMPLATE, configuration), VHDL)
    return files


def _beats(expected: list[Response], width: int) -> int:
    """Return the number of beats in all expected frames, the maximum that can wait for the end of a frame."""
    lanes = width // 8
    return sum(-(-(ID_BYTES + LENGTH_BYTES + len(response.payload)) // lanes) for response in expected) or 1


def _path(request: Request, parameter: str) -> Path:
    value = request.parameters[parameter]
    if value is None:
        fail(f"{request.name}: the product 'simulation' needs the parameter '{parameter}'")
    return request.files_root / str(value)


def _stimuli_files(path: Path) -> list[Path]:
    """Return the files with the stimuli, which for a bag may be all files in a folder."""
    if path.is_file():
        return [path]
    # A hit must not spend time on importing the readers of rosbags.
    from fusesoc_firm.message.bag_reader import bag_files

    return bag_files(path)


def _environment(request: Request) -> dict[Path, SourceRef | None]:
    """Return the files of the environment, each with its place in the requesting core."""
    return {request.files_root / file: source for file, source in request.listed("environment").items()}


def _files(request: Request) -> list[Path]:
    return [request.files_root / file for file in request.listed("files")]
