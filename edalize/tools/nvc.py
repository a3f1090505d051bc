"""Edalize's tool `nvc`: simulates the VHDL of a build with nvc (https://www.nickg.me.uk/nvc).

    flow: sim
    flow_options: {tool: nvc, sim_options: [-gSEED=7]}

Edalize finds a tool by its file's name, and its packages are namespace packages, so this one can be in another wheel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from edalize.tools.edatool import Edatool
from edalize.utils import EdaCommands

# A design's heap; nvc's default of 16 MB is too little for messages of some MB.
_HEAP = "1g"
_REVISIONS = {"87": "1993", "93": "1993", "2008": "2008", "2019": "2019"}


class Nvc(Edatool):  # type: ignore[misc]
    """Analyses all VHDL of a build, then elaborates and runs the toplevel in one command."""

    description = "Simulate VHDL with nvc"

    TOOL_OPTIONS: ClassVar[dict[str, dict[str, Any]]] = {
        "nvc_options": {"type": "str", "desc": "Global options", "list": True},
        "analyze_options": {"type": "str", "desc": "Options of the analysis", "list": True},
        "sim_options": {"type": "str", "desc": "Options of the run; -gNAME=VALUE sets a generic", "list": True},
    }

    def setup(self, edam: dict[str, Any]) -> None:
        """Add an analysis for each library, in the order of the files, and the run."""
        super().setup(edam)
        vhdl = [file for file in self.files if file.get("file_type", "").startswith("vhdlSource")]
        self.edam = {**edam, "files": [file for file in self.files if file not in vhdl]}
        libraries: dict[str, list[str]] = {}
        for file in vhdl:
            libraries.setdefault(file.get("logical_name") or "work", []).append(file["name"])
        program = ["nvc", f"--std={_revision(vhdl)}", "-M", _HEAP, "-L.", *self._options("nvc_options")]
        self.commands = EdaCommands()
        self.analyses = ""
        analysed: list[str] = []
        for library, files in libraries.items():
            command = [*program, f"--work={library}:{library}", "-a", *self._options("analyze_options"), *files]
            self.commands.add(command, [f"{library}/_index"], [self._written, *files, *analysed])
            self.analyses += f"{' '.join(command)}\n"
            analysed.append(f"{library}/_index")
        library, _, unit = self.toplevel.rpartition(".")
        generics = [f"-g{name}={self._param_value_str(value, bool_is_str=True)}" for name, value in self._generics()]
        options = self._options("sim_options")
        elaborated = [*generics, *(word for word in options if word.startswith("-g"))]
        run = [word for word in options if not word.startswith("-g")]
        work = library or "work"
        command = [*program, f"--work={work}:{work}", "-e", "--no-save", "--jit", unit, *elaborated, "-r", *run]
        self.commands.add(command, ["run"], analysed)
        self.commands.set_default_target(analysed[-1] if analysed else "run")

    def write_config_files(self) -> None:
        """Write the analyses; all are made again if one of them changes, such as by another file."""
        self.update_config_file(self._written, self.analyses)

    def run(self) -> tuple[str, list[str], str]:
        """Return the command that runs the simulation."""
        return ("make", ["run"], self.work_root)

    @property
    def _written(self) -> str:
        return f"{self.name}.nvc"

    def _options(self, name: str) -> list[str]:
        """Return the words of an option; FuseSoC joins those of its command line."""
        return [word for item in self.tool_options.get(name, []) for word in item.split()]

    def _generics(self) -> list[tuple[str, Any]]:
        """Return the generics; the flow `sim` of Edalize has none, and its parameters of Verilog are meant."""
        return [*self.vlogparam.items(), *self.generic.items()]


def _revision(files: Sequence[dict[str, Any]]) -> str:
    """Return the revision of the standard: the newest of the files' ones."""
    return max((_REVISIONS.get(file["file_type"].partition("-")[2], "1993") for file in files), default="1993")
