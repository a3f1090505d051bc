"""Derived System -> template configuration: the system next to a processor, as a Vivado block design.

A DMA engine carries frames between the processor's memory and the system's streams. The engine uses lists of
descriptors (scatter-gather), since frames, or the bursts of a preemptive scheduler, arrive at any time with any length,
each in the next buffer. The frame contains the id, so `m_axis_tid` is not connected.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction

from fusesoc_firm.system.boards.board import Board, board_entity
from fusesoc_firm.system.boards.processor import PROCESSORS, Processor
from fusesoc_firm.system.boards.timing_constraints import period
from fusesoc_firm.system.derived.cpp_function import function_name, kernel_entity
from fusesoc_firm.system.derived.model import AcceleratorType, DerivedSystem, StatusAccess
from fusesoc_firm.system.hardware.configuration import pin_groups
from fusesoc_firm.system.hardware.names import Names
from fusesoc_firm.text.render import Context

BLOCK_DESIGN_TEMPLATE = "board/block_design.tcl"
RECORDS_TEMPLATE = "vhdl/abort_records.vhd"
PACKAGE_TEMPLATE = "hls/package.tcl"

# The width of a descriptor's length field in bits: the DMA engine's maximum (PG021).
_LENGTH_BITS = 26
_ADDRESS_BITS = 32
# The offset of the status registers from the DMA engine's registers; each block has 64 KiB.
STATUS_OFFSET = 0x10000
_STREAM = ("tdata", "tkeep", "tvalid", "tlast")
_STREAM_FROM_MANAGER = (*_STREAM, "tuser", "tid")
# Parameters that Vivado infers from whole interface connections and from pins of known polarity.
_FOUND_OUT = {"c_s_axis_s2mm_tdata_width", "C_AUX_RESET_HIGH"}
# The utilities that replace IP cores, which Vivado 2026.1 no longer has.
_INLINE = {"xlconcat": "ilconcat"}
# The clock pins of all cells other than the processor.
_CLOCK_PINS = (
    *(f"dma/{name}_aclk" for name in ("s_axi_lite", "m_axi_sg", "m_axi_mm2s", "m_axi_s2mm")),
    *("control/aclk", "memory/aclk", "reset/slowest_sync_clk", "system_reset/slowest_sync_clk"),
    *("system/clk", "records/clk"),
)


def block_design_configuration(system: DerivedSystem, board: Board, clock: Fraction) -> Context:
    """Return the configuration of the block design; `clock` is the frequency of clk in Hz."""
    processor = PROCESSORS[str(board.processor)]
    preset = f'apply_board_preset "{1 if board.board_part else 0}"'
    return {
        "design": board_entity(system, board),
        "system": system.entity,
        "records": records_entity(system),
        "name": system.name,
        "board": board.name,
        "description": str(board.description),
        "kernels": [{"function": function_name(type_), "kernel": kernel_entity(type_)} for type_ in system.kernels],
        "ip": processor.ip,
        "automation": " ".join(filter(None, (processor.automation, preset))),
        "processor_properties": _properties(_processor_properties(processor, system, clock)),
        "cells": [
            {
                "cell": cell,
                "ip": ip,
                "meaning": meaning,
                "inline": {"name": _INLINE[ip]} if ip in _INLINE else None,
                "given": [{"name": name, "cell": cell} for name, _ in properties if name in _FOUND_OUT],
                "properties": _properties(properties),
            }
            for cell, ip, meaning, properties in _cells(system, processor)
        ],
        "interfaces": _pairs(_interfaces(system, processor)),
        "nets": [
            {"meaning": meaning, "connections": _pairs(pairs)} for meaning, pairs in _nets(system, processor) if pairs
        ],
        "pins": _pins(system),
        "base": processor.base,
        "status": {"base": f"0x{int(processor.base, 16) + STATUS_OFFSET:X}"} if _has_bus(system) else None,
    }


def records_entity(system: DerivedSystem) -> str:
    """Return the name of the entity that turns aborts into records."""
    return f"{system.entity}_records"


def records_configuration(system: DerivedSystem) -> Context:
    """Return the configuration of that entity."""
    return {
        "entity": records_entity(system),
        "name": system.name,
        "width": system.width,
        "lanes": system.width // 8,
    }


def _processor_properties(processor: Processor, system: DerivedSystem, clock: Fraction) -> Iterator[tuple[str, object]]:
    yield from processor.properties
    for number, frequency in enumerate((clock, *(item.frequency for item in system.clocks))):
        yield processor.clock_switch.format(number), 1
        yield processor.frequency.format(number), f"{float(frequency / 10**6):.9g}"


def _cells(system: DerivedSystem, processor: Processor) -> Iterator[tuple[str, str, str, Sequence[tuple[str, object]]]]:
    """Yield all IP cells except the processor."""
    data_width = max(processor.memory_width, system.width)
    yield (
        "dma",
        "axi_dma",
        "Frames between memory and streams; a list of descriptors for each direction.",
        [
            ("c_include_sg", 1),
            ("c_sg_include_stscntrl_strm", 0),
            ("c_sg_length_width", _LENGTH_BITS),
            ("c_addr_width", _ADDRESS_BITS),
            ("c_m_axi_mm2s_data_width", data_width),
            ("c_m_axis_mm2s_tdata_width", system.width),
            ("c_m_axi_s2mm_data_width", data_width),
            ("c_s_axis_s2mm_tdata_width", system.width),
        ],
    )
    registers = "Registers of the DMA engine" + (", and of the status." if _has_bus(system) else ".")
    yield "control", "smartconnect", registers, [("NUM_SI", 1), ("NUM_MI", 2 if _has_bus(system) else 1)]
    yield "memory", "smartconnect", "Descriptors and frames in memory.", [("NUM_SI", 3), ("NUM_MI", 1)]
    lines = "One for each direction" + (", and one of the status." if system.status else ".")
    yield "interrupts", "xlconcat", lines, [("NUM_PORTS", 3 if system.status else 2)]
    yield "reset", "proc_sys_reset", "The processor's reset, by the clock.", []
    yield (
        "system_reset",
        "proc_sys_reset",
        "The system's: also with a reset of the DMA engine, so that no program finds half a frame of the last one.",
        [("C_AUX_RESET_HIGH", 0), ("C_AUX_RST_WIDTH", 1)],
    )


def _has_bus(system: DerivedSystem) -> bool:
    """Return whether the system has a port for AXI4-Lite."""
    return system.status is StatusAccess.AXI_LITE


def _interfaces(system: DerivedSystem, processor: Processor) -> Iterator[tuple[str, str]]:
    yield f"processor/{processor.control}", "control/S00_AXI"
    yield "control/M00_AXI", "dma/S_AXI_LITE"
    if _has_bus(system):
        yield "control/M01_AXI", "system/s_axi"
    for number, name in enumerate(("M_AXI_SG", "M_AXI_MM2S", "M_AXI_S2MM")):
        yield f"dma/{name}", f"memory/S{number:02}_AXI"
    yield "memory/M00_AXI", f"processor/{processor.memory}"


def _nets(system: DerivedSystem, processor: Processor) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield the connections of single pins, each with its driver and sink."""
    clock = f"processor/{processor.clock.format(0)}"
    processor_clocks = (f"processor/{processor.control_clock}", f"processor/{processor.memory_clock}")
    yield "The clock", [(clock, pin) for pin in (*processor_clocks, *_CLOCK_PINS)]
    yield (
        "Further clocks",
        [
            (f"processor/{processor.clock.format(number)}", f"system/{item.port}")
            for number, item in enumerate(system.clocks, start=1)
        ],
    )
    yield (
        "Resets",
        [
            *((f"processor/{processor.reset}", f"{cell}/ext_reset_in") for cell in ("reset", "system_reset")),
            *(("reset/interconnect_aresetn", f"{cell}/aresetn") for cell in ("control", "memory")),
            ("reset/peripheral_aresetn", "dma/axi_resetn"),
            ("dma/mm2s_prmry_reset_out_n", "system_reset/aux_reset_in"),
            *(("system_reset/peripheral_aresetn", f"{cell}/rst_n") for cell in ("system", "records")),
        ],
    )
    yield (
        "Frames to the system, and from it",
        [
            *((f"dma/m_axis_mm2s_{name}", f"system/s_axis_{name}") for name in _STREAM),
            ("system/s_axis_tready", "dma/m_axis_mm2s_tready"),
            *((f"system/m_axis_{name}", f"records/s_axis_{name}") for name in _STREAM_FROM_MANAGER),
            ("records/s_axis_tready", "system/m_axis_tready"),
            *((f"records/m_axis_{name}", f"dma/s_axis_s2mm_{name}") for name in _STREAM),
            ("dma/s_axis_s2mm_tready", "records/m_axis_tready"),
        ],
    )
    yield (
        "Interrupts",
        [
            ("dma/mm2s_introut", "interrupts/In0"),
            ("dma/s2mm_introut", "interrupts/In1"),
            *([("system/status_interrupt", "interrupts/In2")] if system.status else ()),
            ("interrupts/dout", f"processor/{processor.interrupts}"),
        ],
    )


def _pins(system: DerivedSystem) -> list[Context]:
    """Return the accelerators' pins as ports of the design."""
    return [
        {"name": port["name"], "direction": "I" if port["direction"] == "in" else "O", "bits": port["bits"]}
        for group in pin_groups(Names(system), system)
        for port in group["ports"]
    ]


def package_configuration(
    type_: AcceleratorType, sources: Sequence[str], system: DerivedSystem, board: Board, clock: Fraction
) -> Context:
    """Return the configuration of the Vitis HLS script that packages a C++ function as an IP.

    `sources` are next to the script.
    """
    clocks = {item.name: item.frequency for item in system.clocks}
    fastest = max(clocks.get(block.clock, clock) for block in system.accelerators if block.type is type_)
    return {
        "function": function_name(type_),
        "part": str(board.part),
        "period": period(fastest),
        "sources": [{"file": source} for source in sources],
    }


def _properties(properties: Iterable[tuple[str, object]]) -> list[Context]:
    return [{"name": name, "value": str(value)} for name, value in properties]


def _pairs(pairs: Iterable[tuple[str, str]]) -> list[Context]:
    return [{"source": source, "sink": sink} for source, sink in pairs]
