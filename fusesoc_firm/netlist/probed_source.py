"""A VHDL source file with the probes for its constants (`lost_constants.py`)."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path

from fusesoc_firm.netlist.probe_functions import ARRAY, RECORD, USE, VECTORS, WORD
from fusesoc_firm.netlist.sources import TAB

_ARROW = "=>"
_HIDDEN = re.compile(r'--[^\n]*|\b[box]"[^"\n]*"|"[^"\n]*"', re.IGNORECASE)
_UNIT = re.compile(
    r"\b(?:(entity)\s+\w+\s+is|(architecture)\s+\w+\s+of\s+\w+\s+is|(package)\s+(?:(body)\s+)?\w+\s+is)\b",
    re.IGNORECASE,
)
_TYPE = re.compile(
    r"\btype\s+(\w+)\s+is\s+(?:array\b[^;]*;|record\b(.*?)\bend\s+record\b[^;]*;)", re.IGNORECASE | re.DOTALL
)
_NAMES = r"\b(\w+(?:\s*,\s*\w+)*)\s*:(?!=)"
_FIELDS = re.compile(_NAMES)
_OBJECT = re.compile(rf"\b(constant|signal|variable)\s+{_NAMES}([^;]*?)(?::=([^;]*))?;", re.IGNORECASE)
_SIGNAL, _VARIABLE = (re.compile(rf"\b{kind}\s+{_NAMES}", re.IGNORECASE) for kind in ("signal", "variable"))
_INTERFACE = re.compile(r"\b(generic|port|function|procedure)\b[^()]*\(", re.IGNORECASE)
_MAP = re.compile(r"\b(?:generic|port)\s+map\s*\(", re.IGNORECASE)
_SCALAR = re.compile(
    r"\s*(?:integer|natural|positive|boolean|std_u?logic|bit|time|real|string|character)\b", re.IGNORECASE
)
_FORMAL = re.compile(rf"\s*(?:(?:constant|signal)\s+)?{_NAMES}\s*(?:(?:in|out|inout|buffer)\b)?", re.IGNORECASE)
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
_FUNCTION = re.compile(r"\bfunction\s+(\w+)\s*(\()?", re.IGNORECASE)
_RETURN = re.compile(r"\s*return\b", re.IGNORECASE)
_RANGE = re.compile(r"\b(?:downto|to|range)\b", re.IGNORECASE)
NAME = re.compile(r"(?<![\w'])[a-z]\w*", re.IGNORECASE)
_LITERAL = re.compile(r'(?<!\w)(?:x"([0-9a-f_]+)"|b?"([01_]+)")', re.IGNORECASE)
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


class Source:
    """A source file with the probes for its constants."""

    def __init__(self, name: str, widths: Iterable[int]) -> None:
        self.name = name
        self._widths = sorted(widths)
        self.text = Path(name).read_bytes().decode("latin-1")
        # Comments and the contents of literals are replaced by blanks, so that all positions remain valid.
        self.code = _HIDDEN.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), self.text)
        self._with_literals = _HIDDEN.sub(
            lambda found: " " * len(found[0]) if found[0].startswith("--") else found[0], self.text
        )
        self.units = [
            (found.start(), found.end(), (found[1] or found[2] or found[4] or found[3]).lower())
            for found in _UNIT.finditer(self.code)
        ]
        self.signals = _split([*_SIGNAL.findall(self.code), *self._parameters({"port"})])
        parameters = self._parameters({"function", "procedure"})
        self.dynamic = self.signals | _split([*_VARIABLE.findall(self.code), *parameters])
        self.constants = [item for item in _OBJECT.finditer(self.code) if item[1].lower() == "constant"]
        self._begins = [start for start, _, _ in self.units]
        # The number of open parentheses before each parenthesis, and the positions of the parentheses.
        self._depths = [0]
        self._parentheses = []
        for parenthesis in re.finditer(r"[()]", self.code):
            self._parentheses.append(parenthesis.start())
            self._depths.append(self._depths[-1] + (1 if parenthesis[0] == "(" else -1))

    def _parameters(self, kinds: set[str]) -> Iterator[str]:
        for found in _INTERFACE.finditer(self.code):
            if found[1].lower() in kinds:
                yield from _FIELDS.findall(self.code, found.end(), _closed(self.code, found.end()))

    def place(self, position: int) -> str:
        """Return `file:line:column` for a position."""
        before = self.text[:position]
        return f"{self.name}:{before.count(chr(10)) + 1}:{position - before.rfind(chr(10))}"

    def unit(self, position: int) -> str:
        """Return the kind of the unit around a position, or an empty string within the parentheses of an interface."""
        index = bisect_right(self._begins, position)
        is_inside = self._depths[bisect_right(self._parentheses, position)]
        return self.units[index - 1][2] if index and not is_inside else ""

    def _index(self, position: int) -> int:
        return bisect_right(self._begins, position)

    def constant(self, position: int) -> re.Match[str] | None:
        """Return the constant declaration around a position, or None."""
        return next((found for found in self.constants if found.start() <= position < found.end()), None)

    def types(self, *, of_packages: bool) -> Iterator[tuple[str, int, str]]:
        """Yield the array and record types in packages, or all others: name, end, and the function for the bits."""
        for found in _TYPE.finditer(self.code):
            kind = self.unit(found.start())
            if kind and (kind == "package") == of_packages:
                fields = [name.strip() for names in _FIELDS.findall(found[2] or "") for name in names.split(",")]
                bits = " & ".join(f"firm_bits(v.{name})" for name in reversed(fields))
                yield found[1], found.end(), (RECORD if fields else ARRAY).format(found[1], "", "", bits)

    def literals(self) -> Iterator[tuple[int, int]]:
        """Yield the position and width of each literal that GHDL loses."""
        for found in _LITERAL.finditer(self._with_literals):
            digits = (found[1] or found[2]).replace("_", "")
            width, value = (4 * len(digits), int(digits, 16)) if found[1] else (len(digits), int(digits, 2))
            if width > WORD and width % WORD == 0 and value and value % (1 << width - WORD) == 0:
                yield found.start(), width

    def probes(self, types: Mapping[str, str], functions: Collection[str], scalars: Collection[str]) -> Iterator[Probe]:
        """Yield the probes of a file; `types` maps each package type to the function that returns its bits.

        `functions` are those whose calls have probes; `scalars` are the ports and generics without probes.
        """
        yield from (Probe(start, start, USE) for start, _, _ in self.units)
        yield from (Probe(end, end, text) for _, end, text in self.types(of_packages=False))
        associated = list(self._associated(scalars))
        aggregates = [probe.start for probe in associated if probe.others]
        ends = [*self._begins[1:], len(self.code)]
        for (_, head, kind), end in zip(self.units, ends, strict=True):
            if kind in {"architecture", "body"}:
                words = set(NAME.findall(self.code[head:end].lower()))
                # The code does not name the type of an aggregate that is an actual value.
                has_aggregates = any(head < start < end for start in aggregates)
                yield from (
                    Probe(head, head, text) for name, text in types.items() if has_aggregates or name.lower() in words
                )
        declarations = [found for found in _OBJECT.finditer(self.code) if self.unit(found.start())]
        declared = {
            (self._index(found.start()), name.strip().lower()): found
            for found in declarations
            for name in found[2].split(",")
        }
        yield from filter(None, map(self._first_value, declarations))
        spans = [found.span() for found in declarations]
        assigned = list(self._assigned(declared, spans))
        yield from (*assigned, *associated)
        yield from self._calls(
            sorted([*spans, *((probe.start, probe.end) for probe in (*assigned, *associated))]), functions
        )

    def _first_value(self, found: re.Match[str]) -> Probe | None:
        """Return the probe of a declaration, or None if the value depends on a function's parameters.

        GHDL runs such functions itself.
        """
        is_vector = found[3].strip().lower().startswith(VECTORS)
        if not found[4] or not self._is_constant(*found.span(4)):
            return None
        if self.unit(found.start()) == "package" and not is_vector:
            return None
        return self._value(found, *found.span(4))

    def _assigned(
        self, declared: Mapping[tuple[int, str], re.Match[str]], spans: Sequence[tuple[int, int]]
    ) -> Iterator[Probe]:
        """Yield the probes of assigned values: next to the target's declaration or, for a port, in the assignment."""
        for found in _ASSIGNMENT.finditer(self.code):
            if not self.unit(found.start(1)) or is_within(found.start(1), spans):
                continue
            target = declared.get((self._index(found.start(1)), found[1].lower()))
            for start, end in _values(found[2], found.start(2)):
                if self._is_constant(start, end):
                    yield from filter(None, [self._value(target, start, end) if target else self._joined(start, end)])

    def _joined(self, start: int, end: int) -> Probe | None:
        """Return a probe of concatenated vectors; function calls have separate probes."""
        return self._seen(start, end) if "&" in self.code[start:end] else None

    def _associated(self, scalars: Collection[str]) -> Iterator[Probe]:
        """Yield the probes of actual and default values of ports and generics, each on a separate line."""
        lost = {position for position, _ in self.literals()}
        for begin, start, end in chain(self._actuals(), self._defaults()):
            value = self._with_literals[start:end]
            is_kept = _KEPT.fullmatch(value) or (_LITERAL.fullmatch(value) and start not in lost)
            is_kept = is_kept or self._formal(begin, start) in scalars
            if not is_kept and self.signals.isdisjoint(NAME.findall(self.code[start:end].lower())):
                names = [f"firm_seen_{width}" for width in self._widths] if value.startswith("(") else []
                if probe := self._seen(start, end, *names, "firm_seen"):
                    formal = _escaped(self.text[begin:start])
                    texts = [f"\n{formal}{text}\n" for text in (probe.text, *probe.others)]
                    yield Probe(begin, end, texts[0], probe.constant, tuple(texts[1:]))

    def _actuals(self, begin: int = 0, end: int | None = None) -> Iterator[tuple[int, int, int]]:
        """Yield the start, the start of the value and the end of each association in a port or generic map."""
        for found in _MAP.finditer(self.code, begin, len(self.code) if end is None else end):
            for start, stop in _parts(self.code, found.end(), ","):
                _, arrow = next(_parts(self.code, start, "="))
                has_name = arrow < stop and self.code.startswith(_ARROW, arrow)
                yield self._trimmed(start, arrow + len(_ARROW) if has_name else start, stop)

    def port_map(self, line: int, column: int) -> Iterator[tuple[str, int]]:
        """Yield the port and the value's start of each association in the instance with this place."""
        lines = self.text.split("\n")
        widths = (len(lines[line - 1][:length].expandtabs(TAB)) for length in range(column))
        before = bisect_left(list(widths), column - 1)
        begin = sum(len(text) + 1 for text in lines[: line - 1]) + before
        end = self.code.find(";", begin)
        for start, value, _ in self._actuals(begin, end):
            yield self._formal(start, value), value

    def _formal(self, start: int, value: int) -> str:
        return self.code[start:value].partition(_ARROW)[0].strip().lower()

    def _defaults(self) -> Iterator[tuple[int, int, int]]:
        """Yield the same positions for the default value of each vector among ports and generics."""
        for _, start, end in self._formals:
            initial = self.code.find(":=", start, end)
            if initial >= 0 and not _SCALAR.match(self.code, start):
                yield self._trimmed(initial + 2, initial + 2, end)

    @cached_property
    def _formals(self) -> list[tuple[str, int, int]]:
        """The names, the start of the type and the end of each declaration of ports or generics."""
        return [
            (formal[1], formal.end(), end)
            for found in _INTERFACE.finditer(self.code)
            if found[1].lower() in {"generic", "port"}
            for start, end in _parts(self.code, found.end(), ";")
            if (formal := _FORMAL.match(self.code, start, end))
        ]

    def formals(self, *, are_scalar: bool) -> set[str]:
        """Return the names of ports and generics with scalar types, or of all others."""
        return _split(names for names, start, _ in self._formals if bool(_SCALAR.match(self.code, start)) == are_scalar)

    def _trimmed(self, begin: int, start: int, end: int) -> tuple[int, int, int]:
        """Return the positions without the blanks and comments around the value."""
        value = self._with_literals[start:end]
        first = start + len(value) - len(value.lstrip())
        return (begin if begin < start else first), first, start + len(value.rstrip())

    def functions(self) -> Iterator[str]:
        """Yield the names of the functions that return no scalar."""
        for found in _FUNCTION.finditer(self.code):
            end = _closed(self.code, found.end()) if found[2] else found.end()
            result = _RETURN.match(self.code, end)
            if result and not _SCALAR.match(self.code, result.end()):
                yield found[1].lower()

    def _calls(self, spans: Sequence[tuple[int, int]], functions: Collection[str]) -> Iterator[Probe]:
        """Yield the probes for concatenated constants and for functions of constants within expressions."""
        last = 0
        call = re.compile(
            rf"{_CALL.pattern}|\b(?:{'|'.join(functions)})\s*\(" if functions else _CALL.pattern, re.IGNORECASE
        )
        calls = ((found.start(), _closed(self.code, found.end()), found.end()) for found in call.finditer(self.code))
        joined = ((*found.span(), found.start()) for found in _CONCATENATION.finditer(self._with_literals))
        for start, end, argument in sorted([*joined, *calls], key=lambda span: (span[0], -span[1])):
            is_apart = start >= last and not is_within(start, spans)
            if is_apart and not _RANGE.search(self.code, argument, end) and self._is_constant(argument, end):
                last = end
                if probe := self._seen(start, end):
                    yield replace(probe, text=f"\n{probe.text}\n")

    def _seen(self, start: int, end: int, *functions: str) -> Probe | None:
        value = self.text[start:end]
        if _OF_ZEROS.fullmatch(value) or self.unit(start) == "entity":
            return None
        first, *others = (f"{name}({_escaped(value)}, {{0}})" for name in functions or ("firm_seen",))
        return Probe(start, end, first, (start, end), tuple(others))

    def _value(self, target: re.Match[str], start: int, end: int) -> Probe | None:
        value, type_ = self.text[start:end], self.text[slice(*target.span(3))]
        if _OF_ZEROS.fullmatch(value) or _SCALAR.match(type_):
            return None
        text = (
            f"\nconstant firm_v{{0}} :{_escaped(type_)} :={_escaped(value)};"
            "\nconstant firm_n{0} : boolean := firm_is_seen(firm_bits(firm_v{0}), {0});\n"
        )
        return Probe(target.end(), target.end(), text, (start, end))

    def _is_constant(self, start: int, end: int) -> bool:
        return self.dynamic.isdisjoint(word.lower() for word in NAME.findall(self.code[start:end]))


def is_within(position: int, spans: Sequence[tuple[int, int]]) -> bool:
    """Return whether one of the sorted spans, none of which overlap, contains a position."""
    index = bisect_right(spans, (position, float("inf"))) - 1
    return index >= 0 and position < spans[index][1]


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


def _closed(code: str, start: int) -> int:
    """Return the position after the parenthesis that closes the one just before `start`."""
    depth = 1
    for position in range(start, len(code)):
        depth += {"(": 1, ")": -1}.get(code[position], 0)
        if not depth:
            return position + 1
    return len(code)


def _parts(code: str, start: int, separator: str) -> Iterator[tuple[int, int]]:
    """Yield the start and end of each part of a text from `start` to the parenthesis that closes it."""
    depth = 0
    for found in re.compile(rf"[(){separator}]").finditer(code, start):
        if not depth and found[0] != "(":
            yield start, found.start()
            start = found.end()
        depth += {"(": 1, ")": -1}.get(found[0], 0)
        if depth < 0:
            break


def _split(lists: Iterable[str]) -> set[str]:
    return {name.strip().lower() for names in lists for name in names.split(",")}
