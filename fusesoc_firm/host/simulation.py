"""The simulation of a system as a core: test bench, stimuli, expected frames and simulated kernels."""

from __future__ import annotations

from pathlib import Path

from fusesoc_firm.diagnostics import SourceRef, fail
from fusesoc_firm.generation import GeneratedCore, GeneratedFile, Request
from fusesoc_firm.host.environment import environment_files
from fusesoc_firm.host.frames import expected_text, stimulus_text
from fusesoc_firm.host.kernel import kernel_files
from fusesoc_firm.host.reference import responses
from fusesoc_firm.host.software import answered, stimulated, traffic
from fusesoc_firm.host.stimuli import read_stimuli
from fusesoc_firm.render import render
from fusesoc_firm.system import generator
from fusesoc_firm.system.configuration import TEST_BENCH_TEMPLATE, test_bench_configuration


def inputs(request: Request) -> list[Path]:
    """What the system depends on, the stimuli, the model, and the environment."""
    stimuli, model = _path(request, "stimuli"), _path(request, "model")
    return [*generator.inputs(request), *_bag_files(stimuli), model, *_environment(request)]


def generate(request: Request) -> GeneratedCore:
    """The core; it belongs beside the one that the same specification gives as a system. Raises `InputError`."""
    loaded = generator.load_requested(request)
    system = loaded.system
    stimuli = read_stimuli(_path(request, "stimuli"), stimulated(system))
    answers = responses(_path(request, "model"), stimuli, answered(system))
    found = traffic(system, loaded.folder, stimuli, answers)
    files: dict[str, GeneratedFile] = {}
    for accelerator in system.accelerator_types:
        if accelerator.accelerator.type == "HLS":
            files |= kernel_files(accelerator, loaded.folder)
    seed, stall_percent = request.parameters["seed"], request.parameters["stall_percent"]
    assert isinstance(seed, int)
    assert isinstance(stall_percent, int)
    environment = environment_files(_environment(request), system)
    entity = [*environment][-1].stem if environment else None
    bench = render(TEST_BENCH_TEMPLATE, test_bench_configuration(system, seed, stall_percent, entity))
    files |= {str(path): file for path, file in environment.items()}
    files |= {
        f"{system.entity}_tb.vhd": GeneratedFile(bench, "vhdlSource-93"),
        "stimulus.txt": GeneratedFile(stimulus_text(found.stimuli, system.subscribers), "user", copyto="stimulus.txt"),
        "expected.txt": GeneratedFile(expected_text(found.responses, system.publishers), "user", copyto="expected.txt"),
    }
    return GeneratedCore(f"Simulation of system {system.name}", files)


def _path(request: Request, parameter: str) -> Path:
    value = request.parameters[parameter]
    if value is None:
        fail(f"{request.name}: product 'simulation' needs the parameter '{parameter}'")
    return request.files_root / str(value)


def _environment(request: Request) -> dict[Path, SourceRef | None]:
    """The files of the environment, each with its place in the requesting core."""
    return {request.files_root / file: source for file, source in request.listed("environment").items()}


def _bag_files(path: Path) -> list[Path]:
    """The files of a bag, which may be a folder (ROS 2), or the file itself."""
    return sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
