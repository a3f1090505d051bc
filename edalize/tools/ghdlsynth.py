"""Edalize's tool `ghdlsynth`: translates all VHDL of a build to one Verilog netlist, as a frontend of any Verilog flow.

    flow: sim
    flow_options: {tool: icarus, frontends: [ghdlsynth], ghdlsynth_top: robot_system}

Edalize finds a tool by its file's name, and its packages are namespace packages, so this one can be in another wheel.
The implementation is in `fusesoc_firm.netlist`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, ClassVar

from edalize.tools.edatool import Edatool
from edalize.utils import EdaCommands

from fusesoc_firm.netlist.translation import Translation, translator
from fusesoc_firm.text.quoting import make_argument, make_prerequisite
from fusesoc_firm.tools.programs import programs_of


class Ghdlsynth(Edatool):  # type: ignore[misc]
    """Translates VHDL to Verilog; files with the tag `simulation`, such as test benches, are excluded."""

    description = "Translate VHDL to a Verilog netlist with GHDL"

    TOOL_OPTIONS: ClassVar[dict[str, dict[str, Any]]] = {
        "ghdlsynth_top": {"type": "str", "desc": "VHDL unit to translate, [library.]unit (default: the toplevel)"},
        "ghdlsynth_std": {"type": "str", "desc": "VHDL standard (default: 08 if a file has it, else 93)"},
        "ghdlsynth_options": {"type": "str", "desc": "Additional options for ghdl --synth", "list": True},
        "ghdlsynth_refuse_loops": {"type": "bool", "desc": "Report combinational loops as errors"},
    }

    def setup(self, edam: dict[str, Any]) -> None:
        """Add the command that makes the netlist, and replace the VHDL files with the netlist."""
        super().setup(edam)
        vhdl = [file for file in self.files if file.get("file_type", "").startswith("vhdlSource")]
        others = [file for file in self.files if file not in vhdl]
        sources = [file for file in vhdl if "simulation" not in file.get("tags", [])]
        libraries: dict[str, list[str]] = {}
        for file in sources:
            libraries.setdefault(file.get("logical_name") or "work", []).append(file["name"])
        self.translation = Translation(
            top=self.tool_options.get("ghdlsynth_top") or self.toplevel,
            output=f"{self.name}_netlist.v",
            libraries=libraries,
            generics={name: self._param_value_str(value, bool_is_str=True) for name, value in self.generic.items()},
            verilog=[file["name"] for file in others if "erilogSource" in file.get("file_type", "")],
            std=self.tool_options.get("ghdlsynth_std") or _standard(sources),
            options=self.tool_options.get("ghdlsynth_options", []),
            programs=_programs(edam),
            refuses_loops=bool(self.tool_options.get("ghdlsynth_refuse_loops")),
            defines={name: self._param_value_str(value) for name, value in self.vlogdefine.items()},
        )
        output = self.translation.output
        self.commands = EdaCommands()
        self.commands.add(
            [make_argument(sys.executable), "-m", "fusesoc_firm.netlist", self._request],
            [output],
            [
                self._request,
                *(file["name"] for file in sources),
                *self.translation.verilog,
                *(make_prerequisite(str(path)) for path in translator()),
            ],
        )
        self.commands.set_default_target(output)
        netlist = {"name": output, "file_type": "verilogSource"}
        self.edam = {**edam, "files": [netlist, *others]}

    def write_config_files(self) -> None:
        """Write the request of the translation; the netlist is rebuilt only if the request changes."""
        self.update_config_file(self._request, self.translation.to_json())

    @property
    def _request(self) -> str:
        return f"{self.name}.ghdlsynth"


def _programs(edam: dict[str, Any]) -> list[str]:
    """The programs that the tools of the flow start; Edalize has options for each tool."""
    tools = edam.get("tool_options", {})
    return [program for tool, options in tools.items() for program in programs_of(tool, options)]


def _standard(files: Sequence[dict[str, Any]]) -> str:
    """The VHDL standard, which in GHDL is the same for all files."""
    return "08" if any(file["file_type"].endswith("-2008") for file in files) else "93"
