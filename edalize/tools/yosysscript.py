"""Edalize's tool `yosysscript`: synthesis by a script of Yosys' own language, for a Yosys without Tcl, as YoWASP's.

Edalize finds a tool by its file's name, and its packages are namespace packages, so this one can be in another wheel.
"""

from __future__ import annotations

from typing import Any, ClassVar

from edalize.tools.edatool import Edatool
from edalize.utils import EdaCommands

from fusesoc_firm.text.quoting import make_argument


class Yosysscript(Edatool):  # type: ignore[misc]
    """Reads all Verilog of a build, and writes the netlist of an FPGA's family as JSON."""

    description = "Synthesise with Yosys, without Tcl"

    TOOL_OPTIONS: ClassVar[dict[str, dict[str, Any]]] = {
        "yosys_program": {"type": "str", "desc": "The program (default: yosys)"},
        "yosys_synth_command": {"type": "str", "desc": "The synth command, such as synth_nexus", "list": True},
        "yosys_synth_options": {"type": "str", "desc": "Additional options for the synth command", "list": True},
    }

    def setup(self, edam: dict[str, Any]) -> None:
        """Add the command that makes the netlist, and replace the Verilog files with the netlist."""
        super().setup(edam)
        verilog = [file for file in self.files if "erilogSource" in file.get("file_type", "")]
        sources = [file for file in verilog if "simulation" not in file.get("tags", [])]
        folders: list[str] = []
        read = [file for file in sources if not self._add_include_dir(file, folders)]
        output = f"{self.name}.json"
        words = [*self.tool_options["yosys_synth_command"], *self.tool_options.get("yosys_synth_options", [])]
        options = [f'-I"{folder}"' for folder in folders]
        options += [f"-D{name}={self._param_value_str(value)}" for name, value in self.vlogdefine.items()]
        lines = [" ".join([_reader(file), *options, f'"{file["name"]}"']) for file in read]
        lines += [f"chparam -set {name} {self._value(value)} {self.toplevel}" for name, value in self.vlogparam.items()]
        self.script = "\n".join([*lines, f'{" ".join(words)} -json "{output}" -top {self.toplevel}', ""])
        self.commands = EdaCommands()
        self.commands.add(
            [self.tool_options.get("yosys_program", "yosys"), "-l", "yosys.log", "-s", make_argument(self._script)],
            [output],
            [self._script, *(file["name"] for file in sources)],
        )
        self.commands.set_default_target(output)
        others = [file for file in self.files if file not in verilog]
        self.edam = {**edam, "files": [*others, {"name": output, "file_type": "jsonNetlist"}]}

    def write_config_files(self) -> None:
        """Write the script; the netlist is made again only if it changes."""
        self.update_config_file(self._script, self.script)

    def _value(self, value: Any) -> str:
        return str(self._param_value_str(value, str_quote_style='"'))

    @property
    def _script(self) -> str:
        return f"{self.name}.ys"


def _reader(file: dict[str, Any]) -> str:
    is_system_verilog = file["file_type"].startswith("systemVerilogSource")
    return "read_verilog -sv" if is_system_verilog else "read_verilog"
