"""The generics and ports of an entity in VHDL, as GHDL elaborates it.

GHDL synthesizes the entity with an empty architecture, which takes a fraction of a second for any design, and prints
the entity as written, and each port's width. A printed expression is never evaluated, since GHDL 2.0 prints some
without their parentheses.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.export.component.model import Direction, Generic, Port
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.tools.programs import find, ways

_ARCHITECTURE = "firm_empty"
_GENERICS = re.compile(r"^  generic \(\n(.*?)^  \);", re.MULTILINE | re.DOTALL)
_PORTS = re.compile(r"^  port \(\n(.*?)^  \);", re.MULTILINE | re.DOTALL)
_END = re.compile(r"^end entity;", re.MULTILINE)
_ITEM = re.compile(
    r"    (?P<names>.+?): (?:(?P<mode>in|out|inout|buffer|linkage) )?(?P<type>[\w.]+)(?: \((?P<range>.*?)\))?"
    r"(?: := (?P<default>.*?))?;?"
)
_WIDTH = re.compile(r"^  subtype typwrap_(\w+) is std_logic_vector \((\d+) downto 0\);", re.MULTILINE)
_BOUNDS = re.compile(r"(?P<left>.+?) (?P<direction>downto|to) (?P<right>.+)")
_SCALARS = ("std_logic", "std_ulogic")
_VECTORS = ("std_logic_vector", "std_ulogic_vector")
_MODES = {"": Direction.IN, "in": Direction.IN, "out": Direction.OUT, "buffer": Direction.OUT, "inout": Direction.INOUT}
_IDENTIFIER = re.compile(r"[A-Za-z]\w*")
_OTHERS = re.compile(r"\(others => '([01])'\)")
_NETLIST = "with --view netlist, each port of the netlist is a wire"


@dataclass(frozen=True)
class _Item:
    """A generic or a port as GHDL prints it; `others` are the names that it is declared with."""

    name: str
    others: Sequence[str]
    mode: str
    type: str
    range: str
    default: str


@dataclass(frozen=True)
class Entity:
    """An entity: its generics and ports as GHDL prints them, the values given to generics, and some ports' widths."""

    name: str
    _generics: Sequence[_Item]
    _ports: Sequence[_Item]
    _given: Mapping[str, str]
    _widths: Mapping[str, int]

    def generics(self) -> list[Generic]:
        """Return the generics whose values are literals; the others keep their default values."""
        found = []
        for item in self._generics:
            is_doubtful = {name.lower() for name in item.others} & self._given.keys()
            text = self._given.get(item.name.lower(), "" if is_doubtful else item.default)
            value = _literal(item.type.lower(), text)
            used = re.compile(rf"\b{item.name}\b", re.IGNORECASE)
            if value is not None:
                is_free = not any(used.search(port.range) for port in self._ports)
                found.append(Generic(item.name, item.type.lower(), value, is_free))
        return found

    def ports(self) -> list[Port]:
        """Return the ports. Raise `InputError` for a port that IP-XACT has no words for."""
        return [self._port(item) for item in self._ports]

    def defaults(self) -> dict[str, int]:
        """Return the values of unconnected inputs by port."""
        pairs = ((item.name, self._default(item)) for item in self._ports)
        return {name: value for name, value in pairs if value is not None}

    def _port(self, item: _Item) -> Port:
        type_ = item.type.lower()
        if not _IDENTIFIER.fullmatch(item.name) or type_ not in (*_SCALARS, *_VECTORS) or item.mode not in _MODES:
            fail(f"port '{item.name}' of '{self.name}' is of type {item.type}, not a bit or a vector", hint=_NETLIST)
        return Port(item.name, _MODES[item.mode], self._bounds(item), self._default(item))

    def _bounds(self, item: _Item) -> tuple[int, int] | None:
        """Return the bounds; GHDL knows the width, and one of the bounds must be a number."""
        if item.type.lower() in _SCALARS:
            return None
        match = _BOUNDS.fullmatch(item.range)
        left, right = (_number(match[side]) if match else None for side in ("left", "right"))
        if left is None and right is None:
            fail(f"the range of port '{item.name}' of '{self.name}' has no bound that is a number", hint=_NETLIST)
        if left is not None and right is not None:
            return left, right
        step = self._widths.get(item.name.lower(), 1) - 1
        if match and match["direction"] == "to":
            step = -step
        return (left, left - step) if left is not None else (int(right or 0) + step, int(right or 0))

    def _default(self, item: _Item) -> int | None:
        text = item.default
        if match := _OTHERS.fullmatch(text):
            bounds = self._bounds(item)
            width = abs(bounds[0] - bounds[1]) + 1 if bounds else 1
            return ((1 << width) - 1) * int(match[1])
        bits = re.fullmatch(r"(?P<quote>['\"])(?P<bits>[01]+)(?P=quote)", text)
        digits = re.fullmatch(r'x"([0-9a-fA-F]+)"', text)
        return int(bits["bits"], 2) if bits else int(digits[1], 16) if digits else None


def read_entity(
    unit: str, root: Path, libraries: Mapping[str, Sequence[str]], standard: str, generics: Mapping[str, str]
) -> tuple[Entity, set[str]]:
    """Return an entity, `[library.]name`, and the files that its design needs; files are named relative to `root`.

    Raise `InputError` with GHDL's messages if the files do not compile.
    """
    program = find("ghdl")
    if program is None:
        fail("GHDL is not installed, which reads the ports", hint=ways("ghdl"))
    library, _, name = unit.rpartition(".")
    with tempfile.TemporaryDirectory() as folder:
        ghdl = _Ghdl(program, root, folder, standard, library or "work")
        for of, files in libraries.items():
            ghdl.run("-i", f"--work={of}", *files)
        # GHDL prints only files with relative names.
        needed = set(ghdl.run("--elab-order", ghdl.library, name).splitlines())
        empty = Path(folder) / "empty.vhd"
        empty.write_text(f"architecture {_ARCHITECTURE} of {name} is begin end;\n", encoding="ascii")
        ghdl.run("-i", ghdl.library, str(empty))
        ghdl.run("-m", ghdl.library, name, _ARCHITECTURE)
        values = [f"-g{generic}={value}" for generic, value in generics.items()]
        if not needed:
            fail(f"GHDL cannot elaborate '{name}'", hint="build the target, which reports the reason")
        text = ghdl.run("--synth", ghdl.library, "--out=vhdl", *values, name, _ARCHITECTURE)
    given = {generic.lower(): value for generic, value in generics.items()}
    return _entity(name, text, given), needed


def _entity(name: str, text: str, given: Mapping[str, str]) -> Entity:
    """Return the entity in GHDL's text."""
    end = _END.search(text)
    head = text[: end.start()] if end else ""
    widths = {port.lower(): int(left) + 1 for port, left in _WIDTH.findall(text)}
    generics, ports = (tuple(_items(pattern.search(head))) for pattern in (_GENERICS, _PORTS))
    return Entity(name, generics, ports, given, widths)


def _items(found: re.Match[str] | None) -> Iterator[_Item]:
    for line in found[1].splitlines() if found else ():
        match = _ITEM.fullmatch(line)
        assert match, line
        names = match["names"].split(", ")
        values = [match[word] or "" for word in ("mode", "type", "range", "default")]
        yield from (_Item(name, [other for other in names if other != name], *values) for name in names)


@dataclass(frozen=True)
class _Ghdl:
    program: Path
    root: Path
    folder: str
    standard: str
    _library: str

    @property
    def library(self) -> str:
        return f"--work={self._library}"

    def run(self, command: str, *arguments: str) -> str:
        """Return what a command prints. Raise `InputError` if it fails."""
        options = [f"--std={self.standard}", f"--workdir={self.folder}", f"-P{self.folder}"]
        done = subprocess.run(
            [self.program, command, *options, *arguments],
            cwd=self.root,
            capture_output=True,
            encoding="latin-1",
            stdin=subprocess.DEVNULL,
            check=False,
        )
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if "warning:" not in line]
            fail("GHDL cannot read the sources", hint="\n".join(lines))
        return done.stdout


def _number(text: str) -> int | None:
    return int(text) if text.isdecimal() else None


def _literal(type_: str, text: str) -> int | float | bool | str | None:
    """Return the value of a literal, or None for anything else."""
    if type_ == "string":
        return text[1:-1] if re.fullmatch(r'"[^"]*"', text) else text if '"' not in text and text else None
    if type_ == "boolean":
        return {"true": True, "false": False}.get(text.lower())
    if type_ in ("integer", "natural", "positive"):
        return int(text) if re.fullmatch(r"-?\d+", text) else None
    if type_ == "real":
        return float(text) if re.fullmatch(r"-?\d+\.\d+", text) else None
    return None
