"""Yosys with ABC, yosys-smtbmc and z3: whether the assertions of a harness hold for a netlist.

    task = Task("harness.sv", {"harness.sv": text, "netlist.v": netlist}, defines={"REQUESTERS": 4})
    outcome = task.prove(folder, depth=5)
    assert outcome.is_proved, outcome.log

The harness is SystemVerilog around the Verilog that `ghdl --synth` makes. Its assertions are named by labels. What it
declares as `(* hierconn *) wire \\dut.name ;` is the signal of that name in the netlist, and must be there.

ABC looks for traces from reset, for which it takes a tenth of z3's time; z3 makes the step of an induction.
"""

from __future__ import annotations

import os
import re
import shutil
import sysconfig
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from tests.recall import RunResult, identity, ran, recalled

# No answer by then is none.
TIMEOUT_SECONDS = 600

_SCRIPTS = Path(sysconfig.get_path("scripts"))
_MODEL = "model.smt2"
_GATES = "model.aig"
# An assertion that each trace violates in this cycle, for which there must be a trace that keeps the assumptions.
_END = """
reg [9:0] cycle_of_trace = 0;
always @(posedge clk) cycle_of_trace <= cycle_of_trace + 1;
always @* has_not_ended: assert (cycle_of_trace != {end});
"""
# What the solvers need: flip-flops of one clock, assumptions before the assertions of their cycle, and a free choice
# for what the netlist leaves open.
_FORMAL = (
    "memory_nordff",
    "async2sync",
    "chformal -assume -early",
    "chformal -live -fair -cover -remove",
    "opt_clean",
    "formalff -setundef -clk2ff -ff2anyinit",
    "setundef -undriven -anyseq",
    "opt -fast",
    "opt_clean",
    "dffunmap",
)
_WRITE_MODEL = (
    "design -save prepared",
    "chformal -assert -remove */has_not_ended",
    f"write_smt2 -wires {_MODEL}",
    "design -load prepared",
)
# As in write_smt2, what is undefined is 0, also beyond the ends of a vector.
_WRITE_GATES = (
    "setundef -zero",
    "chtype -set $shift t:$shiftx",
    "opt -fast",
    "techmap",
    "opt -fast",
    "aigmap",
    f"write_aiger -I -zinit {_GATES}",
)
_STATUS = re.compile(r"Status: (PASSED|FAILED|UNKNOWN)")
_INVARIANT = "Property proved."
_VIOLATED = re.compile(r"Output \d+ of miter \S+ was asserted in frame (\d+)|No output asserted")
_FAILED = re.compile(r"Assert failed in \S+: (\w+)")


class ProofError(Exception):
    """Yosys refused the netlist or the harness, or there was no answer in time; the text is the log."""


def is_installed() -> bool:
    """Whether all that proofs need is there."""
    return all(map(shutil.which, ("yosys", "yosys-abc", "yosys-smtbmc"))) and find_spec("z3") is not None


@dataclass(frozen=True)
class Outcome:
    """`failed` are the labels of assertions that a trace from reset violates."""

    is_proved: bool
    failed: tuple[str, ...]
    log: str


@dataclass(frozen=True)
class Task:
    """A harness, a module of the name of its file in `files`, which also holds `netlist.v` and what it includes."""

    harness: str
    files: Mapping[str, str]
    defines: Mapping[str, object] = field(default_factory=dict)

    def prove(self, folder: Path, depth: int) -> Outcome:
        """Prove all assertions by induction, which holds for all time; `folder` is empty.

        No trace from reset violates one in the first `depth` cycles, and where all hold for `depth` cycles on end,
        from whatever state, they hold in the next one.
        """
        base = self.check(folder, depth)
        if not base.is_proved:
            return base
        log = _ran(folder, ["yosys-smtbmc", "-s", "z3", "-i", "-t", str(depth), _MODEL])
        return Outcome(_status(log) == "PASSED", (), base.log + log)

    def prove_by_invariant(self, folder: Path, depth: int) -> Outcome:
        """Prove all assertions by an inductive invariant, which ABC finds (PDR) and checks; `folder` is empty.

        The traces of the first `depth` cycles from reset are checked before, so that a violated assertion is named.
        """
        base = self.check(folder, depth)
        if not base.is_proved:
            return base
        log = self._traces(folder, ("check -assert",), "orpos; scorr; pdr")
        return Outcome(_INVARIANT in log, (), base.log + log)

    def check(self, folder: Path, depth: int) -> Outcome:
        """Check all assertions in all traces of `depth` cycles from reset, after which one must go on.

        `folder` is empty.
        """
        log = self._traces(folder, ("check -assert",), f"bmc3 -F {depth + 1}", _END.format(end=depth))
        if _violated(log) == depth:
            return Outcome(True, (), log)
        log = _ran(folder, ["yosys-smtbmc", "-s", "z3", "-t", str(depth), _MODEL])
        return Outcome(False, tuple(_FAILED.findall(log)), log)

    def search(self, folder: Path, depth: int, label: str) -> Outcome:
        """Look for a trace of `depth` cycles from reset that violates one assertion; `folder` is empty."""
        assertion = f"{self._top}/{label}"
        only = (f"select -assert-count 1 {assertion}", f"chformal -assert -remove {self._top}/* {assertion} %d")
        log = self._traces(folder, only, f"bmc3 -F {depth}")
        return Outcome(False, (label,), log) if _violated(log) is not None else Outcome(True, (), log)

    @property
    def _top(self) -> str:
        return Path(self.harness).stem

    def _traces(self, folder: Path, commands: Sequence[str], engine: str, more: str = "") -> str:
        """What an engine of ABC says of all traces and the assertions that `commands` leave, and those in `more`."""
        for name, text in self.files.items():
            head, end, _ = text.rpartition("endmodule")
            (folder / name).write_text(f"{head}{more}{end}\n" if name == self.harness else text, encoding="utf-8")
        _ran(folder, ["yosys", "-q", "-p", "; ".join(self._commands(commands, _WRITE_MODEL if more else ()))])
        return _ran(folder, ["yosys-abc", "-s", "-c", f"read_aiger {_GATES}; fold; strash; {engine}"])

    def _commands(self, commands: Sequence[str], model: Sequence[str]) -> Iterator[str]:
        defines = " ".join(f"-D{name}={value}" for name, value in self.defines.items())
        yield "read_verilog netlist.v"
        yield f"read_verilog -sv -formal {defines} {self.harness}"
        yield f"hierarchy -check -top {self._top}"
        yield "proc"
        yield "memory_map"  # so that the harness can name the words of a memory
        yield f"prep -flatten -top {self._top}"
        yield from commands
        yield from _FORMAL
        yield from model
        yield from _WRITE_GATES


def _violated(log: str) -> int | None:
    """The first cycle in which ABC found a violation."""
    result = _VIOLATED.search(log)
    if not result:
        raise ProofError(log)
    return int(result[1]) if result[1] else None


def _status(log: str) -> str:
    result = _STATUS.search(log)
    if not result:
        raise ProofError(log)
    return result[1]


def _ran(folder: Path, command: Sequence[str]) -> str:
    """Run a program in a folder, or recall what it made and printed; a violation is a result, too."""

    def run() -> RunResult:
        # z3 is looked up.
        done = ran(["env", f"PATH={_SCRIPTS}:{os.environ['PATH']}", "timeout", str(TIMEOUT_SECONDS), *command], folder)
        if done.exit_code and not _STATUS.search(done.output):
            raise ProofError(done.output)
        return RunResult(0, done.output)

    versions = {"yosys": identity("yosys"), "abc": identity("yosys-abc"), "z3": metadata.version("z3-solver")}
    return recalled({"command": command, **versions}, [folder], run, left_out=_is_no_input).output


def _is_no_input(path: str) -> bool:
    """Whether Yosys does not read a file of its folder: GHDL's own and the sources of what it made."""
    return path.endswith((".cf", ".vhd"))
