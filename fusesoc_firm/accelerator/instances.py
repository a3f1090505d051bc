"""The instances in an accelerator's Verilog whose modules are in none of its sources.

Each is an entity in the VHDL of a core, which the netlist provides as a module, or a module that does not exist.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fusesoc_firm.accelerator.unit import Libraries, Unit, lines_of, place
from fusesoc_firm.netlist.instantiated import Entity, entities, integer
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, closest
from fusesoc_firm.tools.library_path import library_root
from fusesoc_firm.tools.yosys import source_place

# The name of a core of this package, without its version.
_CORE = re.compile(r"^name: (\w+:\w+:\w+)", re.MULTILINE)
# Returns an entity in a file with the values of its generics, in lower case, or None if its ports are unknown.
EntityReader = Callable[[Path, str, Mapping[str, int]], Unit | None]


def core_with(unit: str) -> str:
    """Return the name of this package's core that has the unit in a file of its name, or an empty text."""
    texts = (path.read_text(encoding="utf-8") for path in (library_root() / "cores").resolve().rglob("*.core"))
    return next((match[1] for text in texts if f"/{unit}.vhd\n" in text and (match := _CORE.search(text))), "")


@dataclass
class Instances:
    """The comparison of instances with the entities in `libraries`, which is called only if a module is missing."""

    libraries: Callable[[], Libraries]
    entity: EntityReader

    @cached_property
    def _libraries(self) -> Libraries:
        return self.libraries()

    @cached_property
    def _entities(self) -> dict[str, Entity]:
        files: dict[str, list[str]] = {}
        for path, library in self._libraries.files:
            files.setdefault(library, []).append(str(path))
        return entities(files)

    def compare(self, modules: Mapping[str, Mapping[str, Any]], paths: Sequence[Path], faults: Diagnostics) -> None:
        """Add the faults of all instances in elaborated modules, as Yosys' JSON has them."""
        for cell in (cell for module in modules.values() for cell in module["cells"].values()):
            kind = str(cell["type"])
            source = place(*source_place(cell["attributes"]) or (paths[0], 1, 1))
            if kind in modules:
                _compare_names(modules[kind], cell, source, faults)
            elif not kind.startswith("$"):
                self._compare(kind, cell, source, faults)

    def _compare(self, kind: str, cell: Mapping[str, Any], source: SourceRef, faults: Diagnostics) -> None:
        if not (entity := self._entities.get(kind)):
            self._report_missing(kind, source, faults)
            return
        if any(name.startswith("$") for name in cell["connections"]):
            faults.error(
                f"'{kind}' is an entity in VHDL, so its ports are connected by name", source, "write .port(net)"
            )
            return
        count = len(faults.found)
        values: dict[str, int] = {}
        for name, value in cell["parameters"].items():
            if not (generic := entity.generics.get(name)):
                message = f"'{kind}' has no parameter '{name}'"
                faults.error(message, _named(name, source), _legal(name, entity.generics))
            elif (number := integer(str(value))) is not None:
                values[name.lower()] = number
            elif generic.type != "string":
                form = "1 for true, and 0 for false," if generic.type == "boolean" else "the number"
                message = f"parameter '{name}' of '{kind}' is a {generic.type}, not a text"
                faults.error(message, _named(name, source), f"write {form} without quotation marks")
        # The sizes of ports depend on the parameters.
        if count == len(faults.found) and (unit := self.entity(entity.path, kind, values)):
            self._compare_ports(unit, entity, cell, source, faults)

    def _compare_ports(
        self, unit: Unit, entity: Entity, cell: Mapping[str, Any], source: SourceRef, faults: Diagnostics
    ) -> None:
        ports = {entity.spelt(port.name): port for port in unit.ports}
        meant = {closest(name, ports) for name in cell["connections"] if name not in ports}
        for name, bits in cell["connections"].items():
            if not (port := ports.get(name)):
                faults.error(f"'{unit.name}' has no port '{name}'", _named(name, source), _legal(name, ports))
            elif bits and port.bits is not None and len(bits) != port.bits:
                hint = size_hint("parameters", entity, name, cell["parameters"])
                message = f"port '{name}' of '{unit.name}' has {port.bits} bits here, and is connected to {len(bits)}"
                faults.error(message, _named(name, source), hint)
        # In the netlist, an input has no default value.
        is_open = {name: port.direction == "in" and not cell["connections"].get(name) for name, port in ports.items()}
        if absent := [f"'{name}'" for name in ports if is_open[name] and name not in meant]:
            what = f"input {absent[0]}" if len(absent) == 1 else f"inputs {', '.join(absent[:-1])} and {absent[-1]}"
            verb, it = ("is", "it") if len(absent) == 1 else ("are", "them")
            faults.error(f"{what} of '{unit.name}' {verb} not connected", source, f"connect {it}")

    def _report_missing(self, kind: str, source: SourceRef, faults: Diagnostics) -> None:
        if core := core_with(kind):
            hint = f"it is in {core}, on which the accelerator's core must depend"
            faults.error(f"there is no module '{kind}' in the sources", source, hint)
        elif self._libraries.is_complete and kind not in self._libraries.generated:
            message = f"there is no module '{kind}' in the sources and in the VHDL of other cores"
            near = closest(kind, self._entities)
            faults.error(message, source, f"did you mean '{near}'?" if near else "add its file to 'sources'")


def size_hint(word: str, entity: Entity, port: str, given: Collection[str] = ()) -> str:
    """Return a hint about the size of a port: the generics that select it, called `word`.

    If all of them are `given`, what is connected may be wrong as well.
    """
    names = entity.sizes(port)
    if not names:
        return ""
    listed = " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
    first = "connect as many bits, or change the" if {*names} <= {*given} else "select the size by the"
    floats = [[name.endswith(end) for name in names] for end in ("EXPONENT_BITS", "MANTISSA_BITS")]
    values = ": 8 and 23 for float32, 11 and 52 for float64" if floats == [[True, False], [False, True]] else ""
    return f"{first} {word} {listed}{values}"


def _compare_names(module: Mapping[str, Any], cell: Mapping[str, Any], source: SourceRef, faults: Diagnostics) -> None:
    """Add the ports of an instance that its module, in one of the sources, does not have."""
    name = str(module["attributes"].get("hdlname", cell["type"])).lstrip("\\")
    for port in cell["connections"]:
        # Ports that are connected by position have numbers.
        if port not in module["ports"] and not port.startswith("$"):
            faults.error(f"'{name}' has no port '{port}'", _named(port, source), _legal(port, module["ports"]))


def _named(name: str, instance: SourceRef) -> SourceRef:
    """Return the place of a parameter's or port's name in the statement of an instance, or else the instance's."""
    path = Path(instance.file)
    lines = lines_of(path)
    position = sum(len(line) + 1 for line in lines[: instance.line - 1]) + instance.column - 1
    text = "\n".join(lines)
    begin, end = text.rfind(";", 0, position) + 1, text.find(";", position)
    found = re.compile(rf"\.\s*({re.escape(name)})\s*\(").search(text, begin, end)
    if not found:
        return instance
    line, column = text.count("\n", 0, found.start(1)), found.start(1) - text.rfind("\n", 0, found.start(1))
    return place(path, line + 1, column, len(name), lines)


def _legal(name: str, names: Iterable[str]) -> str:
    near = closest(name, names)
    return f"did you mean '{near}'?" if near else f"legal here: {', '.join(names) or 'none'}"
