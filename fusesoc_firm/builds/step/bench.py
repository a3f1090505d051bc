"""The kinds of benches: what a run needs from us, and by which rule its verdict is found.

docs/reference/verdicts.md describes the rules. Edalize's EDAM, which FuseSoC's setup wrote, selects the kind.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from fusesoc_firm.builds.step.plain_bench import PlainBench, plain_bench
from fusesoc_firm.builds.step.report import fault_in

# The simulators of Edalize's tool interface.
SIMULATORS = frozenset("ghdl icarus isim modelsim questaformal rivierapro vcs verilator vunit xcelium xsim".split())
_REPORT = "results.xml"
_SEED = "1"
_MODES_WITHOUT_RUN = frozenset("lint-only preprocess-only dpi-hdr-only xml-only".split())


class Bench(Protocol):
    """A bench before, during and after its run in the current folder, if there is a run at all."""

    has_run: bool

    def prepare(self) -> None:
        """Prepare the run, before Edalize reads the EDAM."""

    def see(self, line: str) -> None:
        """Take note of a printed line."""

    def verdict(self) -> str:
        """Return why the test has not passed although the run succeeded, or an empty text."""


@dataclass
class NoBench:
    """The run of a target that does not simulate: its exit status is the verdict."""

    has_run: bool = True

    def prepare(self) -> None:
        """Nothing is needed."""

    def see(self, line: str) -> None:
        """Ignore a printed line."""

    def verdict(self) -> str:
        """Return an empty text."""
        return ""


@dataclass
class Reported(NoBench):
    """A bench with a runner that writes a report; `options` are the runner's, to which that of the report is added."""

    options: list[str] = field(default_factory=list)
    option: str = ""

    def prepare(self) -> None:
        """Request the report."""
        Path(_REPORT).unlink(missing_ok=True)
        if self.option:
            self.options.append(f"{self.option}={_REPORT}")

    def verdict(self) -> str:
        """Return what the report says."""
        return fault_in(Path(_REPORT))


@dataclass
class Cocotb(Reported):
    """A bench of cocotb 1 or 2."""

    def prepare(self) -> None:
        """Set the variables that Edalize does not set: without GPI_USERS, cocotb 2.1 runs no test."""
        super().prepare()
        os.environ["COCOTB_RESULTS_FILE"] = _REPORT
        if not shutil.which("cocotb-config"):
            raise RuntimeError("the program 'cocotb-config' is not installed: pip install cocotb")
        # The result of a step must follow from its inputs, to which these variables belong.
        seed = "RANDOM_SEED" if _config("--version").startswith("1.") else "COCOTB_RANDOM_SEED"
        os.environ.setdefault(seed, os.environ.get("RANDOM_SEED", _SEED))
        if "GPI_USERS" not in os.environ and (entry := _config("--pygpi-entry-point")):
            os.environ["GPI_USERS"] = f"{_config('--libpython')};{entry}"


@dataclass
class Plain:
    """A bench without a runner; `options` are those of its tool."""

    bench: PlainBench
    tool: str
    options: dict[str, Any]
    has_run: bool = True

    def prepare(self) -> None:
        """Let Icarus Verilog fail at `$stop`, like Verilator, unless the bench prints that it passed."""
        if self.tool == "icarus" and self.bench.has_stop and not self.bench.passes_with:
            self.options["vvp_options"] = [*self.options.get("vvp_options", ()), "-N"]

    def see(self, line: str) -> None:
        """Take note of a printed line."""
        self.bench.see(line)

    def verdict(self) -> str:
        """Return what the printed lines and the sources show."""
        return self.bench.verdict()


def bench_of(api: str, name: str, edam: dict[str, Any]) -> Bench:
    """Return the bench of a build whose `api` is `flow` or `tool`, with the flow's or tool's name.

    Raise `RuntimeError` if an option is not legal.
    """
    options = edam.setdefault("flow_options", {}) if api == "flow" else _options_of_tool(edam, name)
    tool = str(options.get("tool", "")) if api == "flow" else name
    if options.get("mode") in _MODES_WITHOUT_RUN and tool == "verilator":
        return NoBench(has_run=False)
    if name != "sim" if api == "flow" else name not in SIMULATORS:
        return NoBench()
    if options.get("cocotb_module"):
        return Cocotb()
    if tool == "pytest":
        return Reported()
    if tool == "vunit":
        return Reported(options=options.setdefault("vunit_options", []), option="--xunit-xml")
    return Plain(plain_bench(edam, options, Path()), tool, options)


def _options_of_tool(edam: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = edam.setdefault("tool_options", {}).setdefault(name, {})
    return found


def _config(option: str) -> str:
    """Return what cocotb-config prints, or an empty text if this version does not know the option."""
    done = subprocess.run(["cocotb-config", option], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""
