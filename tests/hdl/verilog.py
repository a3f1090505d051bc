"""Icarus Verilog for tests: VHDL as the netlist that the product makes of it, beside sources in Verilog."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from fusesoc_firm.core.request import Request
from fusesoc_firm.netlist.translation import Translation, find_loops, translate
from fusesoc_firm.runs.simulation import simulation_core
from fusesoc_firm.system import system_core
from fusesoc_firm.tools.digests import digest_of
from tests.hdl.ghdl import CORES, Generic, core_files
from tests.processes import limited
from tests.recall import RunResult, digest_of_source, identity, ran, recalled
from tests.system.simulated.systems import HARDWARE

_HOST = (
    "firm_sim_host",
    "firm_sim_join",
    "firm_sim_clock",
    "firm_axis_checker",
    "firm_sim_link",
    "firm_sim_uart",
    "firm_sim_spi",
)
_INCLUDE = re.compile(r'`include\s+"([^"]+)"')
HOST = tuple(CORES / "sim" / "rtl" / f"{name}.v" for name in _HOST)


@dataclass(frozen=True)
class Icarus:
    """A simulation of the module `top`, which is compiled in `folder` with these options.

    `digests` are those of the files, and of what they include, when it was described.
    """

    top: str
    folder: Path
    files: tuple[Path, ...]
    options: tuple[str, ...]
    digests: tuple[tuple[str, str], ...]

    @property
    def program(self) -> Path:
        """What `vvp` runs, which `make` writes."""
        return self.folder / f"{self.top}_{digest_of([self.options, self.digests])[:8]}.vvp"

    def make(self) -> Path:
        """Compile it, unless that was done, and return the program."""
        if not self.program.exists():
            assert self.digests == _digests(self.files), "a source was changed before it was compiled"
            words = ["iverilog", "-s", self.top, *self.options, "-o", str(self.program), *map(str, self.files)]
            done = ran(words, None)
            assert done.exit_code == 0, done.output
        return self.program

    def run(self, directory: Path, /, **options: Generic) -> RunResult:
        """Simulate in `directory`, or recall what that did; options are those of the host, which the report repeats."""
        plusargs = [f"+{name}={value}" for name, value in options.items()]

        def run() -> RunResult:
            return ran([*limited(120), "vvp", "-n", str(self.make()), *plusargs], directory)

        return recalled({**self._parts(), "plusargs": plusargs}, [directory], run, self._places(), _is_no_input)

    def check(self) -> None:
        """Compile it, unless it is known that this works."""
        recalled(self._parts(), [], lambda: RunResult(0, str(self.make())[:0]), self._places())

    def _parts(self) -> dict[str, object]:
        return {"icarus": identity("iverilog"), "top": self.top, "options": self.options, "sources": self.digests}

    def _places(self) -> list[Path]:
        return [path.parent for path in self.files]


def compile_verilog(
    top: str, files: Sequence[Path], folder: Path, parameters: Mapping[str, Generic] | None = None
) -> Icarus:
    """Compile for the module `top`, with its `parameters`."""
    options = [f"-P{top}.{name}={value}" for name, value in (parameters or {}).items()]
    options += ["-g2012"] if any(path.suffix == ".sv" for path in files) else []
    options += [f"-I{path.parent}" for path in files]
    sources = tuple(dict.fromkeys(files))
    icarus = Icarus(top, folder, sources, tuple(dict.fromkeys(options)), _digests(sources))
    icarus.check()
    return icarus


def _digests(files: Sequence[Path]) -> tuple[tuple[str, str], ...]:
    return tuple((str(path), digest_of_source(path)) for path in (*files, *_included(files)))


def _included(files: Sequence[Path]) -> list[Path]:
    """What these files include, and what that includes, from one of their folders."""
    folders = dict.fromkeys(path.parent for path in files)
    found: dict[Path, None] = {}
    left = [*files]
    while left:
        text = left.pop().read_text(encoding="latin-1")
        named = (folder / name for name in _INCLUDE.findall(text) for folder in folders)
        new = [path for path in named if path.is_file() and path not in found]
        found |= dict.fromkeys(new)
        left += new
    return sorted(found)


def _is_no_input(path: str) -> bool:
    """Whether a file is not read by a simulation: sources, which are inputs as such, and what was compiled."""
    return path.endswith((".vhd", ".v", ".sv", ".vvp"))


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
