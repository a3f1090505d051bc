"""Generate a system and its simulation into a folder and run it, like FuseSoC but without FuseSoC."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.core.request import GeneratedCore, Plain, Request
from fusesoc_firm.runs.simulation import simulation_core
from fusesoc_firm.system import system_core
from tests.cores.schedulers import POLICY_CORES
from tests.hdl.ghdl import Generic, Library, core_files
from tests.recall import RunResult

DATA = Path(__file__).parent / "data"
RUNTIME = (
    "axis/package",
    "axis/axis",
    "noc/noc",
    "sim/sync",
    "cdc/cdc",
    "cdc/debounce",
    "sched/package",
    *(f"sched/{core}" for core in POLICY_CORES),
    "manager/manager",
    "sched/by_policy",
    "sched/combined",
    "manager/tree",
    "board/link",
    "status/status",
)
# The same with the synchronisers of the hardware, which can be synthesised.
HARDWARE = tuple("cdc/sync" if core == "sim/sync" else core for core in RUNTIME)
SIMULATION = ("sim/checker", "sim/host", "sim/link")


@dataclass(frozen=True)
class GeneratedSystem:
    """A system in `folder`: all files lie there, libraries `firm` and `work` are analysed."""

    folder: Path
    entity: str
    files: tuple[Path, ...]

    @property
    def work(self) -> Library:
        """The library of the generated units."""
        return Library("work", self.folder)

    def run(self, **generics: Generic) -> RunResult:
        """Simulate; the seed and the rate of stalls are in the report."""
        result = self.work.run(f"{self.entity}_tb", {"SHOWN": 1, **generics})
        print(result.output)
        return result

    def passes(self, **generics: Generic) -> bool:
        """Simulate and tell whether every message came back as expected."""
        result = self.run(**generics)
        return result.exit_code == 0 and result.output.splitlines()[-1].startswith("PASS ")

    def use_real_synchronisers(self) -> None:
        """Replace the synchronisers for simulation, which cannot be synthesised."""
        Library("firm", self.folder).analyse(core_files("cdc/sync", "cdc/cdc", "cdc/debounce", "board/link"))
        self.work.analyse(self.files)

    def replace_by_netlist(self) -> None:
        """Replace the top level by the netlist that GHDL makes of it."""
        self.work.replace_by_netlist(self.entity)
        self.work.analyse([self.folder / f"{self.entity}_tb.vhd"])


def call(spec: Path, stimuli: Path, model: Path | None, **parameters: Plain) -> Request:
    """A generator call for the specification `spec`; compiled functions need no model."""
    known: dict[str, Plain] = {
        "simulator": "ghdl",
        "board": None,
        "seed": 1,
        "stall_percent": 25,
        "environment": None,
        "paths": None,
        "distro": None,
        **parameters,
    }
    known |= {"spec": spec.name, "stimuli": str(stimuli), "model": None, "product": "simulation"}
    known |= {"model": str(model)} if model else {}
    return Request("far", "test:sys:system-simulation:0", spec.parent, known)


def build(request: Request, folder: Path, *cores: str) -> GeneratedSystem:
    """Generate, write and analyse everything; `cores` are those that the accelerators need.

    Raises `InputError` and `GhdlError`.
    """
    vhdl = write(request, folder)
    Library("firm", folder).analyse(core_files(*RUNTIME, *SIMULATION, *cores))
    Library("work", folder).analyse(vhdl)
    return GeneratedSystem(folder, vhdl[-1].stem.removesuffix("_tb"), tuple(vhdl))


def write(request: Request, folder: Path) -> list[Path]:
    """Generate a system and its simulation into `folder`: their VHDL, in order. Raises `InputError`."""
    folder.mkdir(parents=True, exist_ok=True)
    loaded = system_core.load_requested(request)
    *kernels, bench = _write(simulation_core.simulation_core(request, loaded), folder)
    # A kernel before the wrapper that instantiates it, the test bench last.
    return [*kernels, *_write(system_core.system_core(loaded), folder), bench]


def generate_system(spec: Path, folder: Path, board: str | None = None) -> list[Path]:
    """Generate a system without its simulation into `folder`: its VHDL, in order. Raises `InputError`."""
    parameters: dict[str, Plain] = {"spec": spec.name, "product": "system", "paths": None, "distro": None}
    parameters |= {"board": board} if board else {}
    request = Request("far", "test:sys:system:0", spec.parent, parameters)
    return _write(system_core.system_core(system_core.load_requested(request)), folder)


def _write(core: GeneratedCore, folder: Path) -> list[Path]:
    """Write a core's files; those in VHDL are returned, in order."""
    vhdl = []
    for name, file in core.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(file.content if isinstance(file.content, bytes) else file.content.encode())
        if file.file_type.startswith("vhdlSource"):
            vhdl.append(path)
    return vhdl
