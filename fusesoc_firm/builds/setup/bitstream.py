"""The build of a core's target for a board: its programs, its bitstream, and what nextpnr reports about it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.builds.setup.flows import target_flow
from fusesoc_firm.builds.setup.logged_run import add_libraries
from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.setup.plan import make_plan
from fusesoc_firm.system.boards.board import boards
from fusesoc_firm.text.diagnostics import closest, fail
from fusesoc_firm.tools.programs import missing, ways

_NETLIST = ("ghdl", "yosys")
_REPORT = "report.json"


@dataclass(frozen=True)
class _Flow:
    """A flow of Edalize that ends in a bitstream: the file's extension and the programs; open ones are an extra."""

    extension: str
    programs: tuple[str, ...]


_FLOWS = {
    "apicula": _Flow(".fs", (*_NETLIST, "nextpnr-himbaechel", "gowin_pack")),
    "icestorm": _Flow(".bin", (*_NETLIST, "nextpnr-ice40", "icepack")),
    "trellis": _Flow(".bit", (*_NETLIST, "nextpnr-ecp5", "ecppack")),
    "vivado": _Flow(".bit", ("vivado",)),
}


@dataclass(frozen=True)
class BoardBuild:
    """The build of a core for a board, whose name is that of the target."""

    core_file: Path
    build: Build
    flow: str

    @property
    def board(self) -> str:
        """The board's name."""
        return self.build.target

    @property
    def bitstream(self) -> Path | None:
        """The bitstream, or None if it is not built."""
        name = self.build.core.replace(":", "_")
        path = self.build.work_root / f"{name}{_FLOWS[self.flow].extension}"
        return path if path.is_file() else None

    def check_programs(self) -> None:
        """Raise `InputError` if a program of the build is not installed."""
        if absent := missing(_FLOWS[self.flow].programs):
            extra = f"; all of Python: pip install 'fusesoc-firm[{self.flow}]'" if self.flow != "vivado" else ""
            hint = "; ".join(f"{program}: {ways(program)}" for program in absent)
            fail(f"missing programs: {', '.join(absent)}", hint=hint + extra)

    def figures(self) -> list[str]:
        """Return lines about the clocks and the area that nextpnr reports; without a report, an empty list."""
        path = self.build.work_root / _REPORT
        if not path.is_file():
            return []
        report = json.loads(path.read_text(encoding="utf-8"))
        clocks = [
            f"{clock['achieved']:.1f} MHz reached, {clock['constraint']:.1f} MHz needed"
            for clock in report["fmax"].values()
        ]
        used = {name: item for name, item in report["utilization"].items() if item["used"]}
        area = [f"{name} {item['used']} of {item['available']}" for name, item in used.items()]
        return [*(f"clock:     {line}" for line in clocks), f"area:      {', '.join(area)}"]


def board_builds(core: str, folder: Path | None) -> list[BoardBuild]:
    """Return the builds for all boards of a core; `folder` is another folder in which FuseSoC searches for it.

    May raise `InputError`.
    """
    add_libraries(core, folder)
    plan = make_plan([core], ["*"])
    found = plan.fusesoc.get_core(plan.builds[0].core)
    flows = {build: target_flow(found, build.target) for build in plan.builds}
    builds = [
        BoardBuild(Path(found.core_file), build, flow.name)
        for build, flow in flows.items()
        if flow and flow.name in _FLOWS
    ]
    if not builds:
        fail(f"{core} has no target for a board", hint="'firm system core SPEC' adds one for each board that fits")
    return builds


def choose(builds: Sequence[BoardBuild], board: str | None) -> BoardBuild:
    """Return the build for a board or, without a name, the only one that has a bitstream. May raise `InputError`."""
    known = {build.board: build for build in builds}
    file, names = builds[0].core_file.name, ", ".join(known)
    if board is None:
        built = [build for build in builds if build.bitstream]
        if len(built) != 1:
            fail("which board?", hint=f"add --board NAME; boards of {file}: {names}")
        return built[0]
    if board not in known:
        near = closest(board, known) if board not in boards() else None
        reason = f"did you mean '{near}'? " if near else "the system does not fit it; " * (board in boards())
        fail(f"{file} has no board '{board}'", hint=f"{reason}boards of {file}: {names}")
    return known[board]
