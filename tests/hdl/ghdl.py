"""GHDL for tests: analyse VHDL, simulate, synthesise to a netlist, find latches, simulate the netlist instead.

    work = Library("firm", tmp_path)
    work.analyse(core_files("axis/package", "axis/axis", "manager/manager"))
    result = work.run("some_tb", generics={"SEED": 7})
    assert result.exit_code == 0, result.output
    work.replace_by_netlist("firm_manager", {"WIDTH": 8})      # from here on, benches see the netlist

Several libraries may share a directory; GHDL finds one beside the other.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.netlist import dump, verilog
from fusesoc_firm.netlist.model import Modules
from tests.hdl.analyses import Source, analyses_in, as_they_were
from tests.processes import limited
from tests.recall import RunResult, identity, ran, recalled

# GHDL 2.0 writes some constants of more than 32 bits to Verilog as in VHDL, where they would be texts of ASCII.
_LONG_CONSTANT = re.compile(r'"([01xzXZ]{33,})"')

_MODULE = re.compile(r"^module (\w+).*?^endmodule$", re.MULTILINE | re.DOTALL)
_MEMORY = re.compile(r"^  (?=reg (?:\[\d+:0\] )?(\w+)\[\d+:0\])", re.MULTILINE)
# In the VHDL of a memory with an attribute.
_DECLARED = b"attribute syn_ramstyle of"

REPOSITORY = Path(__file__).resolve().parents[2]
CORES = REPOSITORY / "cores"

# GHDL sets generics of these types from the command line; a real one would make no netlist.
Generic = int | str | bool

# Folders whose files a simulation does not read, such as that of `/dev/null`.
_OF_ALL = (Path("/"), Path("/dev"), Path(tempfile.gettempdir()))

_CASE = re.compile(r"\bcase\b.*?\bendcase\b", re.DOTALL)
_DEFAULT = re.compile(r"\bdefault\s*:")
_CHOICE = re.compile(r"^\s*(\d+)'b[01]+\s*:", re.MULTILINE)


class GhdlError(Exception):
    """GHDL refused the input; the text is what it printed."""


@dataclass(frozen=True)
class Library:
    """A VHDL library by its logical name and the directory in which GHDL keeps it; `standard` is "93" or "08"."""

    name: str
    directory: Path
    standard: str = "93"
    program: str = "ghdl"

    @property
    def version(self) -> str:
        """What GHDL prints of its version."""
        return subprocess.run([self.program, "--version"], capture_output=True, text=True, check=True).stdout

    def analyse(self, files: Iterable[Path], *options: str) -> None:
        """Analyse files in this order, strictly as the standard says; raise `GhdlError` on a fault.

        What GHDL is known to accept is analysed only when GHDL needs it.
        """
        analyses = analyses_in(self.directory)
        needed = analyses.add(self.name, list(files), [self.program, *self._options(), *options])
        try:
            self._recalled(needed, ["-a"], lambda: self._accept(needed))
        except GhdlError:
            analyses.forget()
            raise

    def make(self) -> None:
        """Analyse the files that are still waiting, for a test that starts GHDL itself in the directory."""
        analyses_in(self.directory).make_all(_analyse)

    def copy_to(self, folder: Path) -> None:
        """Let GHDL find what was analysed in another directory, too."""
        self.make()
        # GHDL with LLVM or GCC has object files, too.
        for file in (*self.directory.glob("*.cf"), *self.directory.glob("*.o")):
            shutil.copy(file, folder)
        analyses_in(folder).take(analyses_in(self.directory))

    def elaborate(self, entity: str) -> None:
        """Bind and elaborate `entity` and all below it, without a simulation; raise `GhdlError` on a fault.

        Files that it opens are in the library's directory.
        """
        needed = analyses_in(self.directory).sources(self.name.lower(), [entity])

        def run() -> RunResult:
            self._make(needed)
            # GHDL with LLVM or GCC writes a program, beside which may be a folder with the entity's name.
            output = [] if "mcode" in self.version else ["-o", f"{entity}.program"]
            return RunResult(0, self._ghdl("--elab-run", *output, entity, "--no-run", directory=self.directory))

        self._recalled(needed, ["--elab-run", entity], run)

    def run(
        self,
        entity: str,
        generics: Mapping[str, Generic] | None = None,
        *,
        directory: Path | None = None,
        options: Sequence[str] = (),
        seconds: float = 120,
    ) -> RunResult:
        """Simulate `entity`, which may take so many seconds of a processor, or recall what that did.

        Its files are relative to `directory` (default: the library's).
        """
        words = [entity, *_generic_options(generics), *options]
        needed = analyses_in(self.directory).sources(self.name.lower(), [entity])

        def run() -> RunResult:
            self._make(needed)
            command = [*limited(seconds), self.program, "-r", *self._options(), *words]
            return ran(command, directory or self.directory)

        # Generics and options may name files elsewhere.
        named = [Path(word.partition("=")[2]).parent for word in words if "=/" in word]
        folders = [directory or self.directory, *(place for place in named if place.is_dir() and place not in _OF_ALL)]
        return self._recalled(needed, ["-r", *words], run, folders)

    def synthesise(self, entity: str, generics: Mapping[str, Generic] | None = None, language: str = "vhdl") -> str:
        """The netlist of `entity` as `vhdl` or `verilog`; raise `GhdlError` on a fault, a latch GHDL sees included."""
        netlist = self.netlist_of_ghdl(entity, generics, language)
        if language != "verilog":
            return netlist
        sources = analyses_in(self.directory).sources(self.name.lower(), [entity])
        if any(_DECLARED in source.path.read_bytes() for source in sources):
            netlist = _with_attributes(netlist, dump.read(self.netlist_of_ghdl(entity, generics, "dump")))
        return _LONG_CONSTANT.sub(_constant, netlist)

    def netlist_of_ghdl(self, entity: str, generics: Mapping[str, Generic] | None, language: str) -> str:
        """The same netlist, with the faults of GHDL's text."""
        words = [f"--out={language}", *_generic_options(generics), entity]
        needed = analyses_in(self.directory).sources(self.name.lower(), [entity])

        def run() -> RunResult:
            self._make(needed)
            return RunResult(0, self._ghdl("--synth", *words))

        return self._recalled(needed, ["--synth", *words], run).output

    def latches(self, entity: str, generics: Mapping[str, Generic] | None = None) -> list[str]:
        """What would become a latch in `entity`, empty if all is well.

        GHDL reports a latch in the source itself. It makes new ones in its Verilog, though: it drops `when others`
        of a `case`, and a Verilog `case` without `default` keeps the old value.
        """
        try:
            netlist = self.synthesise(entity, generics, "verilog")
        except GhdlError as error:
            found = [line for line in str(error).splitlines() if "latch" in line]
            if not found:
                raise
            return found
        return [case for case in _CASE.findall(netlist) if not _is_complete(case)]

    def replace_by_netlist(self, entity: str, generics: Mapping[str, Generic] | None = None) -> Path:
        """Put the netlist of `entity` in its place in this library and return its file.

        The netlist keeps the entity's name, generics and ports, so benches stay as they are; they must be analysed
        again and use the same generics.
        """
        netlist = self.directory / f"{entity}_netlist.vhd"
        # GHDL 2.0 writes an unsigned number of one bit as a character.
        text = self.synthesise(entity, generics)
        for bit in "01":
            text = text.replace(f"unsigned'('{bit}')", f"unsigned'(0 => '{bit}')")
        netlist.write_text(_in_order(text), encoding="utf-8")
        self.analyse([netlist])
        return netlist

    def _options(self) -> list[str]:
        return [f"--std={self.standard}", f"--work={self.name}", f"--workdir={self.directory}", f"-P{self.directory}"]

    def _recalled(
        self,
        needed: Sequence[Source],
        words: Sequence[str],
        run: Callable[[], RunResult],
        folders: Sequence[Path] = (),
    ) -> RunResult:
        """Do what `run` does in these folders, or recall it; `needed` and the words of the command decide it."""
        parts = {
            "ghdl": identity(self.program),
            "options": self._options(),
            "sources": [(str(source.path), source.options, source.digest) for source in needed],
            "words": words,
        }
        places = [source.path.parent for source in needed]
        return recalled(parts, list(dict.fromkeys(folders)), run, [self.directory, *places], _is_no_input)

    def _accept(self, needed: Sequence[Source]) -> RunResult:
        self._make(needed)
        return RunResult(0, "")

    def _make(self, needed: Sequence[Source]) -> None:
        analyses_in(self.directory).make(needed, _analyse)

    def _ghdl(self, command: str, *arguments: str, directory: Path | None = None) -> str:
        return _ghdl([self.program, command, *self._options(), *arguments], directory)


def _analyse(sources: Sequence[Source]) -> None:
    program, *options = sources[0].options
    with as_they_were(sources):
        _ghdl([program, "-a", *options, *(str(source.path) for source in sources)])


def _ghdl(command: Sequence[str], directory: Path | None = None) -> str:
    process = subprocess.run(command, cwd=directory, capture_output=True, text=True, errors="replace", check=False)
    if process.returncode != 0:
        raise GhdlError(process.stdout + process.stderr)
    return process.stdout


def _is_no_input(path: str) -> bool:
    """Whether a file is not read by a simulation: sources, which are inputs as such, and GHDL's own."""
    return path.endswith((".vhd", ".cf", ".o"))


def _in_order(netlist: str) -> str:
    """A netlist with each unit after the units that it instantiates; GHDL 2.0 does not always write it so."""
    texts = re.split(r"^(?=library ieee;$)", netlist, flags=re.MULTILINE)
    named = [(re.search(r"^entity (\S+) is$", text, re.MULTILINE), text) for text in texts]
    units = {found[1]: text for found, text in named if found}
    # The architecture of the whole, which is apart from its entity.
    last = [text for found, text in named if not found]
    ordered: dict[str, str] = {}

    def place(name: str) -> None:
        for inner in re.findall(r"entity work\.(\w+)", units.get(name, "")):
            if inner not in ordered:
                place(inner)
        if name in units:
            ordered[name] = units[name]

    for name in units:
        place(name)
    return "".join([*ordered.values(), *last])


def _with_attributes(netlist: str, modules: Modules) -> str:
    """GHDL's Verilog with the attributes of memories, which are only in GHDL's dump of the same netlist."""

    def declared(module: re.Match[str]) -> str:
        of_gates = {gate.name: verilog.memory_attributes(gate) for gate in modules[module[1]].instances}
        return _MEMORY.sub(lambda memory: f"  {of_gates.get(memory[1], '')}", module[0])

    return _MODULE.sub(declared, netlist)


def _is_complete(case: str) -> bool:
    """Whether a Verilog `case` says what happens for every value."""
    choices = _CHOICE.findall(case)
    return bool(_DEFAULT.search(case)) or (bool(choices) and len(choices) == 2 ** int(choices[0]))


def core_files(*cores: str, fileset: str = "rtl") -> list[Path]:
    """The files that the .core files name in `fileset`, in order: `core_files("axis/package", "axis/axis")`."""
    files = []
    for core in cores:
        description = CORES / f"{core}.core"
        names = core_description(description)["filesets"][fileset].get("files", [])
        files += [description.parent / name for name in names]
    return files


@cache
def core_description(path: Path) -> Any:
    """What a .core file says; nobody may change it."""
    return yaml.load(path.read_text(encoding="utf-8").removeprefix("CAPI=2:"), Loader=yaml.CSafeLoader)


def _constant(found: re.Match[str]) -> str:
    return f"{len(found[1])}'b{found[1]}"


def _generic_options(generics: Mapping[str, Generic] | None) -> list[str]:
    return [f"-g{name}={_generic_value(value)}" for name, value in (generics or {}).items()]


def _generic_value(value: Generic) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
