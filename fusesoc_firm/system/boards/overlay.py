"""Derived System -> the files that bring up a board under Linux: device-tree overlays and the script that loads them.

The overlay of the logic (`<design>.dtso`) contains the bitstream's name, the clocks, the DMA engine's registers and
interrupt, and the memory that engine and processor share. Linux reserves memory only when it boots, so the boot loader
applies a second overlay (`<design>_memory.dtso`).

Sources: interrupts, UG585 (table 7-4) and UG1085 (table 13-1); names of nodes and numbers of clocks, Linux's device
trees and bindings for both processors; u-dma-buf, https://github.com/ikwzm/udmabuf.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from fusesoc_firm.system.boards.block_design import STATUS_OFFSET
from fusesoc_firm.system.boards.board import Board, board_entity, check_fits
from fusesoc_firm.system.boards.processor import PROCESSORS
from fusesoc_firm.system.derived.model import DerivedSystem, StatusAccess
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.render import Context, render

# The names under which Linux lists the UIO devices of engine and status, and the shared memory.
DMA_NAME, STATUS_NAME, BUFFER_NAME = "firm-dma", "firm-status", "firm-buffer"
REGISTER_BYTES = 0x10000
# Linux reserves memory below this address, where both processors have memory that the engine reaches.
_RESERVED_BELOW = 0x40000000
# Linux reserves contiguous memory in multiples of this size.
_ALIGNMENT = 0x400000
_MOST_MEBIBYTES = 512
# The engine's interrupt for frames from the system, and that of the status, in the block design.
_FROM_SYSTEM, _STATUS = 1, 2
_LEVEL_HIGH = 4


@dataclass(frozen=True)
class _Linux:
    """A processor in Linux's device trees.

    An address consists of `cells` 32-bit numbers. `interrupts` is the label of the interrupt controller, and
    `first_interrupt` is the number of the logic's interrupt 0 among the shared interrupts. `clocks` is the label of the
    clock controller, and `first_clock` is its number for the logic's clock 0. `architecture` is bootgen's name.
    """

    cells: int
    interrupts: str
    first_interrupt: int
    clocks: str
    first_clock: int
    architecture: str


_LINUX = {
    "zynq7000": _Linux(1, "intc", 29, "clkc", 15, "zynq"),
    "zynqmp": _Linux(2, "gic", 89, "zynqmp_clk", 71, "zynqmp"),
}


def bring_up_files(
    system: DerivedSystem, board: Board, mebibytes: int, *, is_reserved: bool = False
) -> Mapping[str, str]:
    """Return the files by name; `mebibytes` is the size of the shared memory.

    If `is_reserved`, Linux reserves the memory when it boots; otherwise the memory comes from Linux's contiguous
    memory (CMA). Raise `InputError` if the board has no processor, or if the system does not fit on it.
    """
    check_runs_linux(board)
    if not 1 <= mebibytes <= _MOST_MEBIBYTES:
        fail(f"the shared memory has {mebibytes} MiB; legal: 1 to {_MOST_MEBIBYTES}")
    check_fits(system, board)
    context = _context(system, board, mebibytes, is_reserved=is_reserved)
    design = board_entity(system, board)
    files = {
        f"{design}.dtso": render("board/overlay.dtso", context),
        f"{design}.bif": render("board/bitstream.bif", context),
        f"{design}.sh": render("board/load.sh", context),
    }
    return {**files, f"{design}_memory.dtso": render("board/memory.dtso", context)} if is_reserved else files


def check_runs_linux(board: Board) -> None:
    """Raise `InputError` if a board has no processor."""
    if not board.processor:
        legal = ", ".join(_LINUX)
        fail(f"board '{board.name}' has no processor that runs Linux", hint=f"legal: a board with processor {legal}")


def _context(system: DerivedSystem, board: Board, mebibytes: int, *, is_reserved: bool) -> Context:
    linux = _LINUX[str(board.processor)]
    base = int(PROCESSORS[str(board.processor)].base, 16)
    size = mebibytes * 2**20
    return {
        "design": board_entity(system, board),
        "name": system.name,
        "architecture": linux.architecture,
        "cells": linux.cells,
        "interrupt_controller": linux.interrupts,
        "clocks": [*_clocks(system, linux)],
        "devices": [*_devices(system, linux, base)],
        "dma": DMA_NAME,
        "buffer": BUFFER_NAME,
        "size": f"{size:#x}",
        "size_cells": _numbers(size, linux.cells),
        "alignment": _numbers(_ALIGNMENT, linux.cells),
        "range": f"{_numbers(0, linux.cells)} {_numbers(_RESERVED_BELOW, linux.cells)}",
        "is_reserved": is_reserved,
    }


def _clocks(system: DerivedSystem, linux: _Linux) -> Iterator[Context]:
    assert system.clock is not None, "a board has a clock"
    frequencies: list[tuple[str, Fraction]] = [("clk", system.clock)]
    frequencies += [(str(item.port), item.frequency) for item in system.clocks]
    for number, (name, frequency) in enumerate(frequencies):
        yield {
            "node": f"firm-clock-{number}",
            "name": name,
            "clock": f"&{linux.clocks} {linux.first_clock + number}",
            "hertz": round(frequency),
        }


def _devices(system: DerivedSystem, linux: _Linux, base: int) -> Iterator[Context]:
    """Yield the UIO devices."""
    devices = [(DMA_NAME, "The DMA engine, with its interrupt for frames from the system", base, _FROM_SYSTEM)]
    if system.status is StatusAccess.AXI_LITE:
        devices.append((STATUS_NAME, "The status registers", base + STATUS_OFFSET, _STATUS))
    for node, meaning, address, interrupt in devices:
        yield {
            "node": node,
            "meaning": meaning,
            "address": f"{address:x}",
            "registers": f"{_numbers(address, linux.cells)} {_numbers(REGISTER_BYTES, linux.cells)}",
            "controller": linux.interrupts,
            "interrupt": f"0 {linux.first_interrupt + interrupt} {_LEVEL_HIGH}",
        }


def _numbers(value: int, cells: int) -> str:
    """Return a value as numbers of 32 bits, the highest first."""
    return " ".join(f"{value >> 32 * place & 0xFFFFFFFF:#x}" for place in reversed(range(cells)))
