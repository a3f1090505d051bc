"""Find constants that GHDL 2.0 replaces with zero: 64, 96, ... bits wide, with bits set only in the highest 32.

In the netlist, a lost constant looks like any other zero. If the netlist contains a zero of one of these widths, a copy
of the sources with probes is therefore synthesised; a probe is a function that reports the value of a constant
expression. GHDL evaluates the probes during synthesis, because all arguments are constant. The same applies to levels
other than 0 and 1.

Constants at ports are restored (`restored_constants`); all others are refused.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

from fusesoc_firm.netlist.model import Instance, Modules, NetlistError
from fusesoc_firm.netlist.probe_functions import USE, WORD
from fusesoc_firm.netlist.probed_source import Probe, Prober, bit_functions
from fusesoc_firm.netlist.vhdl_source import NAME, VhdlSource, is_within

_COMMA = r"\s*,\s*"
# The text after a constant that is used as a whole, or of which an element is used.
_NO_SLICE = r"(?P<index>)(?!\s*(?:'|\(\s*\d+(?:\s+(?:downto|to)\s+\d+)?\s*\)))"
_OF_ELEMENT = r"\s*\((?P<index>[^();]*)\)"
_REPORT = re.compile(rf"firm seen (\d+) (\d+) ([01XZ]{{{WORD + 1}}})")


def may_be_lost(gate: Instance) -> bool:
    """Return whether a gate is a constant that GHDL may have lost: the same level, other than 1, in all bits."""
    is_equal = (gate.kind == "$const_UB32" and not any(gate.numbers)) or gate.kind in {"$const_X", "$const_Z"}
    return is_equal and gate.outputs[0].width > WORD and gate.outputs[0].width % WORD == 0


def widths(modules: Modules) -> set[int]:
    """Return the widths, in bits, of the constants that GHDL may have lost."""
    return {gate.outputs[0].width for module in modules.values() for gate in module.instances if may_be_lost(gate)}


class Copies:
    """Copies of the source files with probes."""

    def __init__(self, files: Iterable[str], folder: Path, widths: Iterable[int]) -> None:
        self.sources = {name: VhdlSource(name) for name in files}
        ordered = sorted(widths)
        types = [type_ for source in self.sources.values() for type_ in bit_functions(source, of_packages=True)]
        bits = {name: text for name, _, text in types}
        functions = {name for source in self.sources.values() for name in source.functions()}
        self.folder = folder
        scalars, others = (
            {name for source in self.sources.values() for name in source.formals(are_scalar=are_scalar)}
            for are_scalar in (True, False)
        )
        self.probes = {
            name: list(Prober(source, ordered).probes(bits, functions, scalars - others))
            for name, source in self.sources.items()
        }
        # The probes in each line of a copy.
        self._lines: dict[str, dict[int, set[Probe]]] = {}
        self._seen: list[tuple[str, int]] = []
        self._right: set[tuple[str, int]] = set()

    @property
    def has_probes(self) -> bool:
        """Whether the sources contain a constant expression to examine."""
        return any(probe.constant for probes in self.probes.values() for probe in probes)

    def write(self) -> dict[str, str]:
        """Write the copies; return a mapping from each source file's name to the name of its copy."""
        self._seen = []
        return {name: self._write(source, index) for index, (name, source) in enumerate(self.sources.items())}

    def _write(self, source: VhdlSource, index: int) -> str:
        copy = str(self.folder / f"{index}.vhd")
        lines: dict[int, set[Probe]] = defaultdict(set)
        text, last = "", 0
        for probe in sorted(self.probes[source.name], key=lambda probe: (probe.start, probe.end)):
            text += source.text[last : probe.start]
            line = text.count("\n") + 1
            if probe.constant:
                self._seen.append((source.name, probe.constant[0]))
            text += probe.text.format(len(self._seen) - 1) if probe.constant else probe.text
            for number in range(line, text.count("\n") + 2) if probe.text != USE else ():
                lines[number].add(probe)
            last = probe.end
        Path(copy).write_bytes((text + source.text[last:]).encode("latin-1"))
        self._lines[copy] = lines
        return copy

    def drop(self, messages: str) -> bool:
        """Drop the probes that GHDL rejects; return False if GHDL rejects none."""
        dropped = False
        for number, (name, probes) in enumerate(self.probes.items()):
            copy = str(self.folder / f"{number}.vhd")
            wrong: set[Probe] = set()
            lines = sorted(self._lines[copy])
            for line in map(int, re.findall(rf"{re.escape(copy)}:(\d+):", messages)):
                # GHDL may report a syntax error at a later line.
                index = bisect_right(lines, line)
                wrong |= self._lines[copy][lines[index - 1]] if index else set()
            dropped = dropped or bool(wrong)
            kept = (probe.other if probe in wrong else probe for probe in probes)
            self.probes[name] = [probe for probe in kept if probe]
        return dropped

    def values(self, messages: str) -> dict[tuple[str, int], set[str]]:
        """Return the values in GHDL's reports by file and position, for all constants that GHDL evaluates."""
        values: dict[tuple[str, int], set[str]] = {place: set() for place in self._seen}
        for number, _, levels in _REPORT.findall(messages):
            values[self._seen[int(number)]].add(levels)
        return values

    def lost(
        self, messages: str, among: set[int], at_ports: Mapping[tuple[str, int], int]
    ) -> Iterator[tuple[str, int]]:
        """Yield the place and the width of each lost constant that GHDL reports with a width in `among`.

        `at_ports` has the width of each constant that instances read at a port if it is lost there, and otherwise 0.
        """
        self._right = {place for place, width in at_ports.items() if not width}
        shown = ((*place, width) for place, width in at_ports.items() if width)
        reported = (
            (*self._seen[int(number)], int(width))
            for number, width, levels in _REPORT.findall(messages)
            if len(set(levels)) > 1 and self._seen[int(number)] not in self._right
        )
        literals = ((name, *found) for name in self.sources for found in self._literals(name))
        for name, position, width in chain(reported, shown, literals):
            declaration = self.sources[name].constant(position)
            if width in among and (not declaration or self._is_used(declaration, _NO_SLICE)):
                yield self.sources[name].place(position), width

    def _literals(self, name: str) -> Iterator[tuple[int, int]]:
        """Yield the literals that GHDL loses; an examined literal counts only if elements of the constant are used."""
        source = self.sources[name]
        seen = sorted(probe.constant for probe in self.probes[name] if probe.constant)
        for position, width in source.literals():
            declaration = source.constant(position)
            if not is_within(position, seen) or (declaration and self._is_used(declaration, _OF_ELEMENT)):
                yield position, width

    def _is_used(self, declaration: re.Match[str], how: str) -> bool:
        """Return whether a constant is used outside its declaration in a form that matches `how`."""
        uses = re.compile(rf"\b(?:{'|'.join(re.split(_COMMA, declaration[2]))})\b{how}", re.IGNORECASE)
        right = {
            name: sorted(
                probe.constant for probe in probes if probe.constant and (name, probe.constant[0]) in self._right
            )
            for name, probes in self.probes.items()
        }
        found = (
            not source.dynamic & set(NAME.findall((use["index"] or "").lower()))
            for source in self.sources.values()
            for use in uses.finditer(source.code)
            if not is_within(use.start(), right[source.name])
        )
        return sum(found) > len(uses.findall(declaration[0]))


def refuse(lost: Sequence[tuple[str, int]]) -> None:
    """Raise `NetlistError` with all lost constants, if there are any."""
    if lost:
        raise NetlistError(
            "\n".join(
                f"{place}: error: GHDL turns a {width}-bit constant into zero if only its highest {WORD} bits are "
                "not zero; make it a signal that is assigned in two slices, or an array element by element"
                for place, width in dict.fromkeys(lost)
            )
        )


def doubt(widths: Iterable[int], message: str) -> str:
    """Return a warning that constants of some widths were not examined, with GHDL's reason."""
    return (
        f"warning: GHDL turns constants with {', '.join(map(str, sorted(widths)))} bits into zero if only their "
        f"highest {WORD} bits are not zero; the search for such constants failed: {message.splitlines()[0]}"
    )
