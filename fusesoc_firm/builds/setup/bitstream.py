"""The build of a core's target for a board: its programs, its bitstream, and what nextpnr reports about it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.setup.flows import target_flow
from fusesoc_firm.builds.setup.logged_run import add_libraries, run_logged
from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.setup.plan import make_plan
from fusesoc_firm.core.core_reader import read_core
from fusesoc_firm.system.boards.board import Board, boards
from fusesoc_firm.system.scaffold.board_targets import boards_of
from fusesoc_firm.text.diagnostics import closest, fail
from fusesoc_firm.tools.open_flows import OPEN_FLOWS, REPORT
from fusesoc_firm.tools.programs import missing, ways

CHECK = "check"
_SETUP = "generated files"
_STEPS = ("netlist", "synthesis", "place and route", "bitstream")
# The line with which a makefile starts a program of a build; Python is the netlist's program.
_START = re.compile(r"-m fusesoc_firm\.cli tool (?:\S*/)?(?P<program>\S+)(?P<netlist> -m fusesoc_firm\.netlist )?")


@dataclass(frozen=True)
class _Flow:
    """A flow of Edalize that ends in a bitstream: the file's extension, and the step of each program in their order."""

    extension: str
    programs: Mapping[str, str]


_FLOWS = {
    name: _Flow(flow.bitstream, dict(zip(("ghdl", *flow.programs), _STEPS, strict=True)))
    for name, flow in OPEN_FLOWS.items()
} | {"vivado": _Flow(".bit", {"vivado": _STEPS[-1]})}


@dataclass(frozen=True)
class Step:
    """A step of a build: its number, counted from 1, of `count`; `line` is the last line of its program's output."""

    step: str
    number: int
    count: int
    line: str = ""

    def __str__(self) -> str:
        return f"{self.step} ({self.number} of {self.count}){f': {self.line}' if self.line else ''}"


@dataclass(frozen=True)
class Clock:
    """A clock of a placed system: the frequency that it reaches and the one that the board needs, in MHz."""

    name: str
    reached: float
    needed: float


@dataclass(frozen=True)
class Use:
    """The cells of a kind that a placed system uses, of those that the FPGA has."""

    name: str
    used: int
    available: int


@dataclass(frozen=True)
class Figures:
    """What nextpnr reports about a placed system; both are empty without a report."""

    clocks: tuple[Clock, ...] = ()
    area: tuple[Use, ...] = ()

    @property
    def is_too_slow(self) -> bool:
        """Whether the system does not reach one of the clocks."""
        return any(item.reached < item.needed for item in self.clocks)

    def lines(self) -> list[str]:
        """Return the figures as lines of a report."""
        found = [f"clock:     {item.reached:.1f} MHz reached, {item.needed:.1f} MHz needed" for item in self.clocks]
        # nextpnr counts some cells of a GateMate only in use.
        counts = {item: f" of {item.available}" if item.available else "" for item in self.area}
        area = ", ".join(f"{item.name} {item.used}{available}" for item, available in counts.items())
        return found + [f"area:      {area}"] * bool(area)

    def data(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        return {"clocks": [*map(asdict, self.clocks)], "area": [*map(asdict, self.area)]}


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
    def board_file(self) -> Board:
        """The content of the board's file. May raise `InputError`."""
        return boards_of(read_core(self.core_file))[self.board]

    @property
    def bitstream(self) -> Path | None:
        """The bitstream, or None if it is not built."""
        name = self.build.core.replace(":", "_")
        path = self.build.work_root / f"{name}{_FLOWS[self.flow].extension}"
        return path if path.is_file() else None

    def check_programs(self) -> None:
        """Raise `InputError` if a program of the build is not installed."""
        if absent := missing(programs_of(self.flow)):
            fail(f"missing programs: {', '.join(absent)}", hint=remedy(self.flow, absent))

    def step(self, name: str, line: str = "") -> Step:
        """Return a step of this build."""
        names = (CHECK, _SETUP, *_FLOWS[self.flow].programs.values())
        return Step(name, names.index(name) + 1, len(names), line)

    def run(self, tell: Callable[[Step], None]) -> int:
        """Build, call `tell` for each line of the programs, and return FuseSoC's exit status."""
        steps, name = _FLOWS[self.flow].programs, _SETUP

        def take(line: str) -> None:
            nonlocal name
            if start := _START.search(line):
                name = steps.get("ghdl" if start["netlist"] else start["program"], name)
            tell(self.step(name, line))

        tell(self.step(_SETUP))
        return run_logged(self.build, ("--setup", "--build"), (), take)

    def figures(self) -> Figures:
        """Return what nextpnr reports about the clocks and the area."""
        path = self.build.work_root / REPORT
        if not path.is_file():
            return Figures()
        report = json.loads(path.read_text(encoding="utf-8"))
        clocks = [Clock(name, item["achieved"], item["constraint"]) for name, item in report["fmax"].items()]
        area = [Use(name, **item) for name, item in report["utilization"].items() if item["used"]]
        return Figures(tuple(clocks), tuple(area))


def programs_of(flow: str) -> Sequence[str]:
    """Return the programs of a flow that ends in a bitstream; none for other flows."""
    return [*_FLOWS[flow].programs] if flow in _FLOWS else []


def remedy(flow: str, absent: Sequence[str]) -> str:
    """Return the commands that install missing programs of a flow."""
    extra = f"; all of Python: pip install 'fusesoc-firm[{flow}]'" if flow != "vivado" else ""
    return "; ".join(f"{program}: {ways(program)}" for program in absent) + extra


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
