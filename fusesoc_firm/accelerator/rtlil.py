"""The sources of a module's signals, from Yosys' text of a design (RTLIL) after `proc`.

In other formats, Yosys merges the sources of a signal, so that multiple sources, or a source of an input, are lost.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from fusesoc_firm.accelerator.sources import Fault

# One bit of a wire.
Bit = tuple[str, int]

_WIRE = re.compile(
    r"wire (?:width (?P<width>\d+) )?(?:offset \d+ )?(?:upto )?"
    r"(?:(?P<direction>input|output|inout) \d+ )?(?P<signed>signed )?(?P<name>\S+)"
)
_SLICE = re.compile(r"\[(\d+)(?::(\d+))?\]")
# The width of Verilog's integers. The loop variables of several blocks are one integer.
_INTEGER_BITS = 32
_OUTPUTS = ("\\Y", "\\Q")


@dataclass(frozen=True)
class Wire:
    """A net of a module; `place` is its declaration in Yosys' notation, `file:line.column-...`, or empty."""

    name: str
    width: int
    direction: str
    is_signed: bool
    place: str

    @property
    def bits(self) -> list[Bit]:
        """All bits, the lowest one first."""
        return [(self.name, number) for number in range(self.width)]


@dataclass
class Module:
    """A module: its wires by name, the driven side of each `assign`, and the cells, each with type and connections."""

    wires: dict[str, Wire] = field(default_factory=dict)
    assigned: list[Sequence[str]] = field(default_factory=list)
    cells: list[tuple[str, list[tuple[str, Sequence[str]]]]] = field(default_factory=list)

    def bits_of(self, words: Sequence[str]) -> list[Bit]:
        """Return the bits of the first signal in `words`, which may be a concatenation; constants are omitted."""
        is_list = words[0] == "{"
        end = _closing(words) if is_list else 1
        found: list[Bit] = []
        for number, word in enumerate(words[1:end] if is_list else words[:1], int(is_list)):
            if word in self.wires:
                following = words[number + 1] if number + 1 < len(words) else ""
                found += _sliced(self.wires[word].bits, following)
        return found


def read_modules(text: str) -> dict[str, Module]:
    """Return the modules of a design by their names in RTLIL, which begin with a backslash or a dollar sign."""
    modules: dict[str, Module] = {}
    module, source, is_in_cell = Module(), "", False
    for line in map(str.strip, text.splitlines()):
        key, *words = line.split(" ")
        if key == "module":
            module = modules.setdefault(words[0], Module())
        elif key == "attribute" and words[0] == "\\src":
            source = line.split('"')[1]
        elif key == "wire" and (match := _WIRE.fullmatch(line)):
            name, width = match["name"], int(match["width"] or 1)
            module.wires[name] = Wire(name, width, match["direction"] or "", bool(match["signed"]), source)
            source = ""
        elif key == "cell":
            module.cells.append((words[0], []))
            is_in_cell = True
        elif key == "end":
            is_in_cell = False
        elif key == "connect":
            if is_in_cell:
                module.cells[-1][1].append((words[0], words[1:]))
            else:
                module.assigned.append(words)
    return modules


def sources(modules: dict[str, Module], top: str) -> tuple[Counter[Bit], set[Bit]]:
    """Return the number of sources of each bit of a module, and the bits that unknown modules or inouts may drive."""
    module = modules[top]
    found = Counter(bit for words in module.assigned for bit in module.bits_of(words))
    unknown: set[Bit] = set()
    for type_, ports in module.cells:
        for port, words in ports:
            direction = _direction(type_, port, modules)
            if not direction or direction == "inout":
                unknown |= {*module.bits_of(words)}
            elif direction == "output":
                found.update(module.bits_of(words))
    return found, unknown


def _direction(type_: str, port: str, modules: dict[str, Module]) -> str:
    """Return the direction of a cell's port, or an empty string for an unknown module."""
    if type_ in modules:
        wire = modules[type_].wires.get(port)
        return wire.direction if wire else "input"
    if type_[0] == "\\":
        return ""
    is_output = port in _OUTPUTS or (port == "\\DATA" and type_.startswith("$memrd"))
    return "output" if is_output else "input"


def _closing(words: Sequence[str]) -> int:
    """Return the index of the brace that closes the one at the beginning."""
    depth = 0
    for number, word in enumerate(words):
        depth += {"{": 1, "}": -1}.get(word, 0)
        if not depth:
            return number
    return len(words)


def _sliced(bits: list[Bit], following: str) -> list[Bit]:
    """Return the bits that a slice after a wire's name selects; all of them without a slice."""
    if not (match := _SLICE.fullmatch(following)):
        return bits
    high = int(match[1])
    return bits[int(match[2] or high) : high + 1]


def source_faults(modules: dict[str, Module], top: str) -> Iterator[tuple[Wire, Fault]]:
    """Yield the signals of a module with wrong sources."""
    module = modules.get(top)
    if module is None:
        return
    found, unknown = sources(modules, top)
    for wire in module.wires.values():
        if wire.name[0] != "\\":
            continue
        if wire.direction == "input" and any(found[bit] for bit in wire.bits):
            yield wire, Fault.INPUT
        elif any(found[bit] > 1 for bit in wire.bits) and not (wire.is_signed and wire.width == _INTEGER_BITS):
            yield wire, Fault.SEVERAL
        elif wire.direction == "output" and any(not found[bit] and bit not in unknown for bit in wire.bits):
            yield wire, Fault.PART if any(found[bit] for bit in wire.bits) else Fault.NONE
