"""All VHDL of a build to one Verilog netlist, by GHDL's synthesis.

Nothing is left of an earlier run, the netlist appears only when all went well, and what GHDL merely warns of ends the
translation where it means that logic is lost.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from itertools import chain
from pathlib import Path
from typing import Any

from fusesoc_firm.netlist import dump, lost_constants, verilog
from fusesoc_firm.netlist.corrections import correct, doubts
from fusesoc_firm.netlist.model import LostMemoryError, Module, Modules, NetlistError
from fusesoc_firm.netlist.sources import LIBRARY, Copies, use_numbers
from fusesoc_firm.tools.launcher import starts_everything
from fusesoc_firm.tools.programs import explanation, missing

_MODULE = r"^[ \t]*module\s+({name})\b"
_DEFINITION = re.compile(r"^module (\S+)(.*?)^endmodule", re.MULTILINE | re.DOTALL)
_GENERIC_MAP = re.compile(r"^  \S+ #\(\n(.*?)\)\n +(\S+) \($", re.MULTILINE | re.DOTALL)
_GENERIC = re.compile(r"^ +\.(\w+)\((.*?)\),?$", re.MULTILINE)
# GHDL compares with bounds that a number cannot leave, and puts what is in no loop into one vector; a module may have
# ports that a message has in another ROS version only. A linter is to look at what people wrote.
_WAIVED = ("CMPCONST", "UNSIGNED", "UNOPTFLAT", "PINMISSING")
_HEADER = "\n".join(
    [
        "// Generated from VHDL by GHDL; edit the VHDL instead.",
        *(f"// verilator lint_off {word}" for word in _WAIVED),
        "",
    ]
)
_FOOTER = "".join(f"// verilator lint_on {word}\n" for word in _WAIVED)
# What GHDL says of logic that is not there afterwards; the words are those of its sources.
_LOST = re.compile(r"latch|no assignment for|multiple assignments|never assigned and has no default")

_CRASH = "GHDL Bug occurred"
# Where GHDL 2.0 crashes, and what it was given.
_CRASHES = {
    "netlists-builders.adb:929": "\nIs there an integer whose range has one number, such as `range 0 to N - 1` with "
    "N = 1? It has no bits, which GHDL does not expect.",
    **dict.fromkeys(
        ("netlists.adb:774", "STORAGE_ERROR"),
        "\nGHDL 2.0 does so where a table of it grows while some bits of a signal are assigned. That depends on how "
        "many assignments there are before it: one more or less, or another order of processes, avoids it.",
    ),
}
_OF_MEMORIES = "netlists-memories.adb"

# GHDL 2.0 reads and writes where a table was before it grew: an assignment to some bits of a signal may be lost. If the
# C library overwrites memory that is given back, it crashes instead of making a wrong netlist.
_MEMORY = {"MALLOC_PERTURB_": "165"}

_GULP = 1 << 20
_PAUSE = 0.005

# GHDL's option for that; it loses registers of which it wanted to make memories.
_NO_MEMORIES = "-dm"
_WITHOUT_MEMORIES = (
    "; GHDL loses a register that is written by a dynamic index and read by a constant one, and crashes at some "
    "memories. So all memories of this netlist are registers; read such a register by dynamic indices alone, or write "
    "it by constant ones, to get memories."
)


@dataclass(frozen=True)
class Translation:
    """What to translate: VHDL files by library in any order, the unit on top, `[library.]unit`, and its generics.

    `verilog` are the sources that may hold the modules of components without an entity; they are linked later.
    `programs` are those that take the netlist, as far as they are known: nobody waits for it if they are not there. All
    paths are relative to the current folder.
    """

    top: str
    output: str
    libraries: Mapping[str, Sequence[str]]
    generics: Mapping[str, str]
    verilog: Sequence[str] = ()
    std: str = "93"
    options: Sequence[str] = ()
    programs: Sequence[str] = ()

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
    if absent := missing(["ghdl", *(translation.programs if starts_everything() else ())]):
        raise NetlistError(explanation(absent))
    output = Path(translation.output)
    output.unlink(missing_ok=True)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    ghdl = _Ghdl(translation, folder, Copies(folder / "copies"))
    if is_copied := use_numbers(chain.from_iterable(translation.libraries.values())):
        ghdl.run("-a", f"--work={LIBRARY}", str(ghdl.copies.write_package()))
    for library, files in translation.libraries.items():
        if files:
            ghdl.run("-i", f"--work={library}", *(ghdl.copies.copy(files) if is_copied else files))
    ghdl.run("-m", f"--work={translation.library}", translation.unit)
    try:
        netlist, warnings = _netlist(ghdl)
    except LostMemoryError as error:
        if _NO_MEMORIES in translation.options:
            raise
        ghdl = replace(ghdl, translation=replace(translation, options=[*translation.options, _NO_MEMORIES]))
        netlist, warnings = _netlist(ghdl)
        warnings = f"{error.args[0].replace('error', 'warning', 1)}{_WITHOUT_MEMORIES}\n{warnings}"
    part = output.with_name(f"{output.name}.part")
    part.write_text(netlist, encoding="utf-8")
    part.replace(output)
    return warnings


def _netlist(ghdl: _Ghdl) -> tuple[str, str]:
    """The netlist in Verilog, and what GHDL warns of that is of interest."""
    text, warnings = ghdl.synthesise("dump")
    lost = [line for line in warnings.splitlines() if _LOST.search(line)]
    if lost:
        raise NetlistError(
            "\n".join([*lost, "error: GHDL drops this, so the hardware would not do what the VHDL says"])
        )
    modules = dump.read(text)
    components = _components(modules, ghdl.translation.verilog)
    # The dump has all but these.
    generics = _generics(ghdl.synthesise("verilog")[0]) if any(module.parameters for module in components) else {}
    doubt = ghdl.check_constants(lost_constants.widths(modules))
    correct(modules)
    return _HEADER + verilog.write(modules, generics) + _FOOTER, "\n".join(
        filter(None, [_other_warnings(warnings), doubt, *doubts(modules)])
    )


@dataclass(frozen=True)
class _Ghdl:
    """GHDL with the options that all its commands share."""

    translation: Translation
    folder: Path
    copies: Copies

    def run(self, command: str, *arguments: str) -> tuple[str, str]:
        """What it prints on its two streams."""
        options = [f"--std={self.translation.std}", f"--workdir={self.folder}", f"-P{self.folder}"]
        with (
            tempfile.TemporaryFile() as errors,
            subprocess.Popen(
                ["ghdl", command, *options, *arguments],
                stdout=subprocess.PIPE,
                stderr=errors,
                env={**os.environ, **_MEMORY},
            ) as process,
        ):
            assert process.stdout
            printed = _gulps(process.stdout.fileno()).decode("latin-1")
            process.wait()
            errors.seek(0)
            said = errors.read().decode("latin-1")
        if process.returncode:
            error = _errors(self.copies.original(printed + said))
            raise LostMemoryError(error) if _OF_MEMORIES in error else NetlistError(error)
        return self.copies.original(printed), self.copies.original(said)

    def check_constants(self, widths: set[int]) -> str:
        """A warning if GHDL cannot be asked for constants.

        Raises `NetlistError` if it makes zero of one of these widths, in bits.
        """
        if not widths:
            return ""
        folder = self.folder / "probes"
        folder.mkdir(exist_ok=True)
        copies = lost_constants.Copies(chain.from_iterable(self.translation.libraries.values()), folder)
        messages = doubt = ""
        if copies.has_probes:
            ghdl = replace(self, folder=folder)
            package = folder / "probes.vhd"
            package.write_text(lost_constants.PACKAGE, encoding="latin-1")
            ghdl.run("-a", f"--work={lost_constants.LIBRARY}", str(package))
            try:
                messages = ghdl.probed(copies)
            except NetlistError as error:
                doubt = lost_constants.doubt(widths, str(error))
        lost_constants.refuse(list(copies.lost(messages, widths)))
        return doubt

    def probed(self, copies: lost_constants.Copies) -> str:
        """What GHDL says of copies, without the probes that it does not understand. Raises `NetlistError`."""
        while True:
            written = copies.write()
            try:
                for library, files in self.translation.libraries.items():
                    for index in self.folder.glob(f"{library}-obj*.cf"):
                        index.unlink()
                    if files:
                        self.run("-i", f"--work={library}", *(written[file] for file in files))
                self.run("-m", f"--work={self.translation.library}", self.translation.unit)
                return self.synthesise("none")[1]
            except NetlistError as error:
                if not copies.drop(str(error)):
                    raise

    def synthesise(self, language: str) -> tuple[str, str]:
        """The netlist, and what GHDL says about it."""
        generics = [f"-g{name}={value}" for name, value in self.translation.generics.items()]
        library = f"--work={self.translation.library}"
        return self.run(
            "--synth", library, f"--out={language}", *self.translation.options, *generics, self.translation.unit
        )


def _gulps(pipe: int) -> bytes:
    """All that comes through a pipe. GHDL writes a word at a time; to be woken for each takes longer than its work."""
    with suppress(OSError):
        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _GULP)
    parts = []
    while part := os.read(pipe, _GULP):
        parts.append(part)
        time.sleep(_PAUSE)
    return b"".join(parts)


def _components(modules: Modules, sources: Sequence[str]) -> list[Module]:
    """The components without an entity, each of which must be a module of the Verilog, and gets its name."""
    found: dict[str, Module] = {}
    for instance in (instance for module in modules.values() for instance in module.instances):
        module = modules.get(instance.kind)
        if module is None or module.is_defined or instance.kind in found:
            continue
        if not (name := _module(module.name, sources)):
            raise instance.error(
                f"instance '{instance.name}' is of '{module.name}', which is neither an entity of this build's VHDL "
                f"nor a module of its Verilog ({', '.join(sources) or 'it has none'})"
            )
        module.name = name
        found[instance.kind] = module
    return list(found.values())


def _generics(netlist: str) -> dict[tuple[str, str], dict[str, str]]:
    """The generics of instances in GHDL's own Verilog, by the enclosing module and the instance."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for name, text in _DEFINITION.findall(netlist):
        for values, instance in _GENERIC_MAP.findall(text):
            found[name, instance] = dict(_GENERIC.findall(values))
    return found


def _module(name: str, verilog: Sequence[str]) -> str | None:
    """The name of a module as its source spells it; VHDL has forgotten the case."""
    pattern = re.compile(_MODULE.format(name=re.escape(name)), re.MULTILINE | re.IGNORECASE)
    for file in verilog:
        if found := pattern.search(Path(file).read_text(encoding="utf-8", errors="replace")):
            return found[1]
    return None


def _errors(text: str) -> str:
    """What GHDL says of an end without success, without its notes and warnings; all if there is nothing else."""
    if _CRASH in text:
        what = re.search(r"^raised (.*)", text, re.MULTILINE)
        return (
            f"error: GHDL crashed and does not say at which line of the VHDL: {what[1] if what else 'nothing is known'}"
            f"{next((hint for place, hint in _CRASHES.items() if place in text), '')}"
        )
    found = "\n".join(line for item in _messages(text) if not re.search(r":(note|warning):", item[0]) for line in item)
    return (found or text).rstrip()


def _other_warnings(text: str) -> str:
    """What GHDL warns of besides components without an entity."""
    kept = [
        item
        for item in _messages(text)
        if ":warning:" in item[0] and "is not bound" not in item[0] and "(in default configuration" not in item[0]
    ]
    return "\n".join(line for item in kept for line in item)


def _messages(text: str) -> list[list[str]]:
    """GHDL's messages: each is a line, and may be followed by the source with a caret, or by more about a crash."""
    messages: list[list[str]] = []
    for line in text.splitlines():
        if not messages or not line.startswith("  "):
            messages.append([])
        messages[-1].append(line)
    return messages
