"""The supported simulators, one row for each, under Edalize's names.

A new simulator needs a row here, and a row in `programs.PROGRAMS` for each program that it starts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Live:
    """The build and the start of a simulator that another program starts (docs/reference/transports.md).

    `parameter` precedes `NAME=value` on the simulator's command line, at its end or before the word `before`. If
    FuseSoC's build does not create the simulator, the makefile's target `made_by` does. The start command is the line
    of the makefile's target `run` that begins with `started_by` or, without such a line, the program `V<toplevel>`.
    """

    parameter: str
    made_by: str = ""
    started_by: str = ""
    before: str = ""


@dataclass(frozen=True)
class Simulator:
    """A simulator: the title, the differences from other simulators, and the programs that the simulator needs.

    A simulator that does not read VHDL reads a Verilog netlist from GHDL. `options` are the options of the simulator's
    flow in Edalize, and `system_verilog` are additional options for SystemVerilog. C++ functions require GHDL's native
    interface (VHPIDIRECT). With `runs_cocotb`, Edalize runs benches of cocotb in it, without a C++ compiler. `waves` is
    the name of the waveform file, for which a build needs FuseSoC's `wave_options`.
    """

    title: str
    reads_vhdl: bool = False
    calls_functions: bool = False
    runs_cocotb: bool = False
    programs: tuple[str, ...] = ()
    options: Mapping[str, str | list[str]] = field(default_factory=dict)
    system_verilog: Mapping[str, str | list[str]] = field(default_factory=dict)
    live: Live | None = None
    waves: str = "waves.vcd"
    wave_options: tuple[str, ...] = ()


SIMULATORS: dict[str, Simulator] = {
    "ghdl": Simulator(
        "GHDL",
        reads_vhdl=True,
        calls_functions=True,
        runs_cocotb=True,
        programs=("ghdl",),
        options={"sim_options": ["--ieee-asserts=disable-at-0"]},
        # FuseSoC does not build anything before the run. The makefile's line contains the options of the analysis.
        live=Live("-g", "analyze", "ghdl -r "),
        waves="waves.ghw",
    ),
    "icarus": Simulator(
        "Icarus Verilog",
        runs_cocotb=True,
        programs=("iverilog",),
        system_verilog={"iverilog_options": ["-g2012"]},
        # Edalize starts the simulator with `-fst`.
        waves="waves.fst",
    ),
    "verilator": Simulator(
        "Verilator",
        programs=("verilator", "g++", "make"),
        options={
            "mode": "cc",
            "verilator_options": ["--main", "--timing", "--timescale 1ns/1ps", "-Wno-lint", "-Wno-style"],
            "make_options": ["OPT_FAST=-O2"],
        },
        live=Live("+"),
        wave_options=("--verilator_options=--trace",),
    ),
    "nvc": Simulator(
        "nvc",
        reads_vhdl=True,
        programs=("nvc",),
        options={"nvc_options": ["--ieee-warnings=off-at-0"]},
        live=Live("-g", started_by="nvc ", before="-r"),
        waves="waves.fst",
    ),
}
"""The simulators by Edalize's names; the first suitable simulator is the default."""


def default_simulator(*, has_verilog: bool = False, is_live: bool = False) -> str:
    """Return the first simulator that can simulate a system with or without Verilog accelerators."""
    return next(iter(fitting(has_verilog=has_verilog, is_live=is_live)))


def fitting(*, has_verilog: bool = False, is_live: bool = False) -> dict[str, Simulator]:
    """Return the simulators for systems with or without Verilog accelerators; none reads both languages."""
    return {
        name: item
        for name, item in SIMULATORS.items()
        if not (has_verilog and item.reads_vhdl) and (item.live or not is_live)
    }
