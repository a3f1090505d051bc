"""Edalize's tool `nextpnrpack`: layout and bitstream for the families of `OPEN_FLOWS` that Edalize does not know.

Edalize finds a tool by its file's name, and its packages are namespace packages, so this one can be in another wheel.
"""

from __future__ import annotations

from typing import Any, ClassVar

from edalize.tools.edatool import Edatool
from edalize.utils import EdaCommands

from fusesoc_firm.tools.open_flows import OPEN_FLOWS


class Nextpnrpack(Edatool):  # type: ignore[misc]
    """Places and routes a netlist in JSON with nextpnr, and packs the layout to a bitstream."""

    description = "Place, route and pack with nextpnr and the packer of its family"

    TOOL_OPTIONS: ClassVar[dict[str, dict[str, Any]]] = {
        "arch": {"type": "str", "desc": "Family of FPGAs: gatemate, machxo2 or nexus"},
        "device": {"type": "str", "desc": "The FPGA, by nextpnr's name"},
        "nextpnr_options": {"type": "str", "desc": "Additional options for nextpnr", "list": True},
        "pack_options": {"type": "str", "desc": "Additional options for the packer", "list": True},
    }

    def setup(self, edam: dict[str, Any]) -> None:
        """Add the commands from a netlist and a file of constraints to the bitstream."""
        super().setup(edam)
        flow = OPEN_FLOWS[self._require_tool_option("arch")]
        assert flow.own
        constraints = [file["name"] for file in self.files if file.get("file_type") == flow.file_type]
        if len(constraints) > 1:
            raise RuntimeError(f"nextpnr reads one file of type {flow.file_type}, not {' and '.join(constraints)}")
        (netlist,) = (file["name"] for file in self.files if file.get("file_type") == "jsonNetlist")
        layout, bitstream = f"{self.name}{flow.own.layout}", f"{self.name}{flow.bitstream}"
        words = [flow.layout, "-l", "next.log", "--device", self._require_tool_option("device"), *flow.own.options]
        words += [word.format(file) for file in constraints for word in flow.own.constraints]
        words += ["--json", netlist, *(word.format(layout) for word in flow.own.output)]
        words += self.tool_options.get("nextpnr_options", [])
        packing = [*flow.own.packing, *self.tool_options.get("pack_options", []), layout, bitstream]
        self.commands = EdaCommands()
        self.commands.add(words, [layout], [netlist, *constraints])
        self.commands.add(packing, [bitstream], [layout])
        self.commands.set_default_target(bitstream)
        self.edam = {**edam, "files": [{"name": bitstream, "file_type": "bitstream"}]}
