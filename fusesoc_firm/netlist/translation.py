"""All VHDL of a build to one Verilog netlist, by GHDL's synthesis.

Nothing is left of an earlier run, the netlist appears only when all went well, and what GHDL merely warns of ends the
translation where it means that logic is lost.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

from fusesoc_firm.netlist.programs import explanation, missing_programs, needed_programs
from fusesoc_firm.netlist.repair import NetlistError, repair

_UNBOUND = re.compile(r'instance "(.*?)" of component "(.*?)" is not bound')
_MODULE = r"^[ \t]*module\s+({name})\b"
_EMPTY_MODULE = r"^module\s+({name})\b[^;]*;\s*endmodule\n*"
# GHDL compares with bounds that a number cannot leave, and puts what is in no loop into one vector; a module may have
# ports that a message has in another ROS version only. A linter is to look at what people wrote.
_WAIVED = ("CMPCONST", "UNSIGNED", "UNOPTFLAT", "PINMISSING")
_HEADER = "\n".join(
    ["// Made of VHDL by GHDL; changes belong there.", *(f"// verilator lint_off {word}" for word in _WAIVED), ""]
)
_FOOTER = "".join(f"// verilator lint_on {word}\n" for word in _WAIVED)
# What GHDL says of logic that is not there afterwards; the words are those of its sources.
_LOST = re.compile(r"latch|no assignment for|multiple assignments|never assigned and has no default")


@dataclass(frozen=True)
class Translation:
    """What to translate: VHDL files by library in any order, the unit on top, `[library.]unit`, and its generics.

    `verilog` are the sources that may hold the modules of components without an entity; they are linked later. `tool`
    takes the netlist, if it is known. All paths are relative to the current folder.
    """

    top: str
    output: str
    libraries: Mapping[str, Sequence[str]]
    generics: Mapping[str, str]
    verilog: Sequence[str] = ()
    std: str = "93"
    options: Sequence[str] = ()
    tool: str = ""

    def to_json(self) -> str:
        """A text that `from_json` reads."""
        return json.dumps({item.name: getattr(self, item.name) for item in fields(self)}, indent=2) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Translation:
        """The translation in a text of `to_json`."""
        content: dict[str, Any] = json.loads(text)
        return cls(**content)

    @property
    def unit(self) -> str:
        """The unit on top, without its library."""
        return self.top.rpartition(".")[2]

    @property
    def library(self) -> str:
        """The library of the unit on top."""
        return self.top.rpartition(".")[0] or "work"


def translator() -> list[Path]:
    """The files whose change may change a netlist, beside its sources."""
    return sorted(Path(__file__).parent.glob("*.py"))


def translate(translation: Translation, folder: Path) -> str:
    """Write the netlist, with GHDL's libraries in `folder`; the text is what GHDL warns of.

    Raises `NetlistError`; then there is no netlist.
    """
    if missing := missing_programs(needed_programs(translation.tool)):
        raise NetlistError(explanation(missing))
    output = Path(translation.output)
    output.unlink(missing_ok=True)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    ghdl = _Ghdl(translation, folder)
    for library, files in translation.libraries.items():
        if files:
            ghdl.run("-i", f"--work={library}", *files)
    ghdl.run("-m", f"--work={translation.library}", translation.unit)
    netlist, warnings = ghdl.synthesise("verilog")
    lost = [line for line in warnings.splitlines() if _LOST.search(line)]
    if lost:
        raise NetlistError(
            "\n".join([*lost, "error: GHDL drops this, so the hardware would not do what the VHDL says"])
        )
    black_boxes = _black_boxes(warnings, translation.verilog)
    vhdl, _ = ghdl.synthesise("vhdl")
    netlist = _HEADER + repair(_without(netlist, black_boxes), vhdl, translation.unit) + _FOOTER
    part = output.with_name(f"{output.name}.part")
    part.write_text(netlist, encoding="utf-8")
    part.replace(output)
    return _other_warnings(warnings)


@dataclass(frozen=True)
class _Ghdl:
    """GHDL with the options that all its commands share."""

    translation: Translation
    folder: Path

    def run(self, command: str, *arguments: str) -> tuple[str, str]:
        """What it prints on its two streams."""
        options = [f"--std={self.translation.std}", f"--workdir={self.folder}", f"-P{self.folder}"]
        done = subprocess.run(
            ["ghdl", command, *options, *arguments], capture_output=True, text=True, errors="replace", check=False
        )
        if done.returncode:
            raise NetlistError((done.stdout + done.stderr).rstrip())
        return done.stdout, done.stderr

    def synthesise(self, language: str) -> tuple[str, str]:
        """The netlist, and what GHDL says about it."""
        generics = [f"-g{name}={value}" for name, value in self.translation.generics.items()]
        library = f"--work={self.translation.library}"
        return self.run(
            "--synth", library, f"--out={language}", *self.translation.options, *generics, self.translation.unit
        )


def _black_boxes(warnings: str, verilog: Sequence[str]) -> set[str]:
    """The components without an entity, each of which must be a module; in the case that Verilog has them."""
    found: set[str] = set()
    for instance, component in set(_UNBOUND.findall(warnings)):
        name = component.strip("\\")
        if not (module := _module(name, verilog)):
            raise NetlistError(
                f"error: instance '{instance}' is of '{name}', which is neither an entity of this build's VHDL nor a "
                f"module of its Verilog ({', '.join(verilog) or 'it has none'})"
            )
        found.add(module)
    return found


def _module(name: str, verilog: Sequence[str]) -> str | None:
    """The name of a module as its source spells it; VHDL has forgotten the case."""
    pattern = re.compile(_MODULE.format(name=re.escape(name)), re.MULTILINE | re.IGNORECASE)
    for file in verilog:
        if found := pattern.search(Path(file).read_text(encoding="utf-8", errors="replace")):
            return found[1]
    return None


def _without(netlist: str, modules: set[str]) -> str:
    """A netlist without the empty modules that GHDL writes for components."""
    for name in modules:
        pattern = _EMPTY_MODULE.format(name=re.escape(name))
        netlist = re.sub(pattern, "", netlist, flags=re.MULTILINE | re.IGNORECASE)
    return netlist


def _other_warnings(text: str) -> str:
    """What GHDL warns of besides components without an entity; each warning is a line, and the source with a caret."""
    lines = text.splitlines()
    starts = [number for number, line in enumerate(lines) if re.match(r"\S+:\d+:\d+:", line)]
    warnings = [lines[start:end] for start, end in pairwise([*starts, len(lines)])]
    kept = [
        item
        for item in warnings
        if ":warning:" in item[0] and "is not bound" not in item[0] and "(in default configuration" not in item[0]
    ]
    return "\n".join(line for item in kept for line in item)
