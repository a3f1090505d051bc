"""Derived System -> template configuration of the Verilog test bench, for simulators that read a netlist.

If the system's pins are connected to an environment, an entity contains the system and the environment, so that all
VHDL becomes one netlist.
"""

from __future__ import annotations

from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.hardware.configuration import top_level_pins
from fusesoc_firm.text.render import Context

VERILOG_BENCH_TEMPLATE = "verilog/test_bench.v"
VERILOG_NODE_BENCH_TEMPLATE, VERILOG_PHY_BENCH_TEMPLATE = "verilog/node_bench.v", "verilog/phy_bench.v"
ENVIRONMENT_TEMPLATE = "vhdl/in_environment.vhd"

# Cycles without a beat until a simulation with a link ends: the time of 300 bytes, in which a link may deliver no beat
# to the host.
_QUIET_BITS = 3000
# Space for the user's own files next to the generated ones.
_LEAST_FRAMES = 65536


def translated_unit(system: DerivedSystem, *, has_environment: bool) -> str:
    """Return the entity that is translated to the test bench's netlist."""
    return f"{system.entity}_in_environment" if has_environment else system.entity


def verilog_bench_configuration(
    bench: Context, system: DerivedSystem, frames: int = 0, beats: int = 0, *, has_environment: bool
) -> Context:
    """Return the configuration of the test bench, which includes the configuration `bench` of the VHDL test bench.

    `frames` is the maximum number of frames in a file; `beats` is the maximum number of beats that wait for the end of
    their frame.
    """
    return {
        **bench,
        "translated": translated_unit(system, has_environment=has_environment),
        # The place of the system, whose inner streams are checked.
        "inside": "u_system.u_system" if has_environment else "u_system",
        "open_pins": [] if has_environment else _open_pins(system),
        "most_frames": max(_LEAST_FRAMES, frames),
        "most_beats": beats,
        "quiet": _QUIET_BITS * (system.link.clock_hz // 1_000_000 if system.link and system.link.clock_hz else 10),
    }


def _open_pins(system: DerivedSystem) -> list[Context]:
    """Return the pins of a system without an environment, with all inputs low."""
    names = top_level_pins(system)
    return [
        {"name": names[block.block, pin.name], "is_input": pin.direction == "in", "bits": pin.bits or 1}
        for block in system.accelerators
        for pin in block.type.accelerator.pins
    ]
