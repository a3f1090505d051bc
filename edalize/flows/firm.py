"""Edalize's flow `firm`: builds a target with the flow and the options that its generated core names.

    flow: firm
    generate: [system: {board: icebreaker}]

With `flow_options: {family: ice40}`, it counts the cells that Yosys makes for a family of FPGAs. Further options are
those of the flow and its tools; lists are appended to the generated core's. Edalize finds a flow by its file's name,
and its packages are namespace packages, so this one can be in another wheel.
"""

from __future__ import annotations

from typing import Any

from edalize.flows.generic import Generic

from fusesoc_firm.builds.step.flow import backend, known_options, resolved
from fusesoc_firm.tools.flows import FAMILIES


class Firm:
    """Stands for the flow of each build: a new object is one of that flow's class."""

    argtypes = Generic.argtypes

    @classmethod
    def get_flow_options(cls) -> dict[str, Any]:
        """Return the options that select a flow."""
        description = f"Count the cells for a family of FPGAs: {', '.join(FAMILIES)}"
        return {"family": {"type": "str", "desc": description}}

    @classmethod
    def get_tool_options(cls, flow_options: dict[str, Any]) -> dict[str, Any]:
        """Return the options of all flows and tools, since the generated core is not known yet."""
        return known_options()

    def __new__(cls, edam: dict[str, Any], work_root: str, verbose: bool = False) -> Any:
        """Return the backend of the build in `work_root`. Raise `RuntimeError` for an option that it does not have."""
        return backend(*resolved("flow", "firm", edam, work_root), work_root, is_verbose=verbose)
