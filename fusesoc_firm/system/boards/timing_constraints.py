"""Derived System -> template configuration: constraints on clocks and on the paths between clocks.

docs/how-to/use-several-clocks.md lists the constraints.
"""

from __future__ import annotations

from fractions import Fraction

from fusesoc_firm.system.boards.board import Board
from fusesoc_firm.system.boards.processor import PROCESSORS
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.hardware.names import reset_label, seen_reset
from fusesoc_firm.text.render import Context


def clocks_configuration(system: DerivedSystem, board: Board, clock: Fraction) -> Context:
    """Return the configuration, with the processor's names for its clocks; `clock` is the frequency of clk in Hz."""
    clocks = [("clk", clock), *((item.port, item.frequency) for item in system.clocks)]
    if board.processor:
        name = PROCESSORS[str(board.processor)].timing_clock
        named = [(name.format(number), port, frequency) for number, (port, frequency) in enumerate(clocks)]
    else:
        named = [(port, port, frequency) for port, frequency in clocks]
    resets = [reset for item in system.clocks for reset in (item.reset, seen_reset(item))]
    return {
        "description": str(board.description),
        "clocks": [{"name": name, "port": port, "period": period(frequency)} for name, port, frequency in named],
        "pairs": [
            {"source": source, "sink": sink, "period": period(max(first, second))}
            for source, _, first in named
            for sink, _, second in named
            if source != sink
        ],
        "resets": [{"label": reset_label(reset)} for reset in resets],
    }


def period(frequency: Fraction) -> str:
    """Return the period in ns for a frequency in Hz, with three decimal places."""
    return f"{float(10**9 / frequency):.3f}"
