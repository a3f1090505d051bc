"""`firm emulate`: run a system's program for a processor on an emulated board, in front of the simulated hardware."""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import add_sources, add_spec, command, core_folders, positive, print_step, print_warnings
from fusesoc_firm.text.diagnostics import fail

if TYPE_CHECKING:
    from fusesoc_firm.runs.emulation.emulated_run import Emulation, Report

_MOST_FAULTS = 30
_PATIENCE_SECONDS = 60


def add_emulate(commands: Any) -> None:
    """Declare the command."""
    emulate = command(
        commands,
        "emulate",
        "run a system's program in C on an emulated Zynq, connected to the pins of the simulated hardware",
        "firm emulate robot.yaml",
        _emulate,
    )
    add_spec(emulate)
    emulate.add_argument(
        "--processor",
        choices=("zynq7000", "zynqmp"),
        default="zynq7000",
        help="a Cortex-A9 of a Zynq-7000 or a Cortex-A53 of a Zynq UltraScale+ (default: %(default)s)",
    )
    emulate.add_argument(
        "--freertos", type=Path, metavar="DIR", help="run FreeRTOS, whose kernel is in DIR (default: bare metal)"
    )
    emulate.add_argument("--stimuli", type=Path, metavar="F", help="messages to send (default: those of the core)")
    emulate.add_argument("--model", type=Path, metavar="F.py", help="the responses' model (default: that of the core)")
    emulate.add_argument(
        "--patience",
        type=positive,
        default=_PATIENCE_SECONDS,
        metavar="S",
        help="give up after S seconds in which nothing moves (default: %(default)s)",
    )
    emulate.add_argument(
        "--build-root", type=Path, metavar="DIR", help="folder for the build (default: a folder in the user's cache)"
    )
    detail = emulate.add_mutually_exclusive_group()
    detail.add_argument("-v", "--verbose", action="store_true", help="print all that the program writes to its console")
    detail.add_argument("-q", "--quiet", action="store_true", help="print only the verdict and faults")
    add_sources(emulate)


def _emulate(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.node.transport.built_simulator import CoreSources, build_simulator
    from fusesoc_firm.node.transport.simulator import Simulator
    from fusesoc_firm.runs.emulation.emulated_run import Emulation
    from fusesoc_firm.runs.emulation.messages import emulated_traffic, load_emulated
    from fusesoc_firm.runs.emulation.program import PROCESSORS, Kernel, compile_player
    from fusesoc_firm.system.message_sources import sources_of
    from fusesoc_firm.system.scaffold.core_file import EMULATING
    from fusesoc_firm.tools.programs import missing, ways

    processor = PROCESSORS[arguments.processor]
    if absent := missing([processor.compiler, processor.emulator]):
        fail(f"missing programs: {', '.join(absent)}", hint="; ".join(map(ways, absent)))
    kernel = Kernel(arguments.freertos)
    kernel.check(processor)
    spec: Path = arguments.spec
    loaded = load_emulated(spec, sources_of(spec, arguments.path, arguments.distro, core_folders), core_folders)
    print_warnings(loaded.warnings)
    traffic = emulated_traffic(spec, loaded, {"stimuli": arguments.stimuli, "model": arguments.model})
    detail = Detail(is_quiet=arguments.quiet, is_verbose=arguments.verbose, expected=len(traffic.responses))
    detail.tell("building the hardware")
    sources = CoreSources(arguments.path, arguments.distro or "", core_folders=core_folders)
    built = build_simulator(spec, EMULATING, build_root=arguments.build_root, sources=sources, target="emulate")
    emulation = Emulation(
        compile_player(loaded.system, kernel, processor, built.folder),
        processor,
        lambda: Simulator([*built.command(), "+RAW=true"], built.folder),
        traffic,
        loaded.system,
        arguments.patience,
        detail.receive,
    )
    begin = time.monotonic()
    report = emulation.run()
    detail.tell("")
    if not arguments.quiet:
        _print_counts(
            report,
            emulation,
            f"{loaded.system.name} on {kernel.title} ({processor.name}), in {time.monotonic() - begin:.1f} s",
        )
    _print_verdict(report, emulation)


@dataclass(frozen=True)
class Detail:
    """The output about a run with `expected` responses; the progress is shown only at a terminal."""

    is_quiet: bool
    is_verbose: bool
    expected: int

    def tell(self, step: str) -> None:
        """Show the progress."""
        if sys.stderr.isatty() and not (self.is_quiet or self.is_verbose):
            print_step(step)

    def receive(self, line: str, count: int) -> None:
        """Print a line of the console, or show the number of received messages."""
        if self.is_verbose:
            print(line, flush=True)
        self.tell(f"{count} of {self.expected} messages received")


def _print_counts(report: Report, emulation: Emulation, title: str) -> None:
    sent, expected = len(emulation.traffic.stimuli), len(emulation.traffic.responses)
    print(f"{title}: {sent} messages sent, {len(report.frames)} of {expected} received")
    if report.counts:
        print(f"counts of the program: {', '.join(f'{name} {count}' for name, count in report.counts.items())}")
    for line in report.other_lines:
        print(f"the console printed: {line}")


def _print_verdict(report: Report, emulation: Emulation) -> None:
    """Print the faults and the verdict; raise `InputError` if it is not good."""
    expected = len(emulation.traffic.responses)
    found = emulation.faults(report)
    for line in found[:_MOST_FAULTS]:
        print(line)
    if len(found) > _MOST_FAULTS:
        print(f"and {len(found) - _MOST_FAULTS} more faults")
    if report.fault or found:
        fail(report.fault or "the messages differ from those of the model")
    print(f"PASS {expected}/{expected}")
