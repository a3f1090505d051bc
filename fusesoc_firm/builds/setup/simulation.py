"""Run one simulation of a core through FuseSoC, with the whole output in a log, and read the report in it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.setup.flows import target_flow
from fusesoc_firm.builds.setup.logged_run import add_libraries, run_logged
from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.setup.plan import make_plan
from fusesoc_firm.core.core_reader import read_core
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.tools.programs import explanation, missing, simulation_programs
from fusesoc_firm.tools.simulators import SIMULATORS, Simulator

_MESSAGE = re.compile(r" *(\d+) > (\S+) \S+ ?(.*)")
_RESPONSE = re.compile(r" +< (\S+) \S+ ?(.*)")
_CYCLES = re.compile(r" +(\d+) cycles first beat in to last beat out, (-?\d+) last beat in to first beat out")
_VERDICT = re.compile(r"(PASS|FAIL) \d+/\d+")
_FAULT = re.compile(r"fault in cycle \d+: |nothing moved |missing: |and \d+ more faults")
# The first line of the host's report.
_WRONG = re.compile(r"fault in cycle \d+: '(\S+) \S+ ?(.*)': byte ")
_BEGIN = re.compile(r"seed \d+, ")


@dataclass
class Message:
    """A sent message and its responses as texts; the cycles are unknown (-1) without a response.

    `is_wrong` is True if the hardware sent other bytes than one of these responses.
    """

    number: int
    sent: str
    received: list[str] = field(default_factory=list)
    cycles: int = -1
    latency: int = -1
    is_wrong: bool = False


@dataclass
class Report:
    """The result of a simulation: the conditions, the messages, the faults, and the verdict with the lines before it.

    Without a verdict, the simulation did not run to its end. `status` is FuseSoC's exit status.
    """

    title: str = ""
    messages: list[Message] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    summary: list[str] = field(default_factory=list)
    verdict: str = ""
    status: int = 0
    _wrong: list[str] = field(default_factory=list)

    @property
    def is_good(self) -> bool:
        """Whether all responses are correct."""
        return self.verdict.startswith("PASS")

    def add(self, line: str) -> None:
        """Read a line of the output."""
        if _BEGIN.match(line):
            self.title = line.partition(";")[0]
        elif not self.title or self.verdict:
            return
        elif match := _MESSAGE.fullmatch(line):
            self.messages.append(Message(int(match[1]), f"{match[2]} {match[3]}".strip()))
        elif (match := _RESPONSE.fullmatch(line)) and self.messages:
            self.messages[-1].received.append(f"{match[1]} {match[2]}".strip())
            self.messages[-1].is_wrong |= self._take_wrong(f"{match[1]} {match[2]}")
        elif (match := _CYCLES.fullmatch(line)) and self.messages:
            self.messages[-1].cycles, self.messages[-1].latency = int(match[1]), int(match[2])
        elif _VERDICT.fullmatch(line):
            self.verdict = line
        elif _FAULT.match(line) or "error" in line:
            self.faults.append(line)
            if match := _WRONG.match(line):
                self._wrong.append(f"{match[1]} {match[2]}")
        elif line.endswith("last beat out") or line.startswith("in: "):
            self.summary.append(line)

    def _take_wrong(self, response: str) -> bool:
        """Return whether a fault in a response with this text was reported; the report precedes the response itself."""
        if is_wrong := response in self._wrong:
            self._wrong.remove(response)
        return is_wrong


@dataclass(frozen=True)
class Wishes:
    """The user's options of a simulation; an empty tool and a seed of None select the core's values."""

    tool: str = ""
    seed: int | None = None
    has_waves: bool = False
    options: str = ""


@dataclass(frozen=True)
class Simulation:
    """A simulation that can be run: its core, build and simulator, and FuseSoC's options after the core's name."""

    core_file: Path
    build: Build
    simulator: str
    options: tuple[str, ...]
    waves: Path | None

    def run(self, tell: Callable[[str, Report], None]) -> Report:
        """Run FuseSoC, call `tell` for each line with the report so far, and return the report."""
        report = Report()
        # Frames of an earlier run must not be read as received in this one.
        (self.build.work_root / "received.txt").unlink(missing_ok=True)

        def take(line: str) -> None:
            report.add(line)
            tell(line, report)

        report.status = run_logged(self.build, (), self.options, take)
        return report


def core_name(path: Path) -> str:
    """Return the name of a core. May raise `InputError`."""
    return str(read_core(path).data.get("name", ""))


def simulation(core: str, folder: Path | None, wishes: Wishes) -> Simulation:
    """Return the simulation of a core; `folder` is another folder in which FuseSoC searches for it.

    Raise `InputError` if the core or the tool is unknown, or if a program is missing.
    """
    add_libraries(core, folder)
    plan = make_plan([core], ["sim"])
    found = plan.fusesoc.get_core(plan.builds[0].core)
    targets = _targets(found)
    target = next((name for name in targets if wishes.tool in ("", targets[name])), "")
    if not target:
        others = ", ".join(dict.fromkeys(targets.values()))
        fail(f"{core} has no target for {wishes.tool or 'a simulator'}", hint=f"its simulators: {others or 'none'}")
    tool = targets[target]
    if absent := missing(simulation_programs(tool)):
        fail(explanation(absent).removeprefix("error: "))
    (build,) = plan.builds if target == "sim" else make_plan([core], [target]).builds
    waves = build.work_root / SIMULATORS[tool].waves if wishes.has_waves else None
    options = tuple(_options(wishes, SIMULATORS[tool]))
    return Simulation(Path(found.core_file), build, tool, options, waves)


def _options(wishes: Wishes, simulator: Simulator) -> Iterator[str]:
    """Yield the options of `fusesoc run` after the core's name. A host in Verilog takes its options from FuseSoC."""
    if not simulator.reads_vhdl:
        if wishes.seed is not None:
            yield f"--SEED={wishes.seed}"
        if wishes.has_waves:
            yield f"--WAVES={simulator.waves}"
            yield from simulator.wave_options
        yield from shlex.split(wishes.options)
        return
    flags = [f"-gSEED={wishes.seed}"] * (wishes.seed is not None) + [f"--wave={simulator.waves}"] * wishes.has_waves
    if text := " ".join([*flags, wishes.options]).strip():
        # Option and value are joined by `=`, since the value begins with a dash. FuseSoC appends it to the core's.
        yield f"--sim_options={text}"


def _targets(core: Any) -> dict[str, str]:
    """Return the simulation targets of a core with their simulators, the default first."""
    names = sorted(name for name in core.get_data({}).targets if name == "sim" or name.startswith("sim_"))
    flows = {name: target_flow(core, name) for name in names}
    return {name: flow.tool for name, flow in flows.items() if flow and not flow.is_tool and flow.tool in SIMULATORS}
