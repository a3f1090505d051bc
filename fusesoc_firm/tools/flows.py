"""How a target is built: one of Edalize's flows with its options, as a table, a board or a generated core says.

A target with `flow: firm` names neither tool nor options. Its generated core has a file with both, whose name ends in
`SUFFIX`, so that they belong to the installed version of the product and not to the user's `.core`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fusesoc_firm.tools.simulators import SIMULATORS

FIRM = "firm"
"""The name of the flow in a target."""
# FuseSoC 2.4.7 loses the tags of files.
SUFFIX = ".firm_flow.json"
"""The end of the name of a generated core's file with the flow."""
NETLIST = "ghdlsynth"
"""Edalize's frontend that translates VHDL to a Verilog netlist."""


@dataclass(frozen=True)
class Flow:
    """A flow of Edalize with its options and those of its tools; `is_tool` marks a tool without a flow in Edalize.

    `clocks` are those by which the layout must be judged, in MHz by name.
    """

    name: str
    options: Mapping[str, Any]
    is_tool: bool = False
    clocks: Mapping[str, str] = field(default_factory=dict)

    @property
    def api(self) -> str:
        """Edalize's interface to it: `flow` or `tool`."""
        return "tool" if self.is_tool else "flow"

    @property
    def tool(self) -> str:
        """The tool that the flow starts, or an empty text for a flow with several."""
        return self.name if self.is_tool else str(self.options.get("tool", ""))

    def text(self) -> str:
        """Return the text of the file in a generated core."""
        clocks = {"clocks": self.clocks} if self.clocks else {}
        return json.dumps({"api": self.api, "name": self.name, "options": self.options, **clocks}, indent=1) + "\n"

    def file_name(self) -> str:
        """Return the file's name, which changes with its contents: FuseSoC configures a build again for new names."""
        return f"{hashlib.sha256(self.text().encode()).hexdigest()[:12]}{SUFFIX}"


def read_flow(text: str) -> Flow:
    """Return the flow that a file of a generated core describes."""
    data = json.loads(text)
    return Flow(data["name"], data["options"], data["api"] == "tool", data.get("clocks", {}))


@dataclass(frozen=True)
class Family:
    """A family of FPGAs: its description, and the options of Yosys' synth command."""

    description: str
    options: tuple[str, ...] = ()


FAMILIES: dict[str, Family] = {
    "xilinx": Family("Xilinx UltraScale+", ("-family", "xcup", "-flatten", "-abc9")),
    "ecp5": Family("Lattice ECP5", ("-abc9",)),
    "ice40": Family("Lattice iCE40 UltraPlus", ("-abc9", "-device", "u", "-dsp")),
    "gowin": Family("Gowin"),
}
"""The families whose cells can be counted, by Yosys' names; each system gets a target synth_<name>."""


def family_flow(name: str, *, has_vhdl: bool = True) -> Flow:
    """Return the flow that counts the cells of a design for a family of `FAMILIES`."""
    options = {
        "tool": "yosys",
        "frontends": [NETLIST] * has_vhdl,
        "arch": name,
        "output_format": "json",
        "yosys_synth_options": list(FAMILIES[name].options),
    }
    return Flow("generic", options)


def simulator_flow(name: str, unit: str, *, is_system_verilog: bool) -> Flow:
    """Return the flow of a simulator of `SIMULATORS`; one that does not read VHDL reads the netlist of `unit`."""
    simulator = SIMULATORS[name]
    netlist = {} if simulator.reads_vhdl else {"frontends": [NETLIST], "ghdlsynth_top": unit}
    further = simulator.system_verilog if is_system_verilog else {}
    return Flow("sim", {"tool": name, **further, **netlist, **simulator.options})
