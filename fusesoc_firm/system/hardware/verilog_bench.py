"""Derived System -> template configuration of its test bench in Verilog, for simulators that read a netlist.

Where something is at the system's pins, an entity holds both: so all VHDL becomes one netlist.
"""

from __future__ import annotations

from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.hardware.configuration import top_level_pins
from fusesoc_firm.text.render import Context

VERILOG_BENCH_TEMPLATE = "verilog/test_bench.v"
ENVIRONMENT_TEMPLATE = "vhdl/in_environment.vhd"

# Room for files of the user's own, beside the generated ones.
_LEAST_FRAMES = 65536


def translated_unit(system: DerivedSystem, *, has_environment: bool) -> str:
    """The entity that is translated for the test bench."""
    return f"{system.entity}_in_environment" if has_environment else system.entity


def verilog_bench_configuration(
    bench: Context, system: DerivedSystem, frames: int = 0, beats: int = 0, *, has_environment: bool
) -> Context:
    """The configuration of the test bench; that of the one in VHDL, `bench`, is part of it.

    It has room for `frames` in each file, and for `beats` that wait for the ends of their frames.
    """
    return {
        **bench,
        "translated": translated_unit(system, has_environment=has_environment),
        "open_pins": [] if has_environment else _open_pins(system),
        "most_frames": max(_LEAST_FRAMES, frames),
        "most_beats": beats,
    }


def _open_pins(system: DerivedSystem) -> list[Context]:
    """The pins where nothing is at them: inputs are low."""
    names = top_level_pins(system)
    return [
        {"name": names[block.block, pin.name], "is_input": pin.direction == "in", "bits": pin.bits or 1}
        for block in system.accelerators
        for pin in block.type.accelerator.pins
    ]
