"""`firm sim`: simulate a system, and print the result, the messages and the files to look at."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.check import check_core_file
from fusesoc_firm.cli.common import (
    coloured,
    command,
    natural,
    terminal_width,
)
from fusesoc_firm.cli.failed_build import print_errors
from fusesoc_firm.cli.here import core_named
from fusesoc_firm.cli.progress import Progress
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import shown
from fusesoc_firm.tools.simulators import SIMULATORS

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.simulation import Report, Simulation
    from fusesoc_firm.runs.simulation.answers import Answer
    from fusesoc_firm.system.system_core import LoadedSystem

_MOST_MESSAGES = 10
_NARROWEST = 60
# The mark before the number of a message with a wrong response.
_WRONG = "!"


def add_sim(commands: Any) -> None:
    """Declare the command."""
    sim = command(
        commands,
        "sim",
        "simulate a system, compare every byte with its model, and print the result",
        "firm sim --waves",
        _sim,
    )
    sim.add_argument(
        "system",
        metavar="SPEC|CORE",
        nargs="?",
        help="a specification with a core beside it, or a core's name in FuseSoC (default: the core in this folder)",
    )
    sim.add_argument("--tool", choices=[*SIMULATORS], help="the simulator (default: the core's)")
    sim.add_argument("--seed", type=natural, metavar="N", help="the seed of the random stalls (default: the core's)")
    sim.add_argument("--waves", action="store_true", help="write a waveform file")
    sim.add_argument(
        "--options",
        default="",
        metavar="TEXT",
        help="further options for the simulator, with an equals sign: --options=-gSTALL_PERCENT=60",
    )
    detail = sim.add_mutually_exclusive_group()
    detail.add_argument("-v", "--verbose", action="store_true", help="print the tools' output as it appears")
    detail.add_argument("-q", "--quiet", action="store_true", help="print only the verdict and errors")


def _sim(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.builds.setup.simulation import Wishes, simulation

    core, folder = core_named(arguments.system)
    wishes = Wishes(arguments.tool or "", arguments.seed, arguments.waves, arguments.options)
    chosen = simulation(core, folder, wishes)
    with Progress("checking", is_shown=not arguments.quiet):
        loaded = check_core_file(chosen.core_file, chosen.build.target, may_run=True)
    report = _run(chosen, is_verbose=arguments.verbose, is_quiet=arguments.quiet)
    if not report.verdict:
        if not arguments.verbose:
            print_errors(chosen.build, folder, loaded)
        missed = "run to its end" if report.title else "begin"
        fail(f"the simulation did not {missed}", hint=f"the whole output: {shown(chosen.build.log)}")
    if not arguments.quiet:
        if not arguments.verbose:
            _print_report(chosen, report, loaded)
        print(f"log:   {shown(chosen.build.log)}")
        if chosen.waves:
            print(f"waves: {shown(chosen.waves)}")
    print(coloured(report.verdict, is_good=report.is_good), flush=True)
    if not report.is_good or report.status:
        sys.exit(1)


def _run(chosen: Simulation, *, is_verbose: bool, is_quiet: bool) -> Report:
    """Run a simulation, and print its output or show its progress."""
    with Progress("building", is_shown=not (is_verbose or is_quiet)) as progress:

        def tell(line: str, report: Report) -> None:
            if is_verbose:
                print(line, flush=True)
            elif not report.title:
                progress.step(f"building: {line}")
            else:
                progress.step(f"simulating: {len(report.messages)} of {_sent(chosen.build.work_root)} messages")

        return chosen.run(tell)


@cache
def _sent(work_root: Path) -> int:
    """Return the number of messages that a simulation in this folder sends."""
    text = (work_root / "stimulus.txt").read_text(encoding="ascii")
    return sum(line.startswith(">") for line in text.splitlines())


def _print_report(chosen: Simulation, report: Report, loaded: LoadedSystem | None) -> None:
    from fusesoc_firm.runs.simulation.answers import read_answers, software_answers, surplus

    answers: Sequence[Answer] = []
    software: Mapping[int, Sequence[Answer]] = {}
    if loaded:
        system = loaded.system
        answers = read_answers(chosen.build.work_root, system.subscribers, system.publishers, system.id_bytes)
        software = software_answers(chosen.build.work_root, system)
    print(f"{chosen.build.core} in {SIMULATORS[chosen.simulator].title}, {report.title}")
    print_messages(report, answers, software, shown(chosen.build.log))
    for line in _with_fields(chosen, report.faults, answers, loaded):
        print(coloured(line, is_good=False))
    if loaded:
        for line in surplus(chosen.build.work_root, loaded.system.publishers, loaded.system.id_bytes):
            print(coloured(line, is_good=False))
    for line in report.summary:
        print(line)


def _with_fields(
    chosen: Simulation, faults: Sequence[str], answers: Sequence[Answer], loaded: LoadedSystem | None
) -> list[str]:
    """Return the faults with the fields of wrong bytes and, if they are known, with the values and causes."""
    from fusesoc_firm.runs.simulation.answers import with_values
    from fusesoc_firm.runs.simulation.host_files import NO_BLOCK, with_field
    from fusesoc_firm.runs.simulation.stalls import stall

    paths = [chosen.build.work_root / name for name in ("stimulus.txt", "expected.txt")]
    if loaded is None or not all(path.is_file() for path in paths):
        return [*faults]
    sent, expected = (path.read_text(encoding="ascii") for path in paths)
    system = loaded.system
    topics = system.subscribers, system.publishers
    stalled = stall(faults, answers, sent, expected)
    reason = stalled.reason if stalled else NO_BLOCK
    lines = []
    for fault in with_values(faults, answers, system.id_bytes):
        lines.append(with_field(fault, (sent, expected), topics, system.id_bytes, reason))
        if stalled and fault.startswith(stalled.fault):
            lines += [f"      = {note}" for note in stalled.notes(system, chosen.build.core)]
    return lines


def print_messages(
    report: Report, answers: Sequence[Answer], software: Mapping[int, Sequence[Answer]], log: str
) -> None:
    """Print a table of messages: cycles from the first beat in, latency, message and responses, also of `software`.

    The table contains the first messages, and the first ones with a wrong response, which have a mark. The responses
    are those that the model expects; a wrong value is followed by the received one.
    """
    from fusesoc_firm.cli.message_table import row, with_answers

    messages = [*with_answers(report.messages, answers)]
    wrong = [(item, own) for item, own in messages[_MOST_MESSAGES:] if item.is_wrong][:_MOST_MESSAGES]
    width = max((terminal_width() - 26) // 2, _NARROWEST // 2)
    responses = "received" if report.is_good else "expected"
    print(f"{'message':>7}  {'cycles':>6}  {'latency':>7}  {'sent':{width}}  {responses}")
    for item, own in (*messages[:_MOST_MESSAGES], *wrong):
        # They are unknown without a response, and for one that came before its message.
        cycles, latency = ("", "") if item.cycles < 0 else (str(item.cycles), str(item.latency))
        sent, *received = row(item, [*own, *software.get(item.number, ())], width)
        number = f"{_WRONG if item.is_wrong else ''}{item.number}"
        line = f"{number:>7}  {cycles:>6}  {latency:>7}  {sent:{width}}  {received[0]}"
        print(coloured(line, is_good=False) if item.is_wrong else line)
        for further in received[1:]:
            print(f"{'':{26 + width}}{further}")
    if (more := len(messages) - _MOST_MESSAGES - len(wrong)) > 0:
        print(f"    ... {more} more in {log}")
