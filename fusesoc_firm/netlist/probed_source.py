"""The probes for the constants in a VHDL source file (`lost_constants.py`)."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from fusesoc_firm.netlist.probe_functions import ARRAY, RECORD, USE, VECTORS
from fusesoc_firm.netlist.vhdl_source import NAME, SCALAR, VhdlSource, closed, is_within

_ASSIGNMENT = re.compile(
    r"(?:;|=>|\b(?:begin|then|else|loop|generate)\b|\w\s*:)\s*(\w+)\s*(?:<=|:=)([^;]*)(?=;)",
    re.IGNORECASE,
)
# The text between two values of a conditional assignment, or after the last value.
_CONDITION = re.compile(r"\bwhen\b.*?\belse\b|\bwhen\b.*|\bafter\b.*", re.IGNORECASE | re.DOTALL)
_CALL = re.compile(
    r"\b(?:shift_left|shift_right|rotate_left|rotate_right|resize|(?:std_logic_vector|unsigned|signed)\b'?)\s*\(",
    re.IGNORECASE,
)
_GROUP = r"\((?:[^()]|\([^()]*\))*\)"
_OPERAND = rf"""(?:[xb]?"[\da-f_]*"|'.'|\b[a-z][\w.]*(?:'?\s*{_GROUP})?(?![\w.]|\s*')|{_GROUP})"""
_CONCATENATION = re.compile(rf"{_OPERAND}(?:\s*&\s*{_OPERAND})+", re.IGNORECASE)
_RANGE = re.compile(r"\b(?:downto|to|range)\b", re.IGNORECASE)
# Values that are not lost: scalars, and vectors with the same level in all bits.
_KEPT = re.compile(r"open|true|false|'.'|\(\s*others\s*=>\s*'.'\s*\)", re.IGNORECASE)
_OF_ZEROS = re.compile(r"""(?:'0'|[xb]?"[0_]*"|\b(?:others|downto|to|\d+)\b|[\s(),=>|])*""", re.IGNORECASE)


@dataclass(frozen=True)
class Probe:
    """A text that replaces a part of a file; `constant` is the span of the examined expression, if any.

    If GHDL rejects the text, the first text in `others` replaces it.
    """

    start: int
    end: int
    text: str
    constant: tuple[int, int] | None = None
    others: tuple[str, ...] = ()

    @property
    def other(self) -> Probe | None:
        """The probe that replaces this one after GHDL has rejected it, if any."""
        return replace(self, text=self.others[0], others=self.others[1:]) if self.others else None


@dataclass(frozen=True)
class Prober:
    """The probes of a source file; `widths` are those of the types that an aggregate may have."""

    source: VhdlSource
    widths: Sequence[int]

    def probes(self, types: Mapping[str, str], functions: Collection[str], scalars: Collection[str]) -> Iterator[Probe]:
        """Yield the probes of a file; `types` maps each package type to the function that returns its bits.

        `functions` are those whose calls have probes; `scalars` are the ports and generics without probes.
        """
        associated = list(self._associated(scalars))
        yield from (Probe(start, start, USE) for start, _, _ in self.source.units)
        yield from (Probe(end, end, text) for _, end, text in bit_functions(self.source, of_packages=False))
        yield from self._package_types(types, [probe.start for probe in associated if probe.others])
        declarations = self.source.declarations()
        yield from filter(None, map(self._first_value, declarations))
        assigned = list(self._assigned(declarations))
        yield from (*assigned, *associated)
        spans = [
            *(found.span() for found in declarations),
            *((item.start, item.end) for item in chain(assigned, associated)),
        ]
        yield from self._calls(sorted(spans), functions)

    def _package_types(self, types: Mapping[str, str], aggregates: Sequence[int]) -> Iterator[Probe]:
        """Yield the functions of the package types that a body may use.

        The code does not name the type of an aggregate that is an actual value.
        """
        for head, end in self.source.bodies():
            words = set(NAME.findall(self.source.code[head:end].lower()))
            has_aggregates = any(head < start < end for start in aggregates)
            yield from (
                Probe(head, head, text) for name, text in types.items() if has_aggregates or name.lower() in words
            )

    def _first_value(self, found: re.Match[str]) -> Probe | None:
        """Return the probe of a declaration, or None if the value depends on a function's parameters.

        GHDL runs such functions itself.
        """
        is_vector = found[3].strip().lower().startswith(VECTORS)
        if not found[4] or not self._is_constant(*found.span(4)):
            return None
        if self.source.unit(found.start()) == "package" and not is_vector:
            return None
        return self._value(found, *found.span(4))

    def _assigned(self, declarations: Sequence[re.Match[str]]) -> Iterator[Probe]:
        """Yield the probes of assigned values: next to the target's declaration or, for a port, in the assignment."""
        spans = [found.span() for found in declarations]
        declared = {
            (self.source.index(found.start()), name.strip().lower()): found
            for found in declarations
            for name in found[2].split(",")
        }
        for found in _ASSIGNMENT.finditer(self.source.code):
            if not self.source.unit(found.start(1)) or is_within(found.start(1), spans):
                continue
            target = declared.get((self.source.index(found.start(1)), found[1].lower()))
            for start, end in _values(found[2], found.start(2)):
                if self._is_constant(start, end):
                    yield from filter(None, [self._value(target, start, end) if target else self._joined(start, end)])

    def _joined(self, start: int, end: int) -> Probe | None:
        """Return a probe of concatenated vectors; function calls have separate probes."""
        return self._seen(start, end) if "&" in self.source.code[start:end] else None

    def _associated(self, scalars: Collection[str]) -> Iterator[Probe]:
        """Yield the probes of actual and default values of ports and generics, each on a separate line."""
        source = self.source
        for begin, start, end in source.associations():
            value = source.with_literals[start:end]
            is_kept = _KEPT.fullmatch(value) or not source.is_lost(start, end) or source.formal(begin, start) in scalars
            if not is_kept and source.signals.isdisjoint(NAME.findall(source.code[start:end].lower())):
                names = [f"firm_seen_{width}" for width in self.widths] if value.startswith("(") else []
                if probe := self._seen(start, end, *names, "firm_seen"):
                    formal = _escaped(source.text[begin:start])
                    texts = [f"\n{formal}{text}\n" for text in (probe.text, *probe.others)]
                    yield Probe(begin, end, texts[0], probe.constant, tuple(texts[1:]))

    def _calls(self, spans: Sequence[tuple[int, int]], functions: Collection[str]) -> Iterator[Probe]:
        """Yield the probes for concatenated constants and for functions of constants within expressions."""
        last = 0
        call = re.compile(
            rf"{_CALL.pattern}|\b(?:{'|'.join(functions)})\s*\(" if functions else _CALL.pattern, re.IGNORECASE
        )
        code = self.source.code
        calls = ((found.start(), closed(code, found.end()), found.end()) for found in call.finditer(code))
        joined = ((*found.span(), found.start()) for found in _CONCATENATION.finditer(self.source.with_literals))
        for start, end, argument in sorted([*joined, *calls], key=lambda span: (span[0], -span[1])):
            is_apart = start >= last and not is_within(start, spans)
            if is_apart and not _RANGE.search(self.source.code, argument, end) and self._is_constant(argument, end):
                last = end
                if probe := self._seen(start, end):
                    yield replace(probe, text=f"\n{probe.text}\n")

    def _seen(self, start: int, end: int, *functions: str) -> Probe | None:
        value = self.source.text[start:end]
        if _OF_ZEROS.fullmatch(value) or self.source.unit(start) == "entity":
            return None
        first, *others = (f"{name}({_escaped(value)}, {{0}})" for name in functions or ("firm_seen",))
        return Probe(start, end, first, (start, end), tuple(others))

    def _value(self, target: re.Match[str], start: int, end: int) -> Probe | None:
        value, type_ = self.source.text[start:end], self.source.text[slice(*target.span(3))]
        if _OF_ZEROS.fullmatch(value) or SCALAR.match(type_):
            return None
        text = (
            f"\nconstant firm_v{{0}} :{_escaped(type_)} :={_escaped(value)};"
            "\nconstant firm_n{0} : boolean := firm_is_seen(firm_bits(firm_v{0}), {0});\n"
        )
        return Probe(target.end(), target.end(), text, (start, end))

    def _is_constant(self, start: int, end: int) -> bool:
        return self.source.dynamic.isdisjoint(word.lower() for word in NAME.findall(self.source.code[start:end]))


def bit_functions(source: VhdlSource, *, of_packages: bool) -> Iterator[tuple[str, int, str]]:
    """Yield the types of `source.types`, each with the text of the function that returns the bits of its values."""
    for name, end, fields in source.types(of_packages=of_packages):
        bits = " & ".join(f"firm_bits(v.{field})" for field in reversed(fields))
        yield name, end, (RECORD if fields else ARRAY).format(name, "", "", bits)


def _escaped(text: str) -> str:
    return text.replace("{", "{{").replace("}", "}}")


def _values(text: str, start: int) -> Iterator[tuple[int, int]]:
    """Yield the start and end of each value in an assignment, which may be conditional."""
    last = 0
    for found in _CONDITION.finditer(text):
        yield start + last, start + found.start()
        last = found.end()
    if last < len(text):
        yield start + last, start + len(text)
