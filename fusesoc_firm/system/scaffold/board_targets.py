"""The boards that the targets of a system's core are for, and whether a system fits one of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fusesoc_firm.core.core_reader import CoreFile
from fusesoc_firm.system.boards.board import VIVADO, Board, check_fits, on_board, read_board
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.derived.ethernet import check_ethernet
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.system.written.specification import AXI_STREAM, CHIPS, LINKS
from fusesoc_firm.text.diagnostics import Diagnostics, InputError


def boards_of(core: CoreFile) -> dict[str, Board]:
    """Return the boards of a core by target; may raise `InputError` for a faulty file of a board."""
    found = {name: _board_name(core, target) for name, target in core.section("targets").items()}
    return {name: read_board(board, core.path.parent) for name, board in found.items() if board}


def _board_name(core: CoreFile, target: Mapping[str, Any]) -> str:
    """Return the board that a target's calls of generators name, or an empty text."""
    calls = target.get("generate")
    for call in calls if isinstance(calls, list) else ():
        for instance, given in (call if isinstance(call, dict) else {call: None}).items():
            parameters = core.parameters(str(instance)) | (given if isinstance(given, dict) else {})
            if board := parameters.get("board"):
                return str(board)
    return ""


def fits(loaded: LoadedSystem, board: Board) -> bool:
    """Return whether a system can be built for a board: with its link, clocks and pins."""
    if not has_target(loaded.system, board):
        return False
    try:
        check_fits(placed(loaded, board), board)
    except InputError:
        return False
    return True


def placed(loaded: LoadedSystem, board: Board) -> DerivedSystem:
    """Return a system as it is built for a board, with the board's link. May raise `InputError`."""
    faults, specification = Diagnostics(), on_board(loaded.specification, board)
    system = derive(specification, loaded.folder, loaded.libraries, faults, needs_sources=False)
    check_ethernet(specification, system, faults)
    faults.raise_if_any()
    return system


def has_target(system: DerivedSystem, board: Board) -> bool:
    """Return whether a system's core has a target for a board.

    Only Vivado builds kernels of HLS, and a node in fabric needs a board with its network.
    """
    kind = system.network.kind.value if system.network else ""
    is_its_network = kind in CHIPS if board.interconnect in CHIPS else board.interconnect in (kind, *LINKS, AXI_STREAM)
    return is_its_network and not (system.kernels and board.flow != VIVADO)
