"""Icarus Verilog for tests: VHDL as the netlist that the product makes of it, beside sources in Verilog."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from fusesoc_firm.netlist.translation import Translation, find_loops, translate
from fusesoc_firm.request.request import Request
from fusesoc_firm.simulation import simulation_core
from fusesoc_firm.system import system_core
from tests.hdl.ghdl import CORES, Generic, RunResult, core_files
from tests.processes import limited
from tests.system.simulated.systems import HARDWARE

_HOST = ("firm_sim_host", "firm_sim_join", "firm_axis_checker", "firm_sim_link", "firm_sim_uart", "firm_sim_spi")
HOST = tuple(CORES / "sim" / "rtl" / f"{name}.v" for name in _HOST)


@dataclass(frozen=True)
class Icarus:
    """A simulation that is compiled."""

    program: Path

    def run(self, directory: Path, /, **options: Generic) -> RunResult:
        """Simulate in `directory`; options are those of the host, which the report repeats."""
        plusargs = [f"+{name}={value}" for name, value in options.items()]
        done = subprocess.run(
            [*limited(120), "vvp", "-n", str(self.program), *plusargs],
            cwd=directory,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            check=False,
        )
        return RunResult(done.returncode, done.stdout)


def compile_verilog(
    top: str, files: Sequence[Path], folder: Path, parameters: Mapping[str, Generic] | None = None
) -> Icarus:
    """Compile for the module `top`, with its `parameters`."""
    program = folder / f"{top}.vvp"
    options = [f"-P{top}.{name}={value}" for name, value in (parameters or {}).items()]
    options += ["-g2012"] if any(path.suffix == ".sv" for path in files) else []
    command = ["iverilog", "-s", top, *options, "-o", program, *(f"-I{path.parent}" for path in files), *files]
    done = subprocess.run(
        [str(word) for word in dict.fromkeys(command)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return Icarus(program)


def netlist(
    top: str,
    folder: Path,
    work: Sequence[Path],
    firm: Sequence[Path] = (),
    verilog: Sequence[Path] = (),
    **generics: Generic,
) -> Path:
    """The netlist of the entity `top`, as the tool `ghdlsynth` makes it. Raises `NetlistError`."""
    output = folder / f"{top}_netlist.v"
    translation = Translation(
        top,
        str(output),
        {"firm": list(map(str, firm)), "work": list(map(str, work))},
        {name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in generics.items()},
        list(map(str, verilog)),
    )
    translate(translation, folder / f"{top}.ghdl")
    return output


def loops(
    top: str,
    folder: Path,
    work: Sequence[Path],
    firm: Sequence[Path] = (),
    generics: Mapping[str, Generic] = MappingProxyType({}),
) -> list[str]:
    """The combinational loops of the entity `top`, a sentence for each. Raises `NetlistError`."""
    libraries = {"firm": list(map(str, firm)), "work": list(map(str, work))}
    given = {name: str(value) for name, value in generics.items()}
    return find_loops(Translation(top, "", libraries, given), folder / f"{top}.ghdl")


def build(request: Request, folder: Path, *cores: str) -> Icarus:
    """Generate, translate and compile a system with its simulation; `cores` are those that the accelerators need.

    Raises `InputError` and `NetlistError`.
    """
    top, files = translated(request, folder, *cores)
    return compile_verilog(top, files, folder)


def translated(request: Request, folder: Path, *cores: str) -> tuple[str, list[Path]]:
    """A system with its simulation in Verilog alone: the test bench's name, and all files."""
    request = Request(request.command, request.vlnv, request.files_root, {**request.parameters, "simulator": "icarus"})
    work: list[Path] = []
    verilog: list[Path] = []
    loaded = system_core.load_requested(request)
    for core in (system_core.system_core(loaded), simulation_core.simulation_core(request, loaded)):
        for name, file in core.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(file.content if isinstance(file.content, bytes) else file.content.encode())
            if file.file_type.startswith("vhdlSource"):
                work.append(path)
            elif "erilogSource" in file.file_type and not file.is_include_file:
                verilog.append(path)
    bench = verilog[-1].stem
    system = bench.removesuffix("_tb")
    tops = [path.stem for path in work if path.stem == f"{system}_in_environment"] or [system]
    runtime = [path for path in core_files(*HARDWARE, *cores) if path.parent.parent.name != "sim"]
    return bench, [netlist(tops[0], folder, work, runtime, verilog), *verilog, *HOST]
