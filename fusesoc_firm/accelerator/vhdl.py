"""Entities in VHDL as GHDL reads them.

GHDL analyses the files as a build does, and reports faults with their places. Ports are in GHDL's syntax tree of copies
without architectures and without other libraries, so they are known even if an architecture has faults or uses missing
units. (GHDL 2.0 cannot print the tree of a file that uses a library from an earlier analysis.) The ports of an entity
that needs another library for its ports are unknown.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

from fusesoc_firm.accelerator.instances import size_hint
from fusesoc_firm.accelerator.sources import Fault, report_sources, report_waits
from fusesoc_firm.accelerator.unit import Libraries, Unit, UnitPort, lines_of, place
from fusesoc_firm.accelerator.vhdl_hints import hint, is_at_end, is_generate, is_syntax, is_unanalysed, missing_clause
from fusesoc_firm.netlist import dump
from fusesoc_firm.netlist.corrections import lost_latches
from fusesoc_firm.netlist.instantiated import Entity, entities
from fusesoc_firm.netlist.loops import loops
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, closest
from fusesoc_firm.text.outputs import shown

# A process that never waits is only a warning, but its simulation would never end.
_MESSAGE = re.compile(
    r"(?P<file>.+?):(?P<line>\d+):(?P<column>\d+):(?:error: ?)? ?(?:warning: (?=infinite loop))?"
    r"(?!warning|note| ?previous declaration)(?P<text>.+)"
)
_OPTION = re.compile(r" \[-W[\w-]+\]$")
# Of GHDL's synthesis; the place is the signal's declaration.
_TWO_SOURCES = re.compile(r'(?P<file>.+?):(?P<line>\d+):(?P<column>\d+):.*multiple assignments for "(?P<name>.+?)"')
_NO_SOURCE = re.compile(r'(?P<file>.+?):(?P<line>\d+):(?P<column>\d+):.*no assignment for port "(?P<name>.+?)"')
_LENGTH = re.compile(
    r"(?P<file>.+?):(?P<line>\d+):(?P<column>\d+):.*mismatching vector length;"
    r" got (?P<found>\d+), expect (?P<needed>\d+)"
)
_OUT_OF_BOUNDS = re.compile(r"(?P<file>.+?):(?P<line>\d+):(?P<column>\d+):.*out of bound expression")
_LATCH = re.compile(r"^.*latch infered for net .*(?= \(use --latches\))", re.MULTILINE)
_PLACED = re.compile(r"(?P<file>.+?):(?P<line>\d+):(?P<column>\d+):(?: ?error:)? ?(?P<text>.+)")
_INSTANCE = re.compile(r"(\w+)\s*:\s*(?:entity\s+)?(?:\w+\s*\.\s*)?(\w+)\s+(?:generic|port)\s+map", re.IGNORECASE)
_FORMAL = re.compile(r"(\w+)\s*=>")
_MISSING_UNIT = re.compile(
    r"unit [\"'](?P<unit>\w+)[\"'] not found in library [\"'](?P<of>\w+)|"
    r"cannot find resource library [\"'](?P<library>\w+)"
)
_ARCHITECTURE = re.compile(
    r"^[ \t]*architecture\s+\w+\s+of\s+\w+\s+is\b.*?"
    r"(?=^[ \t]*(?:architecture\s+\w+\s+of|library\s|entity\s+\w+\s+is|package\s|configuration\s+\w+\s+of)|\Z)",
    re.IGNORECASE | re.MULTILINE | re.DOTALL,
)
# Context clauses for other libraries than those of the language and the accelerator's own.
_OTHER_LIBRARY = re.compile(r"^[ \t]*(library|use)\s+(?!ieee\b|std\b|work\b)[^;]*;", re.IGNORECASE | re.MULTILINE)
_OPERATORS: dict[str, Callable[[int, int], int]] = {
    "addition_operator": lambda left, right: left + right,
    # GHDL's spelling.
    "substraction_operator": lambda left, right: left - right,
    "multiplication_operator": lambda left, right: left * right,
    "division_operator": lambda left, right: left // right,
    "exponentiation_operator": lambda left, right: left**right,
}
LATCH_CURE = "assign it in every branch of its process, or only at a clock edge"
LOOP_CURE = "break the loop by a register: assign one of its signals at a clock edge"
_BIT_TYPES = ("std_logic", "std_ulogic")


@dataclass
class VhdlReader:
    """GHDL with a library in `folder`, for a VHDL `standard` in GHDL's spelling.

    `libraries` returns the files that accelerators may use; it is called only if an accelerator cannot be analysed
    without them. All accelerators in `sources` are read together first, which is enough if they have no faults.
    """

    ghdl: Path
    folder: Path
    libraries: Callable[[], Libraries]
    sources: Sequence[Path]
    standard: str = "93"
    _known: Libraries = field(default_factory=Libraries)
    _is_prepared: bool = False

    def read(self, paths: Sequence[Path], top: str, generics: Mapping[str, int], faults: Diagnostics) -> list[Unit]:
        """Return the entities of the files with the values of generics; add the faults of the first faulty file.

        A fault in a file of another core is reported instead of the faults in the accelerator, which may result from
        it.
        """
        messages = [] if self._is_faultless else self._analysed(paths)
        if messages and not self._is_prepared:
            self._prepare()
        if messages and self._known.files:
            messages = self._made(paths, top) or self._analysed(paths)
        elif messages:
            messages = self._analysed(paths)
        absent = [match for text, _ in messages if (match := _MISSING_UNIT.match(text))]
        # The declarations in a missing unit are unknown, so further messages are irrelevant.
        is_known = self._known.is_complete and not any(match["unit"] in self._known.generated for match in absent)
        for text, source in messages if is_known or not absent else ():
            faults.error(text, source, self._hint(text, source))
        if not messages:
            self._report_sources(paths, top, generics, faults)
        tree = self._all_entities or self._tree(paths) or self._tree(paths[-1:])
        return [unit for path in paths for unit in tree.units(path, generics)] if tree else []

    def entity(self, path: Path, name: str, generics: Mapping[str, int]) -> Unit | None:
        """Return an entity in a file of another core, with the values of generics, or None if it cannot be read."""
        tree = self._tree([path])
        return next((unit for unit in tree.units(path, generics) if unit.name == name.lower()), None) if tree else None

    @cached_property
    def _is_faultless(self) -> bool:
        """Whether GHDL reports no message about all sources together."""
        return not list(_messages(self._run("-a", self.sources).stderr))

    @cached_property
    def _all_entities(self) -> _Tree | None:
        return self._tree(self.sources)

    def _prepare(self) -> None:
        """Let GHDL know the files that accelerators may use."""
        self._is_prepared = True
        self._known = self.libraries()
        self._run("-a", self._packages())
        for library in dict.fromkeys(library for _, library in self._known.files):
            self._run("-i", [path for path, of in self._known.files if of == library], library)

    def _made(self, paths: Sequence[Path], top: str) -> list[tuple[str, SourceRef]]:
        """Analyse an accelerator and the files of other cores that it uses, in GHDL's own order, as a build does.

        Return the messages about files of other cores or, without these, about the accelerator.
        """
        self._run("-i", paths)
        found = list(_messages(self._run("-m", [top]).stderr))
        own = set(map(str, paths))
        return [item.placed() for item in [item for item in found if item.file not in own] or found]

    def _analysed(self, paths: Sequence[Path]) -> list[tuple[str, SourceRef]]:
        """Return GHDL's messages about the first file with faults."""
        for path in paths:
            if messages := list(_messages(self._run("-a", [path]).stderr)):
                return [item.placed() for item in messages]
        return []

    def _hint(self, text: str, source: SourceRef) -> str:
        """Return a hint about a fault, such as the core with a missing library or unit, or an empty text."""
        if found := _MISSING_UNIT.match(text):
            name = self._known.core_with(found["library"] or found["of"], found["unit"] or "")
            if name:
                return f"it is in {name}, on which the accelerator's core must depend"
            if near := closest(found["unit"] or "", self._others):
                return f"did you mean '{near}'?"
            return f"add the file with '{found['unit']}' to 'sources'" if found["of"] == "work" else ""
        path = Path(source.file)
        return hint(text, lines_of(path), self._formals(path, source))

    def _formals(self, path: Path, source: SourceRef) -> Sequence[str]:
        """Return the legal names at a place before '=>' in the map of an instance of an entity in another core."""
        _, entity = self._instance(path, source.line)
        if entity is None or not re.match(r"\w+\s*=>", source.text[source.column - 1 :]):
            return ()
        text = "\n".join([*lines_of(path)[: source.line - 1], source.text[: source.column]]).lower()
        is_generic = text.rfind("generic map") > text.rfind("port map")
        return [name for name in entity.names if (name in entity.generics) == is_generic]

    def _report_sources(
        self, paths: Sequence[Path], top: str, generics: Mapping[str, int], faults: Diagnostics
    ) -> None:
        """Add lengths that differ, signals with more than one source, and warnings about outputs without a source.

        Other messages of GHDL's synthesis are ignored. A file with the value 'Z' may have such signals.
        """
        if any("'Z'" in path.read_text(encoding="utf-8", errors="replace").upper() for path in paths):
            return
        # All names of a generic differ only in case.
        options = ["--out=dump", *(f"-g{name}={value}" for name, value in list(generics.items())[:1])]
        done = self._run("--synth", [*options, top])
        lines = dict.fromkeys(done.stderr.splitlines())
        self._report_latches(done, paths, faults)
        is_connected = not self._report_lengths(lines, paths, faults)
        for match in (_TWO_SOURCES.match(line) or _NO_SOURCE.match(line) for line in lines):
            if not match or (path := Path(match["file"])) not in paths:
                continue
            source = place(path, int(match["line"]), int(match["column"]), len(match["name"]))
            # GHDL drops an assignment of a wrong length.
            if is_connected or match.re is _TWO_SOURCES:
                fault = Fault.SEVERAL if match.re is _TWO_SOURCES else Fault.NONE
                report_sources(match["name"], source, fault, faults)

    def _report_lengths(self, lines: Iterable[str], paths: Sequence[Path], faults: Diagnostics) -> bool:
        """Add lengths that differ, and return whether there are any."""
        count = len(faults.found)
        for line in lines:
            if (match := _LENGTH.match(line) or _OUT_OF_BOUNDS.match(line)) and (path := Path(match["file"])) in paths:
                source = place(path, int(match["line"]), int(match["column"]))
                if match.re is _LENGTH:
                    message = f"{match['found']} bits, but {match['needed']} are needed here"
                    faults.error(message, source, self._size_hint(path, source))
                else:
                    cure = "compare the ranges: a slice is value(7 downto 0), and resize(value, 32) is in numeric_std"
                    faults.error("the value does not have as many bits as its target", source, cure)
        return len(faults.found) > count

    def _report_latches(
        self, done: subprocess.CompletedProcess[str], paths: Sequence[Path], faults: Diagnostics
    ) -> None:
        """Add warnings about latches, combinational loops and a `valid` that waits for a `ready`.

        They can be simulated, but latches and loops are not synchronous.
        """
        cures = {match[0]: LATCH_CURE for match in _LATCH.finditer(done.stderr)}
        if not done.returncode:
            modules = dump.read(done.stdout)
            cures |= dict.fromkeys(lost_latches(modules), LATCH_CURE) | dict.fromkeys(loops(modules), LOOP_CURE)
        for sentence, cure in cures.items():
            if (match := _PLACED.match(sentence)) and (path := Path(match["file"])) in paths:
                faults.warn(match["text"], place(path, int(match["line"]), int(match["column"])), cure)
        if not done.returncode:
            report_waits(modules, paths, faults)

    def _size_hint(self, path: Path, source: SourceRef) -> str:
        """Return a hint if a place is in the port map of an entity in another core, whose generics select the size."""
        label, entity = self._instance(path, source.line)
        formals = _FORMAL.findall(source.text[: source.column])
        return size_hint(f"generics of '{label}',", entity, formals[-1]) if entity and formals else ""

    def _instance(self, path: Path, line: int) -> tuple[str, Entity | None]:
        """Return the label of the last instance above a line, and its entity if that is in another core."""
        instances = _INSTANCE.findall("\n".join(lines_of(path)[:line]))
        label, name = instances[-1] if instances else ("", "")
        return label, self._others.get(name.lower())

    @property
    def _others(self) -> Mapping[str, Entity]:
        """The entities in the files of other cores, by their names in lower case."""
        files = {str(file) for file, _ in self._known.files}
        return {name.lower(): entity for name, entity in entities({"": sorted(files)}).items()}

    def _packages(self) -> list[Path]:
        return [self._written(f"package_{number}.vhd", text) for number, text in enumerate(self._known.packages)]

    def _written(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return path

    def _tree(self, paths: Sequence[Path]) -> _Tree | None:
        """Return GHDL's tree of the declarations in files; None if GHDL cannot analyse them."""
        copies = {self._copy(number, path): path for number, path in enumerate(paths)}
        with tempfile.TemporaryDirectory(dir=self.folder) as empty:
            done = self._started("--file-to-xml", [f"--workdir={empty}"], [*self._packages(), *copies])
        # After a fault, GHDL prints nothing and returns 0.
        if done.returncode or not done.stdout:
            return None
        return _Tree(fromstring(done.stdout), {path: str(copy) for copy, path in copies.items()})

    def _copy(self, number: int, path: Path) -> Path:
        text = path.read_text(encoding="utf-8", errors="replace")
        return self._written(f"entities_{number}.vhd", _declarations(text))

    def _run(
        self, command: str, arguments: Sequence[Path | str], library: str = "work"
    ) -> subprocess.CompletedProcess[str]:
        places = [f"--workdir={self.folder}", f"-P{self.folder}", f"--work={library}"]
        return self._started(command, places, arguments)

    def _started(
        self, command: str, places: Sequence[str], others: Sequence[Path | str]
    ) -> subprocess.CompletedProcess[str]:
        standard = f"--std={self._known.standard or self.standard}"
        arguments: list[str | Path] = [self.ghdl, command, standard, *self._known.options, *places, *others]
        return subprocess.run(
            arguments, capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL, check=False
        )


@dataclass(frozen=True)
class _Message:
    """A message of GHDL, with the file as named on the command line."""

    text: str
    file: str
    line: int
    column: int

    def placed(self) -> tuple[str, SourceRef]:
        """Return the text and its place."""
        return self.text, place(Path(shown(Path(self.file))), self.line, self.column)


def _messages(output: str) -> Iterator[_Message]:
    """Yield GHDL's errors in files; a line in parentheses continues the message before it."""
    found: list[_Message] = []
    for match in filter(None, map(_MESSAGE.match, output.splitlines())):
        if match["text"].startswith("(") and found:
            found[-1] = replace(found[-1], text=f"{found[-1].text} {match['text']}")
        else:
            text = _OPTION.sub("", match["text"])
            found.append(_Message(text, match["file"], int(match["line"]), int(match["column"])))
    yield from _without_consequences(list(dict.fromkeys(found)))


def _without_consequences(found: Sequence[_Message]) -> Iterator[_Message]:
    """Yield messages without those that follow from an earlier one.

    These are further faults in the syntax of a line, after a statement outside a process or at the file's end, further
    names of a missing package, whose types have no operators, and the architecture of an entity with faults.
    """
    lines: set[tuple[str, int]] = set()
    clauses: set[str] = set()
    is_ended = False
    for message in found:
        line, clause = (message.file, message.line), missing_clause(message.text)
        if is_syntax(message.text):
            follows = is_ended or line in lines or (is_at_end(message.text) and bool(lines))
            lines.add(line)
            is_ended |= is_at_end(message.text) or is_generate(message.text)
        else:
            follows = clause in clauses or (bool(clauses) and message.text.startswith("no function declarations"))
            follows |= is_unanalysed(message.text) and message is not found[0]
            clauses |= {clause} - {""}
        if not follows:
            yield message


def _declarations(text: str) -> str:
    """Return a file without architectures and without other libraries; all lines keep their numbers."""
    for pattern in (_ARCHITECTURE, _OTHER_LIBRARY):
        text = pattern.sub(lambda match: "\n" * match[0].count("\n"), text)
    return text


class _Tree:
    """GHDL's syntax tree of files, of which `copies` names the copies; an element refers to another one by its id."""

    def __init__(self, root: Element, copies: Mapping[Path, str]) -> None:
        self._elements = {item.get("id", ""): item for item in root.iter()}
        self._root = root
        self._copies = copies
        self._lines = {path: lines_of(path) for path in copies}
        self._generics: Mapping[str, int] = {}

    def units(self, path: Path, generics: Mapping[str, int]) -> Iterator[Unit]:
        """Yield the entities of a file with the values of generics."""
        self._generics = generics
        for item in self._root.iter("library_unit"):
            if item.get("kind") == "entity_declaration" and item.get("file") == self._copies.get(path):
                yield self._unit(item, path)

    def _unit(self, item: Element, path: Path) -> Unit:
        generics = item.findall("generic_chain/el")
        return Unit(
            item.get("identifier", ""),
            self._place(item, path),
            tuple(self._port(port, path) for port in item.findall("port_chain/el")),
            {
                generic.get("identifier", ""): self._place(generic, path)
                for generic in generics
                if generic.find("default_value") is None and generic.get("identifier") not in self._generics
            },
        )

    def _port(self, item: Element, path: Path) -> UnitPort:
        type_ = self._follow(item.find("type"))
        bits = 1 if self._type_name(type_) in _BIT_TYPES else self._bits(type_)
        return UnitPort(
            item.get("identifier", ""),
            self._place(item, path),
            item.get("mode", ""),
            bits,
            self._type_name(type_),
            is_optional=item.find("default_value") is not None,
        )

    def _type_name(self, type_: Element | None) -> str:
        """Return the name of the type of an array, or the declared name of another type."""
        # In VHDL-2008, std_logic_vector is itself a subtype: std_ulogic_vector with resolved elements.
        while (
            type_ is not None
            and type_.get("kind", "").startswith("array_subtype")
            and type_.find("resolution_indication") is None
        ):
            type_ = self._follow(type_.find("parent_type"))
        declaration = self._follow(type_.find("type_declarator")) if type_ is not None else None
        return declaration.get("identifier", "") if declaration is not None else ""

    def _bits(self, type_: Element | None) -> int | None:
        """Return the number of elements of an array whose bounds are known."""
        while type_ is not None and type_.find("index_constraint_list/el/range_constraint") is None:
            type_ = self._follow(type_.find("parent_type"))
        span = type_.find("index_constraint_list/el/range_constraint") if type_ is not None else None
        if span is None:
            return None
        left, right = (self._value(span.find(f"{side}_limit_expr")) for side in ("left", "right"))
        if left is None or right is None:
            return None
        return max(0, (left - right if span.get("direction") == "downto" else right - left) + 1)

    def _value(self, item: Element | None) -> int | None:
        """Return the value of an expression of literals, constants and generics; None if it is anything else."""
        item = self._follow(item)
        if item is None:
            return None
        kind = item.get("kind", "")
        if kind == "integer_literal":
            return int(item.get("value", "0"))
        if kind in ("simple_name", "selected_name"):
            return self._constant(self._follow(item.find("named_entity")))
        if kind == "parenthesis_expression":
            return self._value(item.find("expression"))
        if kind in _OPERATORS:
            left, right = self._value(item.find("left")), self._value(item.find("right"))
            is_defined = left is not None and right is not None and (right > 0 or kind != "division_operator")
            return _OPERATORS[kind](left or 0, right or 0) if is_defined else None
        return None

    def _constant(self, item: Element | None) -> int | None:
        if item is None or item.get("kind") not in ("constant_declaration", "interface_constant_declaration"):
            return None
        if item.get("kind") == "interface_constant_declaration" and item.get("identifier") in self._generics:
            return self._generics[item.get("identifier", "")]
        return self._value(item.find("default_value"))

    def _follow(self, item: Element | None) -> Element | None:
        """Return the element to which another element refers, or the element itself."""
        return self._elements.get(item.get("ref", "")) if item is not None and item.get("ref") else item

    def _place(self, item: Element, path: Path) -> SourceRef:
        name = item.get("identifier", "")
        return place(path, int(item.get("line", "1")), int(item.get("col", "1")), len(name), self._lines[path])
