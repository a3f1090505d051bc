"""VHDL entities that the Verilog of a build instantiates.

GHDL translates an entity with given values of its generics. Verilog selects the values by parameters, so each such
entity becomes a module that contains a translation for each set of values in use:

    module firm_float_compare #(parameter EXPONENT_BITS = 11, parameter MANTISSA_BITS = 52) (...);

Yosys elaborates the Verilog and finds the values; without Yosys, only Verilog that names an entity is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fusesoc_firm.netlist.elaborated import elaborate
from fusesoc_firm.netlist.model import Module, NetlistError
from fusesoc_firm.netlist.verilog import identifier
from fusesoc_firm.text.render import render
from fusesoc_firm.tools.programs import explanation, find
from fusesoc_firm.tools.yosys import Yosys, source_place

_COMMENT = re.compile(r"--.*")
_ENTITY = re.compile(r"^[ \t]*entity\s+(\w+)\s+is\b(.*?)^[ \t]*end\b", re.IGNORECASE | re.MULTILINE | re.DOTALL)
_GENERIC = re.compile(r"\s*(?:constant\s+)?([\w\s,]+?)\s*:\s*(?:in\s+)?(\w+)[^:]*(?::=\s*(.*?)\s*)?", re.DOTALL)
_VECTORS = ("std_logic_vector", "std_ulogic_vector", "unsigned", "signed", "bit_vector")
_BITS = ("std_logic", "std_ulogic", "bit")
_WORDS = re.compile(r"\w+")
_DECLARED = re.compile(r"[(;]\s*(?:signal\s+|constant\s+)?(\w+(?:\s*,\s*\w+)*)\s*:", re.IGNORECASE)
# What a file in Verilog defines; a file without a unit is included by others.
_UNIT = re.compile(r"^[ \t]*(?:module|macromodule|package|interface)\s+(?:automatic\s+|static\s+)?(\w+)", re.MULTILINE)


@dataclass(frozen=True)
class Generic:
    """A generic; `type` is the name of its type in lower case, and `default` the VHDL of its default, or empty."""

    name: str
    type: str
    default: str

    @property
    def parameter(self) -> str:
        """The default as a Verilog expression; 0 for one that is no literal."""
        text = self.default.lower()
        if text in ("true", "false"):
            return str(int(text == "true"))
        if bits := re.fullmatch(r'["\']([01]+)["\']', text):
            return f"{len(bits[1])}'b{bits[1]}"
        is_literal = re.fullmatch(r"-?\d+", text) or (self.type == "string" and re.fullmatch(r'"[^"]*"', text))
        return self.default if is_literal else "0"

    def given(self, value: str) -> tuple[str, str]:
        """Return a parameter's value in Yosys' JSON as GHDL's option has it, and as a Verilog literal."""
        if self.type == "string":
            return value, f'"{value}"'
        if (number := integer(value)) is None:
            raise ValueError("a number")
        if self.type == "boolean":
            return str(number != 0).lower(), str(int(number != 0))
        if self.type in _VECTORS or self.type in _BITS:
            return (value[-1] if self.type in _BITS else value), f"{len(value)}'b{value}"
        return str(number), str(number)


def integer(value: str) -> int | None:
    """Return the number of a parameter in Yosys' JSON, in two's complement; None if it has another value."""
    if not value or set(value) - {"0", "1"}:
        return None
    return int(value, 2) - (1 << len(value) if value[0] == "1" and len(value) > 1 else 0)


@dataclass(frozen=True, eq=False)
class Entity:
    """An entity in a file of a library, with the source's spelling of all names.

    `interface` is the text of its declaration.
    """

    name: str
    library: str
    path: Path
    generics: Mapping[str, Generic]
    interface: str

    @property
    def names(self) -> Sequence[str]:
        """The names of the generics and ports, in their order."""
        return [word for names in _DECLARED.findall(self.interface) for word in _WORDS.findall(names)]

    def sizes(self, port: str) -> Sequence[str]:
        """Return the generics that the declared type of a port names, in their order."""
        declared = re.search(rf"\b{re.escape(port)}\b[^:;()]*:([^;]*)", self.interface, re.IGNORECASE)
        words = {word.lower() for word in _WORDS.findall(declared[1])} if declared else set()
        return [name for name in self.generics if name.lower() in words]

    def spelt(self, port: str) -> str:
        """Return the name of a port as spelt in the source, since the netlist does not preserve the case."""
        return next((word for word in _WORDS.findall(self.interface) if word.lower() == port.lower()), port)


@dataclass(frozen=True)
class Use:
    """An entity with the values of generics: for GHDL, and as Verilog literals."""

    entity: Entity
    generics: tuple[tuple[str, str], ...]
    literals: tuple[tuple[str, str], ...]


def entities(libraries: Mapping[str, Sequence[str]]) -> dict[str, Entity]:
    """Return the entities in VHDL files, by name."""
    found: dict[str, Entity] = {}
    for library, files in libraries.items():
        for file in files:
            for name, interface in _ENTITY.findall(_COMMENT.sub("", _text(file))):
                generics = {item.name: item for item in _generics(interface)}
                found[name] = Entity(name, library, Path(file), generics, interface)
    return found


@dataclass(frozen=True)
class Instantiated:
    """What the Verilog files of a build instantiate of these entities; Yosys' output is in `folder`."""

    entities: Mapping[str, Entity]
    verilog: Sequence[str]
    defines: Mapping[str, str]
    folder: Path

    @cached_property
    def _words(self) -> Mapping[str, set[str]]:
        """The words of each file, its comments included."""
        return {file: set(_WORDS.findall(_text(file))) for file in self.verilog}

    def below(self, root: str, parameters: Mapping[str, str]) -> Iterator[Use]:
        """Yield the instances of entities below a module with these parameters.

        Raise `NetlistError` for an instance that is not legal for its entity.
        """
        files = self._files(root)
        if not (named := sorted(set().union(*(self._words[file] for file in files)) & self.entities.keys())):
            return
        if not (program := find("yosys")):
            raise NetlistError(f"{explanation(['yosys'])}\n      = it finds {', '.join(named)} in the Verilog")
        self.folder.mkdir(parents=True, exist_ok=True)
        yosys = Yosys(program, self.folder, self.defines)
        reading = yosys.reading([Path(file) for file in files], "-nosynthesis", "-defer")
        values = "".join(f" -chparam {name} {value}" for name, value in parameters.items())
        # Yosys writes no JSON of processes.
        script = f"{reading}; hierarchy -top {root}{values}; proc"
        if not (modules := yosys.modules(script)):
            raise NetlistError(f"error: Yosys cannot read the Verilog:\n{yosys.run(script).stderr.strip()}")
        for cell in (cell for module in modules.values() for cell in module["cells"].values()):
            if (entity := self.entities.get(cell["type"])) and cell["type"] not in modules:
                yield _use(entity, cell)

    def elaborated(self, name: str) -> Module | None:
        """Return a module with the defaults of its parameters, or None if Yosys is missing or cannot elaborate it."""
        if not (program := find("yosys")):
            return None
        self.folder.mkdir(parents=True, exist_ok=True)
        yosys = Yosys(program, self.folder, self.defines)
        return elaborate(yosys, yosys.reading([Path(file) for file in self._files(name)]), name)

    def _files(self, root: str) -> list[str]:
        """Return the files below a module, in the order of the build: Yosys need not read test benches."""
        defined = {file: _UNIT.findall(_text(file)) for file in self.verilog}
        units = {name: file for file, names in defined.items() for name in names}
        needed, new = set(), {units[root]} if root in units else set(self.verilog)
        while new:
            needed |= new
            new = {units[name] for file in new for name in self._words[file] & units.keys()} - needed
        return [file for file, names in defined.items() if file in needed or not names]


def module_of(entity: Entity, translated: Mapping[Use, Module]) -> str:
    """Return the Verilog of the module that stands for an entity and contains its translations."""
    names = {name for use in translated for name, _ in use.literals}
    defaults = {name: item.parameter for name, item in entity.generics.items() if name in names}
    modules = _by_condition(entity, translated, defaults)
    ports = list(_ports(entity, modules))
    translations = [
        {
            "condition": condition,
            "number": number,
            "module": identifier(module.name),
            "connections": [{"inner": identifier(inner), "outer": port["name"]} for port, inner in ports],
        }
        for number, (condition, module) in enumerate(modules.items())
    ]
    context = {
        "name": identifier(entity.name),
        "parameters": [{"name": name, "value": value} for name, value in _used(translated, defaults).items()],
        "ports": [port for port, _ in ports],
        "translations": translations,
        "missing": f"{entity.name}_is_not_translated_with_these_parameters",
    }
    return render("verilog/entity.v", context)


def _used(translated: Iterable[Use], defaults: Mapping[str, str]) -> Mapping[str, str]:
    """Return defaults of the parameters with which the module has a translation, if there are such.

    Yosys checks a module with its defaults, too. Those that no instance relies on may be others than the entity's.
    """
    given = [dict(use.literals) for use in translated]
    needed = {name: value for name, value in defaults.items() if not all(name in values for values in given)}
    sets = ({**defaults, **values} for values in given)
    return next((values for values in sets if needed.items() <= values.items()), defaults)


def _by_condition(entity: Entity, translated: Mapping[Use, Module], parameters: Mapping[str, str]) -> dict[str, Module]:
    """Return the translations by the Verilog condition for their parameters; `parameters` are the defaults."""
    found: dict[str, Module] = {}
    for use, module in translated.items():
        values = {**parameters, **dict(use.literals)}
        condition = " && ".join(f"{name} == {value}" for name, value in values.items()) or "1"
        if condition in found:
            raise NetlistError(f"error: '{entity.name}' needs the values of all its parameters: {', '.join(values)}")
        found[condition] = module
    return found


def _ports(entity: Entity, modules: Mapping[str, Module]) -> Iterator[tuple[dict[str, str], str]]:
    """Yield each port with the spelling of the source, and its name in the netlist."""
    inputs, outputs = ([item.inputs for item in modules.values()], [item.outputs for item in modules.values()])
    for direction, sides in (("input", inputs), ("output", outputs)):
        for same in zip(*sides, strict=True):
            range_ = _range([port.width for port in same], list(modules))
            yield {"direction": direction, "range": range_, "name": entity.spelt(same[0].name)}, same[0].name


def _use(entity: Entity, cell: Mapping[str, Any]) -> Use:
    place = ":".join(map(str, source_place(cell["attributes"]) or (entity.name,)))
    if any(name.startswith("$") for name in cell["connections"]):
        raise NetlistError(f"{place}: error: '{entity.name}' is in VHDL, so connect its ports by name")
    generics, literals = {}, {}
    for name, value in cell["parameters"].items():
        if not (generic := entity.generics.get(name)):
            legal = ", ".join(entity.generics) or "none"
            raise NetlistError(f"{place}: error: '{entity.name}' has no parameter '{name}'; it has: {legal}")
        try:
            generics[name], literals[name] = generic.given(str(value))
        except ValueError as error:
            raise NetlistError(f"{place}: error: the parameter '{name}' must be {error}, not '{value}'") from None
    return Use(entity, tuple(sorted(generics.items())), tuple(sorted(literals.items())))


def _range(widths: Sequence[int], conditions: Sequence[str]) -> str:
    """Return the range of a port, which may depend on the parameters; a port of one bit is a scalar."""
    if set(widths) == {1}:
        return ""
    if len(set(widths)) == 1:
        return f"[{widths[0] - 1}:0] "
    *others, last = zip(conditions, widths, strict=True)
    return f"[{''.join(f'({condition}) ? {width - 1} : ' for condition, width in others)}{last[1] - 1}:0] "


def _text(file: str) -> str:
    return Path(file).read_text(encoding="utf-8", errors="replace")


def _generics(interface: str) -> Iterator[Generic]:
    for element in _elements(interface, "generic"):
        if match := _GENERIC.fullmatch(element):
            for name in match[1].split(","):
                yield Generic(name.strip(), match[2].lower(), match[3] or "")


def _elements(interface: str, clause: str) -> Iterable[str]:
    """Return the elements between the parentheses of a clause."""
    if not (begin := re.search(rf"\b{clause}\s*\(", interface, re.IGNORECASE)):
        return []
    depth, elements = 0, [""]
    for letter in interface[begin.end() :]:
        depth += (letter == "(") - (letter == ")")
        if depth < 0:
            break
        if letter == ";" and not depth:
            elements.append("")
        else:
            elements[-1] += letter
    return [element for element in elements if element.strip()]
