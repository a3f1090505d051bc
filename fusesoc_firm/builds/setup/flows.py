"""The flow of a core's target, before anything is generated."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.setup.cores import calls_of
from fusesoc_firm.system.boards.board import read_board
from fusesoc_firm.tools.flows import FAMILIES, FIRM, Flow, family_flow, simulator_flow
from fusesoc_firm.tools.simulators import SIMULATORS, default_simulator

# The generator whose cores determine a flow.
_SYSTEMS = "far"


def flow_of(core: Any, flags: Mapping[str, Any]) -> Flow | None:
    """Return the flow or tool of the target in `flags`, or None if it has none. May raise `InputError`.

    Of `flow: firm`, it is what a board or a simulator determines, without the options that only generating tells.
    """
    # FuseSoC reads another target for a dependency.
    flags = {**flags, "is_toplevel": True}
    name = core.get_flow(flags)
    if not name:
        tool = flags.get("tool")
        return Flow(str(tool), {}, is_tool=True) if tool else None
    options = core.get_flow_options(flags)
    if name != FIRM:
        return Flow(str(name), options)
    if options.get("family") in FAMILIES:
        return family_flow(options["family"])
    calls = [call for call in calls_of(core, flags) if call.generator == _SYSTEMS]
    for parameters in (call.parameters for call in calls):
        if board := parameters.get("board"):
            return read_board(str(board), Path(core.files_root)).edalize_flow
        simulator = str(parameters.get("simulator", default_simulator()))
        if parameters.get("product", "system") != "system" and simulator in SIMULATORS:
            return simulator_flow(simulator, "", is_system_verilog=False)
    return Flow(FIRM, options)


def target_flow(core: Any, target: str) -> Flow | None:
    """Return the flow or tool of a core's target, or None if it has none. May raise `InputError`."""
    return flow_of(core, {**core.get_flags(target), "target": target})
