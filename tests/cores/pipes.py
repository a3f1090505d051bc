"""The bench of the host at the end of a pipe, in each simulator: a system that is a wire, and may break the stream."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from fusesoc_firm.node.transport.simulator import Simulator
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import compile_verilog
from tests.shared import made_once

TOOLS = ("ghdl", "icarus", "verilator")
_BENCH = "firm_sim_pipe_tb"
_PROGRAMS = {"icarus": "iverilog"}


@dataclass(frozen=True)
class PipeBench:
    """The bench in one simulator, which runs in `folder`; `is_four_valued` if the simulator knows 'X'."""

    tool: str
    folder: Path

    @property
    def is_four_valued(self) -> bool:
        return self.tool != "verilator"

    def command(self, width: int = 8, **generics: Generic) -> list[str]:
        """Return the command to start it; generics are SEED, STALL_PERCENT and FAULT."""
        if self.tool == "ghdl":
            library = made_once("pipe_ghdl", _analyse)
            options = ["--std=93", "--work=firm", f"--workdir={library}", f"-P{library}"]
            return ["ghdl", "-r", *options, _BENCH, *_options("-g", {"WIDTH": width, **generics})]
        make = _icarus if self.tool == "icarus" else _verilator
        folder = made_once(f"pipe_{self.tool}_{width}", lambda folder: make(folder, width))
        program = ["vvp", "-n", folder / f"{_BENCH}.vvp"] if self.tool == "icarus" else [folder / f"V{_BENCH}"]
        return [*map(str, program), *_options("+", generics)]

    def start(self, width: int = 8, **generics: Generic) -> Simulator:
        return Simulator(self.command(width, **generics), self.folder)


def pipe_bench(tool: str, folder: Path) -> PipeBench:
    """The bench in the simulator `tool`; skips a test where that is not installed."""
    if shutil.which(_PROGRAMS.get(tool, tool)) is None:
        pytest.skip(f"{tool} is not installed")
    return PipeBench(tool, folder)


def _options(mark: str, generics: dict[str, Generic]) -> list[str]:
    return [f"{mark}{name}={value}" for name, value in generics.items()]


def _analyse(folder: Path) -> None:
    library = Library("firm", folder)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/pipe"))
    library.analyse(core_files("sim/pipe", fileset="tb"))
    library.make()


def _sources() -> list[Path]:
    return [*core_files("sim/verilog_pipe"), *core_files("sim/verilog_pipe", fileset="tb")]


def _icarus(folder: Path, width: int) -> None:
    compile_verilog(_BENCH, _sources(), folder, {"WIDTH": width}).make().rename(folder / f"{_BENCH}.vvp")


def _verilator(folder: Path, width: int) -> None:
    options = ["--binary", "--timing", "-Wno-lint", "-Wno-style", "--top-module", _BENCH, f"-GWIDTH={width}"]
    command = ["verilator", *options, "-Mdir", str(folder), *map(str, _sources())]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert done.returncode == 0, done.stdout
