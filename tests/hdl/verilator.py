"""Verilator for tests: a netlist with a bench in C++ around it as a program; `bench.h` is for all benches."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fusesoc_firm.tools.simulators import SIMULATORS
from tests.compilers import verilated

HEADERS = Path(__file__).parent
"""The folder of `bench.h`."""


def compiled(
    netlist: str, top: str, bench: str, folder: Path, headers: Sequence[Path] = (), *, is_long: bool = True
) -> Path:
    """The program of a netlist in Verilog and a bench in C++, which may include the files of the folders `headers`.

    If not `is_long`, a run takes less time than GCC would take to optimise it. Raises `CompilerError`.
    """
    (folder / "netlist.v").write_text(netlist, encoding="utf-8")
    (folder / "bench.cpp").write_text(bench, encoding="ascii")
    command = ["verilator", "--cc", "--exe", "--build", "-O3", "-Wno-fatal"]
    for path in (HEADERS, *headers):
        command += ["-CFLAGS", f"-I{path}"]
    for option in (f"OPT_FAST=-O{2 * is_long}", "OPT_SLOW=-O0", "OPT_GLOBAL=-O0"):
        command += ["-MAKEFLAGS", option]
    command += ["-Wno-INITIALDLY", "--top-module", top, "--Mdir", "model", "netlist.v", "bench.cpp"]
    return verilated(command, folder, "model", top, ["netlist.v", "bench.cpp"])


def simulator(top: str, files: Sequence[Path], folder: Path) -> Path:
    """The program that simulates the test bench `top`, with the options of the product. Raises `CompilerError`."""
    options = [word for item in SIMULATORS["verilator"].options["verilator_options"] for word in item.split()]
    command = ["verilator", "--cc", "--exe", "--build", *options]
    for option in ("OPT_FAST=-O0", "OPT_SLOW=-O0", "OPT_GLOBAL=-O0"):
        command += ["-MAKEFLAGS", option]
    names = list(map(str, files))
    command += ["--top-module", top, "--Mdir", "model", *names]
    return verilated(command, folder, "model", top, names)
