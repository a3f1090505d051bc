"""Translate all VHDL files of a build to one Verilog netlist with GHDL's synthesis.

Each run removes the results of earlier runs and writes the netlist only if every step succeeds. A GHDL warning about
lost logic ends the translation with an error.
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
from collections.abc import Callable, Container, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

from fusesoc_firm.netlist import dump, ghdl2, lost_constants, probe_functions, verilog
from fusesoc_firm.netlist.corrections import correct, doubts, lost_latches
from fusesoc_firm.netlist.instantiated import Instantiated, Use, entities, module_of
from fusesoc_firm.netlist.loops import loops
from fusesoc_firm.netlist.model import GrownTableError, LostMemoryError, Module, Modules, NetlistError
from fusesoc_firm.netlist.padding import Padding
from fusesoc_firm.netlist.restored_constants import restore
from fusesoc_firm.netlist.sources import LIBRARY, Copies, use_numbers
from fusesoc_firm.tools.launcher import starts_everything
from fusesoc_firm.tools.programs import explanation, missing

_T = TypeVar("_T")

_MODULE = r"^[ \t]*module\s+({name})\b"
_DEFINITION = re.compile(r"^module (\S+)(.*?)^endmodule", re.MULTILINE | re.DOTALL)
_GENERIC_MAP = re.compile(r"^  \S+ #\(\n(.*?)\)\n +(\S+) \($", re.MULTILINE | re.DOTALL)
_GENERIC = re.compile(r"^ +\.(\w+)\((.*?)\),?$", re.MULTILINE)
# GHDL compares numbers with bounds that they cannot exceed, and packs signals that form no loop into one vector; a
# module may have ports that exist only for one ROS version of its message. A port may have a name of C++, such as
# `abort`, which Verilator renames. Linters should check only hand-written code.
_WAIVED = ("CMPCONST", "UNSIGNED", "UNOPTFLAT", "PINMISSING", "SYMRSVDWORD")
_HEADER = "\n".join(
    [
        "// Generated from VHDL by GHDL; edit the VHDL instead.",
        *(f"// verilator lint_off {word}" for word in _WAIVED),
        "",
    ]
)
_FOOTER = "".join(f"// verilator lint_on {word}\n" for word in _WAIVED)
# GHDL's messages that mean missing logic, worded as in GHDL's sources.
_LOST = re.compile(r"latch|no assignment for|multiple assignments|never assigned and has no default")

_EXPECTED = ("is not bound", "(in default configuration", "unhandled attribute")

_CRASH = "GHDL Bug occurred"
# The places where GHDL crashes, with the input that causes each crash; the line of a file is that of GHDL 2.0.
_OF_TABLES = ("netlists.adb:774", "STORAGE_ERROR")
_CRASHES = {
    "netlists-builders.adb": "\nA possible cause is an integer whose range contains only one number, such as "
    "`range 0 to N - 1` with N = 1: GHDL does not support integers without bits.",
    **dict.fromkeys(
        _OF_TABLES,
        "\nGHDL 2.0 crashes if one of its tables grows while some bits of a signal are assigned. To avoid the crash, "
        "add or remove an assignment before this place, or reorder the processes.",
    ),
}
_OF_MEMORIES = "netlists-memories.adb"

# GHDL 2.0 accesses a table's old memory after the table has grown, so an assignment to some bits of a signal may be
# lost. If the C library overwrites freed memory, GHDL crashes instead of writing a wrong netlist.
_MEMORY = {"MALLOC_PERTURB_": "165"}

# The numbers of additional assignments with which a translation is repeated after such a crash.
_PADDINGS = (0, 1, 2, 3, 5, 8, 13)

_GULP = 1 << 20
_PAUSE = 0.005

# GHDL's option that disables memory inference, which loses some registers.
_NO_MEMORIES = "-dm"
_WITHOUT_MEMORIES = (
    "; GHDL loses a register that is written with a dynamic index and read with a constant index, and crashes at some "
    "memories. Therefore, all memories in this netlist are registers. To get memories, read such a register only with "
    "dynamic indices, or write the register with constant indices."
)


@dataclass(frozen=True)
class Translation:
    """A translation: VHDL files by library, in any order, the top unit, `[library.]unit`, and the top unit's generics.

    `verilog` lists the sources that may define the modules for components without an entity; a later step links these
    sources. They may instantiate entities in turn, and one of their modules may be the top unit; `defines` are their
    macros. `programs` lists the known programs that read the netlist; if a program is missing, nothing is translated.
    If `refuses_loops` is set, a combinational loop is an error. All paths are relative to the current folder.
    """

    top: str
    output: str
    libraries: Mapping[str, Sequence[str]]
    generics: Mapping[str, str]
    verilog: Sequence[str] = ()
    std: str = "93"
    options: Sequence[str] = ()
    programs: Sequence[str] = ()
    refuses_loops: bool = False
    defines: Mapping[str, str] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return the translation as a text that `from_json` reads."""
        return json.dumps({item.name: getattr(self, item.name) for item in fields(self)}, indent=2) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Translation:
        """Return the translation in a text from `to_json`."""
        content: dict[str, Any] = json.loads(text)
        return cls(**content)

    def of(self, use: Use) -> Translation:
        """Return the translation of an entity that Verilog instantiates."""
        return replace(self, top=f"{use.entity.library}.{use.entity.name}", generics=dict(use.generics))

    @property
    def unit(self) -> str:
        """The top unit, without its library."""
        return self.top.rpartition(".")[2]

    @property
    def library(self) -> str:
        """The top unit's library."""
        return self.top.rpartition(".")[0] or "work"


def translator() -> list[Path]:
    """Return the paths of the files, other than the sources, whose changes may affect a netlist."""
    return sorted(Path(__file__).parent.glob("*.py"))


def translate(translation: Translation, folder: Path) -> str:
    """Write the netlist and return GHDL's warnings; GHDL's libraries are in `folder`.

    If there is no correct netlist, raise `NetlistError` and write none.
    """
    if absent := missing(["ghdl", *(translation.programs if starts_everything() else ())]):
        raise NetlistError(explanation(absent))
    output = Path(translation.output)
    output.unlink(missing_ok=True)
    netlist, warnings = _whole(translation, folder)
    part = output.with_name(f"{output.name}.part")
    part.write_text(f"{_HEADER}{netlist}{_FOOTER}", encoding="utf-8")
    part.replace(output)
    return warnings


def _whole(translation: Translation, folder: Path) -> tuple[str, str]:
    """Return the Verilog of the top unit and of all entities that Verilog below it instantiates, and the warnings.

    If the top unit is a module in Verilog, only the entities are translated.
    """
    known = entities(translation.libraries) if translation.verilog else {}
    found = Instantiated(known, translation.verilog, translation.defines, folder / "verilog")
    texts: dict[str, str] = {}
    warnings: list[str] = []
    roots: list[tuple[str, Mapping[str, str]]] = []
    is_vhdl = translation.unit.lower() in {name.lower() for name in known}
    if known and not is_vhdl and _module(translation.top, translation.verilog):
        roots.append((translation.top, {}))
    else:
        first = _translated(translation, folder)
        texts, roots, warnings = dict(first.texts), first.components, [first.warnings]
    translated: dict[Use, Module] = {}
    while roots:
        uses = dict.fromkeys(use for root in roots for use in found.below(*root))
        roots = []
        for use in uses:
            # A module of the netlist has the name of its entity if that has no generics.
            if use in translated or (not use.generics and use.entity.name in texts):
                continue
            part = _translated(translation.of(use), folder, f"{use.entity.name}__{len(translated)}", texts)
            translated[use] = part.top
            texts |= part.texts
            roots += part.components
            warnings.append(part.warnings)
    for entity in dict.fromkeys(use.entity for use in translated):
        if entity.name in texts:
            raise NetlistError(f"error: '{entity.name}' is below itself")
        own = {use: top for use, top in translated.items() if use.entity is entity}
        texts[entity.name] = module_of(entity, own)
    return "\n".join(texts.values()), "\n".join(dict.fromkeys(filter(None, warnings)))


def _translated(translation: Translation, folder: Path, top: str = "", taken: Container[str] = ()) -> _Part:
    """Return the netlist of the top unit; if GHDL cannot infer its memories, all of them are registers.

    `top` is another name for the top unit. Each other module whose name is `taken` gets one that begins with it.
    """

    def made(ghdl: _Ghdl) -> _Part:
        return _netlist(ghdl, top, taken)

    try:
        return _padded(made, translation, folder)
    except LostMemoryError as error:
        if _NO_MEMORIES in translation.options:
            raise
        registers = replace(translation, options=[*translation.options, _NO_MEMORIES])
        part = _padded(made, registers, folder)
        warning = f"{error.args[0].replace('error', 'warning', 1)}{_WITHOUT_MEMORIES}"
        return replace(part, warnings=f"{warning}\n{part.warnings}")


def find_loops(translation: Translation, folder: Path) -> list[str]:
    """Return a sentence for each combinational loop of a design, with GHDL's libraries in `folder`; write no netlist.

    Raises `NetlistError`.
    """
    return _padded(lambda ghdl: _loops(dump.read(ghdl.synthesise("dump")[0]), translation, folder), translation, folder)


def _loops(modules: Modules, translation: Translation, folder: Path) -> list[str]:
    """Return the loops of a design, also through its modules in Verilog, if Yosys is installed."""
    found = Instantiated({}, translation.verilog, translation.defines, folder / "verilog")
    undefined = [module.name for module in modules.values() if not module.is_defined]
    names = {name: spelt for name in undefined if (spelt := _module(name, translation.verilog))}
    outside = {name: module for name, spelt in names.items() if (module := found.elaborated(spelt))}
    return loops(modules, outside)


def _padded(made: Callable[[_Ghdl], _T], translation: Translation, folder: Path) -> _T:
    """Return the result of `made`; if a growing table makes GHDL crash, retry with other paddings."""
    crash: GrownTableError | None = None
    for assignments in _PADDINGS:
        try:
            return made(_analysed(translation, folder, Padding(translation.unit, assignments)))
        except GrownTableError as error:
            crash = crash or error
    assert crash
    raise crash


def _analysed(translation: Translation, folder: Path, padding: Padding) -> _Ghdl:
    """Return GHDL with all files in its libraries, which are in the emptied `folder`."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    has_numbers = use_numbers(chain.from_iterable(translation.libraries.values()))
    ghdl = _Ghdl(translation, folder, Copies(folder / "copies", padding, has_numbers))
    if has_numbers:
        ghdl.run("-a", f"--work={LIBRARY}", str(ghdl.copies.write_package()))
    for library, files in translation.libraries.items():
        if files:
            ghdl.run("-i", f"--work={library}", *ghdl.copies.copy(files))
    ghdl.run("-m", f"--work={translation.library}", translation.unit)
    return ghdl


@dataclass(frozen=True)
class _Part:
    """The netlist of a unit: its modules, their Verilog by name, the components' generics, and relevant warnings."""

    modules: Modules
    texts: Mapping[str, str]
    generics: Mapping[tuple[str, str], Mapping[str, str]]
    warnings: str

    @property
    def top(self) -> Module:
        return next(module for module in self.modules.values() if module.is_defined)

    @property
    def components(self) -> list[tuple[str, Mapping[str, str]]]:
        """The modules in Verilog, with each set of parameters of their instances."""
        found: list[tuple[str, Mapping[str, str]]] = []
        for module in self.modules.values():
            for instance in module.instances:
                kind = self.modules.get(instance.kind)
                if kind and not kind.is_defined:
                    root = (kind.name, self.generics.get((module.name, instance.name), {}))
                    found += [root] if root not in found else []
        return found


def _netlist(ghdl: _Ghdl, top: str, taken: Container[str]) -> _Part:
    """Return the netlist of the top unit, named as in `_translated`."""
    text, warnings = ghdl.synthesise("dump")
    lost = [line for line in warnings.splitlines() if _LOST.search(line)]
    if lost:
        raise NetlistError("\n".join([*lost, "error: GHDL drops this, so the hardware would not match the VHDL"]))
    modules = dump.read(text)
    if latches := lost_latches(modules):
        raise NetlistError("\n".join(latches))
    if ghdl.translation.refuses_loops and (sentences := _loops(modules, ghdl.translation, ghdl.folder)):
        raise NetlistError("\n".join(sentences))
    components = _components(modules, ghdl.translation.verilog)
    # The second netlist supplies the generics, which the dump lacks.
    generics = _generics(ghdl.synthesise("verilog")[0]) if any(module.parameters for module in components) else {}
    found = [_other_warnings(warnings)]
    if ghdl2.is_at_hand():
        found += [ghdl.check_constants(modules), *doubts(modules)]
    correct(modules)
    if top:
        renamed = _rename(modules, top, taken)
        generics = {(renamed.get(module, module), instance): values for (module, instance), values in generics.items()}
    return _Part(modules, verilog.write(modules, generics), generics, "\n".join(filter(None, found)))


def _rename(modules: Modules, top: str, taken: Container[str]) -> dict[str, str]:
    """Rename the modules, and return the new names by the old ones."""
    renamed: dict[str, str] = {}
    for module in modules.values():
        if module.is_defined:
            new = f"{top}__{module.name}" if module.name in taken else module.name
            renamed[module.name] = module.name = new if renamed else top
    return renamed


@dataclass(frozen=True)
class _Ghdl:
    """GHDL with the options that all commands share."""

    translation: Translation
    folder: Path
    copies: Copies

    def run(self, command: str, *arguments: str) -> tuple[str, str]:
        """Run a GHDL command; return the text on standard output and on standard error."""
        # Such as -frelaxed, without which VHDL-2008 has no shared variable of a plain type.
        of_language = [option for option in self.translation.options if option.startswith("-f")]
        options = [f"--std={self.translation.std}", f"--workdir={self.folder}", f"-P{self.folder}", *of_language]
        with (
            tempfile.TemporaryFile() as errors,
            subprocess.Popen(
                ["ghdl", command, *options, *arguments],
                stdout=subprocess.PIPE,
                stderr=errors,
                env={**os.environ, **(_MEMORY if ghdl2.is_at_hand() else {})},
            ) as process,
        ):
            assert process.stdout
            printed = _gulps(process.stdout.fileno()).decode("latin-1")
            process.wait()
            errors.seek(0)
            said = errors.read().decode("latin-1")
        if process.returncode:
            error = _errors(self.copies.original(printed + said))
            raise _kind(error)(error)
        return self.copies.original(printed), self.copies.original(said)

    def check_constants(self, modules: Modules) -> str:
        """Restore constants that GHDL replaces with zero; return a warning if GHDL cannot evaluate the constants.

        Raise `NetlistError` if some cannot be restored.
        """
        if not (widths := lost_constants.widths(modules)):
            return ""
        folder = self.folder / "probes"
        folder.mkdir(exist_ok=True)
        copies = lost_constants.Copies(chain.from_iterable(self.translation.libraries.values()), folder, widths)
        messages = doubt = ""
        if copies.has_probes:
            ghdl = replace(self, folder=folder)
            package = folder / "probes.vhd"
            package.write_text(probe_functions.package(widths), encoding="latin-1")
            ghdl.run("-a", f"--work={probe_functions.LIBRARY}", str(package))
            try:
                messages = ghdl.probed(copies)
            except NetlistError as error:
                doubt = lost_constants.doubt(widths, str(error))
        at_ports = restore(modules, copies.sources, {} if doubt else copies.values(messages))
        lost_constants.refuse(list(copies.lost(messages, widths, at_ports)))
        return doubt

    def probed(self, copies: lost_constants.Copies) -> str:
        """Return GHDL's output for the copies without the probes that GHDL rejects. May raise `NetlistError`."""
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
        """Return the netlist in GHDL's format `language`, and GHDL's messages."""
        generics = [f"-g{name}={value}" for name, value in self.translation.generics.items()]
        library = f"--work={self.translation.library}"
        return self.run(
            "--synth", library, f"--out={language}", *self.translation.options, *generics, self.translation.unit
        )


def _gulps(pipe: int) -> bytes:
    """Return all data in a pipe, read in large pieces: GHDL writes single words, and a read for each would be slow."""
    with suppress(OSError):
        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _GULP)
    parts = []
    while part := os.read(pipe, _GULP):
        parts.append(part)
        time.sleep(_PAUSE)
    return b"".join(parts)


def _components(modules: Modules, sources: Sequence[str]) -> list[Module]:
    """Return the components without an entity; each must match a Verilog module, whose name it receives."""
    found: dict[str, Module] = {}
    for instance in (instance for module in modules.values() for instance in module.instances):
        module = modules.get(instance.kind)
        if module is None or module.is_defined or instance.kind in found:
            continue
        if not (name := _module(module.name, sources)):
            raise instance.error(
                f"instance '{instance.name}' uses '{module.name}', which is neither an entity in this build's VHDL "
                f"nor a module in the build's Verilog ({', '.join(sources) or 'no modules'})"
            )
        module.name = name
        found[instance.kind] = module
    return list(found.values())


def _generics(netlist: str) -> dict[tuple[str, str], dict[str, str]]:
    """Return the generics in GHDL's own Verilog netlist, by enclosing module and instance."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for name, text in _DEFINITION.findall(netlist):
        for values, instance in _GENERIC_MAP.findall(text):
            found[name, instance] = dict(_GENERIC.findall(values))
    return found


def _module(name: str, verilog: Sequence[str]) -> str | None:
    """Return a module's name as spelt in its source, since VHDL does not preserve the case, or None."""
    pattern = re.compile(_MODULE.format(name=re.escape(name)), re.MULTILINE | re.IGNORECASE)
    for file in verilog:
        if found := pattern.search(Path(file).read_text(encoding="utf-8", errors="replace")):
            return found[1]
    return None


def _errors(text: str) -> str:
    """Return GHDL's error messages after a failure or, without error messages, all messages."""
    if _CRASH in text:
        what = re.search(r"^raised (.*)", text, re.MULTILINE)
        return (
            f"error: GHDL crashed without reporting a line of the VHDL: {what[1] if what else 'no details are known'}"
            f"{next((hint for place, hint in _CRASHES.items() if place in text), '')}"
        )
    found = "\n".join(line for item in _messages(text) if not re.search(r":(note|warning):", item[0]) for line in item)
    return (found or text).rstrip()


def _kind(error: str) -> type[NetlistError]:
    """Return the exception for one of GHDL's errors."""
    if _OF_MEMORIES in error:
        return LostMemoryError
    return GrownTableError if any(place in error for place in _OF_TABLES) else NetlistError


def _other_warnings(text: str) -> str:
    """Return GHDL's warnings, except those about components without an entity, and about attributes for other tools."""
    kept = [
        item for item in _messages(text) if ":warning:" in item[0] and not any(part in item[0] for part in _EXPECTED)
    ]
    return "\n".join(line for item in kept for line in item)


def _messages(text: str) -> list[list[str]]:
    """Return GHDL's messages, each as a line that a source line with a caret or details of a crash may follow."""
    messages: list[list[str]] = []
    for line in text.splitlines():
        if not messages or not line.startswith("  "):
            messages.append([])
        messages[-1].append(line)
    return messages
