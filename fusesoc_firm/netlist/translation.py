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
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from fusesoc_firm.netlist import dump, lost_constants, verilog
from fusesoc_firm.netlist.corrections import correct, doubts, places_of
from fusesoc_firm.netlist.model import LostRegisterError, Module, Modules, NetlistError
from fusesoc_firm.netlist.sources import is_resize, of_signed, subtractions_from_integers
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

_GULP = 1 << 20
_PAUSE = 0.005

# GHDL's option for that; it loses registers of which it wanted to make memories.
_NO_MEMORIES = "-dm"
_WITHOUT_MEMORIES = (
    "; GHDL loses a register that is written by a dynamic index and read by a constant one. So all memories of this "
    "netlist are registers; read that one by dynamic indices alone, or write it by constant ones, to get memories."
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
    ghdl = _Ghdl(translation, folder)
    for library, files in translation.libraries.items():
        if files:
            ghdl.run("-i", f"--work={library}", *files)
    ghdl.run("-m", f"--work={translation.library}", translation.unit)
    try:
        netlist, warnings = _netlist(ghdl)
    except LostRegisterError as error:
        if _NO_MEMORIES in translation.options:
            raise
        ghdl = _Ghdl(replace(translation, options=[*translation.options, _NO_MEMORIES]), folder)
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
    lost_constants.check(modules, chain.from_iterable(ghdl.translation.libraries.values()))
    resized = {place for place in places_of(modules, "$strunc") if is_resize(place)}
    correct(modules, ghdl.swapped(places_of(modules, "$sub")), resized)
    return _HEADER + verilog.write(modules, generics) + _FOOTER, "\n".join(
        filter(None, [_other_warnings(warnings), *doubts(modules)])
    )


@dataclass(frozen=True)
class _Ghdl:
    """GHDL with the options that all its commands share."""

    translation: Translation
    folder: Path

    def run(self, command: str, *arguments: str) -> tuple[str, str]:
        """What it prints on its two streams."""
        options = [f"--std={self.translation.std}", f"--workdir={self.folder}", f"-P{self.folder}"]
        with (
            tempfile.TemporaryFile() as errors,
            subprocess.Popen(["ghdl", command, *options, *arguments], stdout=subprocess.PIPE, stderr=errors) as process,
        ):
            assert process.stdout
            printed = _gulps(process.stdout.fileno()).decode("latin-1")
            process.wait()
            errors.seek(0)
            said = errors.read().decode("latin-1")
        if process.returncode:
            raise NetlistError(_errors(printed + said))
        return printed, said

    def swapped(self, places: Iterable[str]) -> set[str]:
        """Among places of subtractions, those of `integer - signed`."""
        files = {place.rsplit(":", 2)[0] for place in places}
        found: set[str] = set()
        for library, names in self.translation.libraries.items():
            analyse = partial(self.messages, "-s", f"--work={library}")
            for file in sorted(files & set(of_signed(names))):
                (index,) = self.folder.glob(f"{library}-obj*.cf")
                text = index.read_text(encoding="latin-1")
                found.update(subtractions_from_integers(file, text, analyse, self.folder))
        return found

    def messages(self, command: str, *arguments: str | Path) -> str:
        """The errors that it reports; none if it succeeds."""
        try:
            self.run(command, *map(str, arguments))
        except NetlistError as error:
            return str(error)
        return ""

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
