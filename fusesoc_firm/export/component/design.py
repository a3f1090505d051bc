"""A core's target as FuseSoC sets it up: its top unit, and the files, generics and macros of its build."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.builds.call.calls import make_request
from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.builds.project import message_folders
from fusesoc_firm.builds.setup.logged_run import add_libraries, run_logged
from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.setup.plan import Plan, select_plan
from fusesoc_firm.builds.setup.run_options import RunOptions
from fusesoc_firm.builds.setup.selection import Selection
from fusesoc_firm.core.core_reader import core_name
from fusesoc_firm.system.system_core import LoadedSystem, load_requested
from fusesoc_firm.text.diagnostics import InputError, fail

# The generator of systems.
_SYSTEMS = "far"
# The tool that sets up a target without flow and tool: of all tools, the files for this one belong into a block design.
_TOOL = "vivado"
_ORDINARY = ("system", None)


@dataclass(frozen=True)
class TargetPlan:
    """The planned set-up of a core's target."""

    plan: Plan

    @property
    def build(self) -> Build:
        """The build."""
        return self.plan.builds[0]

    def set_up(self, tell: Callable[[str], None]) -> int:
        """Let FuseSoC generate and collect the files; call `tell` for each line, and return the exit status."""
        return run_logged(self.build, ("--setup", *self.plan.options.options()), (), tell)

    def read(self) -> Design:
        """Return the target that has been set up. Raise `InputError` if it has no single top unit."""
        (path,) = self.build.work_root.glob("*.eda.yml")
        edam = yaml.safe_load(path.read_text(encoding="utf-8"))
        tops = str(edam.get("toplevel") or "").split()
        if len(tops) != 1:
            fail(f"{self.build} has {len(tops)} top units: {', '.join(tops)}", hint="a component has one of them")
        core = self.plan.fusesoc.get_core(self.build.core)
        return Design(self.build, edam, tops[0], core.get_description() or "", self._system(tops[0]))

    def _system(self, top: str) -> LoadedSystem | None:
        """Return the system whose top level is the top unit."""
        for call in self.plan.generator_calls():
            if call.generator == _SYSTEMS:
                request = make_request(call, GENERATORS[_SYSTEMS].parameters, message_folders)
                loaded = load_requested(request) if request.parameters["product"] in _ORDINARY else None
                if loaded and loaded.system.entity == top:
                    return loaded
        return None


@dataclass(frozen=True)
class Design:
    """A target that has been set up; `edam` is what FuseSoC gives to Edalize, with paths relative to the work root."""

    build: Build
    edam: Mapping[str, Any]
    top: str
    description: str
    system: LoadedSystem | None

    @property
    def unit(self) -> str:
        """The top unit without its library."""
        return self.top.rpartition(".")[2]

    @property
    def files(self) -> Sequence[Mapping[str, Any]]:
        """The files of the hardware, without those of its simulation."""
        return [file for file in self.edam["files"] if "simulation" not in file.get("tags", [])]

    def vhdl(self) -> dict[str, list[str]]:
        """Return the VHDL files by library."""
        found: dict[str, list[str]] = {}
        for file in self.files:
            if is_vhdl(file):
                found.setdefault(file.get("logical_name") or "work", []).append(file["name"])
        return found

    @property
    def standard(self) -> str:
        """The VHDL standard, which in GHDL is the same for all files."""
        return "08" if any(str(file.get("file_type", "")).endswith("-2008") for file in self.files) else "93"

    def parameters(self, kind: str) -> dict[str, str]:
        """Return the values of parameters of a kind in FuseSoC's words: generic, vlogparam or vlogdefine."""
        given = {
            name: item["default"]
            for name, item in self.edam.get("parameters", {}).items()
            if item["paramtype"] == kind and item.get("default") is not None
        }
        return {name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in given.items()}


def is_vhdl(file: Mapping[str, Any]) -> bool:
    """Return whether a file is in VHDL."""
    return str(file.get("file_type", "")).startswith("vhdlSource")


def is_verilog(file: Mapping[str, Any]) -> bool:
    """Return whether a file is in Verilog or SystemVerilog."""
    return "erilogSource" in str(file.get("file_type", ""))


def plan_target(core: str, folder: Path | None, target: str) -> TargetPlan:
    """Return the planned set-up of a target; `folder` is another folder in which FuseSoC searches for the core.

    Raise `InputError` for an unknown core or target.
    """
    add_libraries(core, folder)
    selection = Selection((core,), (target,))
    try:
        plan = select_plan(selection, RunOptions())
    except InputError:
        plan = select_plan(selection, RunOptions(tool=_TOOL))
    if len(plan.builds) != 1:
        names = ", ".join(map(str, plan.builds))
        fail(f"a component is of one core and one target, not of {names}", hint="name one of them")
    found = plan.fusesoc.get_core(plan.builds[0].core)
    # FuseSoC sets up no target without a top unit.
    if not found.get_data({}).targets[target].toplevel:
        fail(f"target '{target}' of {plan.builds[0].core} has no top unit", hint="add 'toplevel: UNIT' to the target")
    return TargetPlan(plan)


def vlnv(build: Build) -> tuple[str, str, str, str]:
    """Return vendor, library, name and version of a build's core, with words for a missing vendor and library."""
    vendor, library, name = core_name(build.core).split(":")
    return vendor or "local", library or "user", name, build.core.rpartition(":")[2]
