"""A test bench with the simulation host that comes in VHDL and in Verilog, run by GHDL or by Icarus."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol

import pytest

from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import Icarus, compile_verilog
from tests.recall import RunResult

SIMULATORS = ("ghdl", "icarus")
# Which parameters of a bench in Verilog are no options of a run.
_COMPILED = ("WIDTH", "BEATS")


class Bench(Protocol):
    """A bench in one simulator; `unknown` is the level of what is not driven."""

    @property
    def unknown(self) -> str:
        """As the host prints it."""

    def run(self, directory: Path, /, **generics: Generic) -> RunResult:
        """Simulate with the files in a directory."""

    def repeat(self, seed: int, stall_percent: int) -> str:
        """How the report says to repeat a run."""


@dataclass(frozen=True)
class _VhdlBench:
    library: Library
    name: str
    unknown: str = "U"

    def run(self, directory: Path, /, **generics: Generic) -> RunResult:
        return self.library.run(self.name, generics, directory=directory)

    def repeat(self, seed: int, stall_percent: int) -> str:
        return f"-gSEED={seed} -gSTALL_PERCENT={stall_percent}"


@dataclass(frozen=True)
class _VerilogBench:
    folder: Path
    name: str
    unknown: str = "X"

    def run(self, directory: Path, /, **generics: Generic) -> RunResult:
        compiled = tuple((name, generics.pop(name)) for name in _COMPILED if name in generics)
        return _program(self.folder, self.name, compiled).run(directory, **generics)

    def repeat(self, seed: int, stall_percent: int) -> str:
        return f"+SEED={seed} +STALL_PERCENT={stall_percent}"


@cache
def _program(folder: Path, name: str, parameters: tuple[tuple[str, Generic], ...]) -> Icarus:
    place = folder / "_".join(["icarus", *(str(value) for _, value in parameters)])
    place.mkdir()
    files = [*core_files("sim/verilog_host"), *core_files("sim/verilog_host", fileset="tb")]
    return compile_verilog(name, files, place, dict(parameters))


def bench(simulator: str, name: str, cores: tuple[str, ...], folder: Path) -> Bench:
    """The bench of an entity or module; `cores` are those of the VHDL, the last with the bench in its fileset `tb`."""
    if simulator == "icarus":
        if shutil.which("iverilog") is None:
            pytest.skip("Icarus Verilog is not installed")
        return _VerilogBench(folder, name)
    library = Library("firm", folder)
    library.analyse(core_files(*cores))
    library.analyse(core_files(cores[-1], fileset="tb"))
    return _VhdlBench(library, name)
