"""`firm sim`: simulate a system, and print the result, the messages and the files to look at."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import (
    check_sources,
    coloured,
    command,
    core_folders,
    natural,
    print_step,
    print_warnings,
    terminal_width,
)
from fusesoc_firm.text.diagnostics import InputError, fail
from fusesoc_firm.text.outputs import shown

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.simulation import Report, Simulation
    from fusesoc_firm.runs.simulation.answers import Answer
    from fusesoc_firm.system.system_core import LoadedSystem
    from fusesoc_firm.text.diagnostics import SourceRef

_MOST_MESSAGES, _MOST_LINES = 10, 30
_NARROWEST = 60
# The mark before the number of a message with a wrong response.
_WRONG = "!"
# GHDL's errors begin with a place only.
_ERROR = re.compile(r"(?:\b|:)error\b|\(assertion failure\)|^Traceback|^\S+:\d+:\d+: ", re.IGNORECASE)
# Lines of FuseSoC, Edalize and make around the message of the tool that failed.
_NOISE = re.compile(
    r"(INFO|WARNING): |make(\[\d+\])?: |ERROR: (Failed to (build|run)|Setup failed|.* exited with an error)|far: "
    r"|(Entering|Leaving) directory |\S+ -m fusesoc_firm\.cli tool "
)
# A place in a file that FuseSoC copied into the build folder.
_COPY = re.compile(r"(?<!\S)src/[^/\s]+/(?P<path>[^\s:]+):(?P<line>\d+)\b")


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
    sim.add_argument("--tool", choices=("ghdl", "icarus", "verilator"), help="the simulator (default: the core's)")
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

    core, folder = _core(arguments.system)
    wishes = Wishes(arguments.tool or "", arguments.seed, arguments.waves, arguments.options)
    chosen = simulation(core, folder, wishes)
    loaded = _checked(chosen)
    report = _run(chosen, is_verbose=arguments.verbose, is_quiet=arguments.quiet)
    if not report.verdict:
        if not arguments.verbose:
            _print_errors(chosen, folder, loaded)
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


def _checked(chosen: Simulation) -> LoadedSystem | None:
    """Return the simulated system, of which the accelerators have been checked. Raise `InputError` with their faults.

    For other faults in the specification, which the simulation reports, the result is None.
    """
    from fusesoc_firm.system.message_sources import load_beside, spec_of

    try:
        spec = spec_of(chosen.core_file)
        loaded = load_beside(Path(shown(spec)), core_folders=core_folders) if spec else None
    except InputError:
        return None
    if spec and loaded:
        print_warnings(check_sources(loaded, spec))
    return loaded


def _run(chosen: Simulation, *, is_verbose: bool, is_quiet: bool) -> Report:
    """Run a simulation, and print its output or, at a terminal, its progress."""
    is_progress = sys.stderr.isatty() and not (is_verbose or is_quiet)

    def tell(line: str, report: Report) -> None:
        if is_verbose:
            print(line, flush=True)
        elif is_progress:
            step = f"simulating: {len(report.messages)} messages" if report.title else f"building: {line}"
            print_step(step)

    report = chosen.run(tell)
    if is_progress:
        print_step("")
    return report


def _core(system: str | None) -> tuple[str, Path | None]:
    """Return the name of a system's core, and the folder of its file, if known. May raise `InputError`."""
    from fusesoc_firm.builds.setup.simulation import core_name
    from fusesoc_firm.system.message_sources import core_of

    if system is None:
        found = {path: name for path in sorted(Path().glob("*.core")) if (name := core_name(path, is_system=True))}
        if len(found) != 1:
            names = " or ".join(map(str, found)) or "no .core file with a system"
            fail(f"which system? This folder has {names}", hint="name a specification or a core, or run 'firm init'")
        return found.popitem()[1], Path()
    path = Path(system)
    if path.suffix not in (".yaml", ".yml", ".core"):
        return system, None
    if not path.is_file():
        fail(f"there is no file {path}")
    if path.suffix == ".core":
        return core_name(path), path.parent
    core = core_of(path)
    if core is None:
        fail(f"no core for {path} is beside it", hint=f"write it: firm system core {path}")
    return str(core.data.get("name", "")), path.parent


def _print_errors(chosen: Simulation, folder: Path | None, loaded: LoadedSystem | None) -> None:
    """Print the lines of the log from the first error on, or its last lines.

    Copies are named after their originals. A line of a generated file is followed by its line of the specification.
    """
    lines = [line for line in chosen.build.log.read_text(encoding="utf-8").splitlines() if not _NOISE.match(line)]
    first = next((number for number, line in enumerate(lines) if _ERROR.search(line)), max(0, len(lines) - _MOST_LINES))
    here = f"{Path.cwd().resolve()}/"
    for line in (text.removeprefix(here) for text in lines[first : first + _MOST_LINES]):
        place = _COPY.search(line)
        original = _original(place, chosen.build.work_root, folder) if place else None
        named = (
            f"{line[: place.start()]}{original}:{place['line']}{line[place.end() :]}" if place and original else line
        )
        print(named, file=sys.stderr)
        if place and not original and loaded and (source := _origin(place, chosen.build.work_root, loaded)):
            print(f"      = this generated line belongs to {source}", file=sys.stderr)


def _original(copy: re.Match[str], work_root: Path, folder: Path | None) -> Path | None:
    """Return the path of the user's file with the content of a copy."""
    parts = Path(copy["path"]).parts
    content = _content(copy, work_root)
    for number in range(len(parts) if folder and content is not None else 0):
        path = Path(folder or "", *parts[number:])
        if path.is_file() and path.read_bytes() == content:
            return path
    return None


def _content(copy: re.Match[str], work_root: Path) -> bytes | None:
    path = work_root / copy[0].rpartition(":")[0]
    return path.read_bytes() if path.is_file() else None


def _origin(copy: re.Match[str], work_root: Path, loaded: LoadedSystem) -> SourceRef | None:
    from fusesoc_firm.accelerator.origin import origin

    lines = (_content(copy, work_root) or b"").decode(errors="replace").splitlines()
    return origin(loaded, Path(copy["path"]).stem, lines, int(copy["line"]))


def _print_report(chosen: Simulation, report: Report, loaded: LoadedSystem | None) -> None:
    from fusesoc_firm.runs.simulation.answers import read_answers
    from fusesoc_firm.tools.simulators import SIMULATORS

    answers: Sequence[Answer] = []
    if loaded:
        system = loaded.system
        answers = read_answers(chosen.build.work_root, system.subscribers, system.publishers, system.id_bytes)
    print(f"{chosen.build.core} in {SIMULATORS[chosen.simulator].title}, {report.title}")
    _print_messages(report, answers)
    for line in _with_fields(chosen, report.faults, answers, loaded):
        print(coloured(line, is_good=False))
    for line in report.summary:
        print(line)


def _with_fields(
    chosen: Simulation, faults: Sequence[str], answers: Sequence[Answer], loaded: LoadedSystem | None
) -> list[str]:
    """Return the faults with the fields of wrong bytes and, if they are known, with the values."""
    from fusesoc_firm.runs.simulation.answers import with_values
    from fusesoc_firm.runs.simulation.host_files import with_field

    paths = [chosen.build.work_root / name for name in ("stimulus.txt", "expected.txt")]
    if loaded is None or not all(path.is_file() for path in paths):
        return [*faults]
    sent, expected = (path.read_text(encoding="ascii") for path in paths)
    system = loaded.system
    topics = system.subscribers, system.publishers
    lines = with_values(faults, answers, system.id_bytes)
    return [with_field(line, (sent, expected), topics, system.id_bytes) for line in lines]


def _print_messages(report: Report, answers: Sequence[Answer]) -> None:
    """Print a table of messages: cycles from the first beat in, latency, message and responses.

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
        cycles, latency = (
            "" if value < 0 and not item.received else str(value) for value in (item.cycles, item.latency)
        )
        sent, *received = row(item, own, width)
        number = f"{_WRONG if item.is_wrong else ''}{item.number}"
        line = f"{number:>7}  {cycles:>6}  {latency:>7}  {sent:{width}}  {received[0]}"
        print(coloured(line, is_good=False) if item.is_wrong else line)
        for further in received[1:]:
            print(f"{'':{26 + width}}{further}")
    if (more := len(messages) - _MOST_MESSAGES - len(wrong)) > 0:
        print(f"    ... {more} more in the log")
