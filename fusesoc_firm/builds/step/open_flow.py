"""Edalize's flows of this package that end in a bitstream: from Verilog to a netlist, a layout, and its bitstream."""

from __future__ import annotations

from typing import Any, ClassVar

from edalize.flows.edaflow import Edaflow, FlowGraph

from fusesoc_firm.tools.open_flows import OPEN_FLOWS

_SYNTHESIS, _LAYOUT = "yosysscript", "nextpnrpack"


class BitstreamFlow(Edaflow):  # type: ignore[misc]
    """A flow of `OPEN_FLOWS` that Edalize lacks; a subclass has its name."""

    argtypes: ClassVar[list[str]] = ["vlogdefine", "vlogparam"]

    @classmethod
    def _set_by_flow(cls) -> dict[str, dict[str, Any]]:
        """Return the options of each tool that the flow determines."""
        name = cls.__name__.lower()
        flow = OPEN_FLOWS[name]
        assert flow.own
        synthesis = {"yosys_program": flow.synthesis, "yosys_synth_command": [*flow.own.synthesis]}
        return {_SYNTHESIS: synthesis, _LAYOUT: {"arch": name}}

    @classmethod
    def get_tool_options(cls, flow_options: dict[str, Any]) -> Any:
        """Return the options of the tools, without those that the flow determines."""
        fixed = cls._set_by_flow()
        return cls.get_filtered_tool_options([*flow_options.get("frontends", []), *fixed], fixed)

    def configure_flow(self, flow_options: dict[str, Any]) -> Any:
        """Return the tools in their order; the frontends precede the synthesis."""
        graph: dict[str, dict[str, Any]] = {}
        fixed = self._set_by_flow()
        for tool in [*flow_options.get("frontends", []), *fixed]:
            graph[tool] = {"deps": [*graph][-1:], "fdto": fixed.get(tool, {})}
        self.commands.set_default_target(f"{self.edam['name']}{OPEN_FLOWS[type(self).__name__.lower()].bitstream}")
        return FlowGraph.fromdict(graph)

    def build(self) -> None:
        """Run the tools."""
        command, arguments = self.build_runner.get_build_command()
        self._run_tool(command, arguments, cwd=self.work_root)
