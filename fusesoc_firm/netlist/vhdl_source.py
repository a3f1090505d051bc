"""A VHDL source file, read without a grammar: its units, declarations, associations and literals by their positions."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import chain
from pathlib import Path

from fusesoc_firm.netlist.probe_functions import WORD
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
SCALAR = re.compile(
    r"\s*(?:integer|natural|positive|boolean|std_u?logic|bit|time|real|string|character)\b", re.IGNORECASE
)
_FORMAL = re.compile(rf"\s*(?:(?:constant|signal)\s+)?{_NAMES}\s*(?:(?:in|out|inout|buffer)\b)?", re.IGNORECASE)
_FUNCTION = re.compile(r"\bfunction\s+(\w+)\s*(\()?", re.IGNORECASE)
_RETURN = re.compile(r"\s*return\b", re.IGNORECASE)
NAME = re.compile(r"(?<![\w'])[a-z]\w*", re.IGNORECASE)
_LITERAL = re.compile(r'(?<!\w)(?:x"([0-9a-f_]+)"|b?"([01_]+)")', re.IGNORECASE)


class VhdlSource:
    """A source file.

    `code` is the text without comments and literals, `with_literals` without comments. Blanks replace both, so that all
    positions remain valid.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.text = Path(name).read_bytes().decode("latin-1")
        self.code = _HIDDEN.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), self.text)
        self.with_literals = _HIDDEN.sub(
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
                yield from _FIELDS.findall(self.code, found.end(), closed(self.code, found.end()))

    def place(self, position: int) -> str:
        """Return `file:line:column` for a position."""
        before = self.text[:position]
        return f"{self.name}:{before.count(chr(10)) + 1}:{position - before.rfind(chr(10))}"

    def unit(self, position: int) -> str:
        """Return the kind of the unit around a position, or an empty string within the parentheses of an interface."""
        index = bisect_right(self._begins, position)
        is_inside = self._depths[bisect_right(self._parentheses, position)]
        return self.units[index - 1][2] if index and not is_inside else ""

    def index(self, position: int) -> int:
        """Return the number of the unit around a position, from 1."""
        return bisect_right(self._begins, position)

    def bodies(self) -> Iterator[tuple[int, int]]:
        """Yield the positions after the first line and at the end of each architecture and package body."""
        ends = [*self._begins[1:], len(self.code)]
        for (_, head, kind), end in zip(self.units, ends, strict=True):
            if kind in {"architecture", "body"}:
                yield head, end

    def declarations(self) -> list[re.Match[str]]:
        """Return the declarations of constants, signals and variables: kind, names, type, value."""
        return [found for found in _OBJECT.finditer(self.code) if self.unit(found.start())]

    def constant(self, position: int) -> re.Match[str] | None:
        """Return the constant declaration around a position, or None."""
        return next((found for found in self.constants if found.start() <= position < found.end()), None)

    def types(self, *, of_packages: bool) -> Iterator[tuple[str, int, list[str]]]:
        """Yield the array and record types in packages, or all others: name, end, and the fields of a record."""
        for found in _TYPE.finditer(self.code):
            kind = self.unit(found.start())
            if kind and (kind == "package") == of_packages:
                fields = [name.strip() for names in _FIELDS.findall(found[2] or "") for name in names.split(",")]
                yield found[1], found.end(), fields

    def literals(self) -> Iterator[tuple[int, int]]:
        """Yield the position and width of each literal that GHDL loses."""
        for found in _LITERAL.finditer(self.with_literals):
            digits = (found[1] or found[2]).replace("_", "")
            width, value = (4 * len(digits), int(digits, 16)) if found[1] else (len(digits), int(digits, 2))
            if width > WORD and width % WORD == 0 and value and value % (1 << width - WORD) == 0:
                yield found.start(), width

    def associations(self) -> Iterator[tuple[int, int, int]]:
        """Yield the start, the start of the value and the end of each actual or default value of a port or generic."""
        return chain(self._actuals(), self._defaults())

    def is_lost(self, start: int, end: int) -> bool:
        """Return whether a span is not a literal, or one that GHDL loses."""
        return not _LITERAL.fullmatch(self.with_literals, start, end) or start in self._lost

    @cached_property
    def _lost(self) -> set[int]:
        return {position for position, _ in self.literals()}

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
            yield self.formal(start, value), value

    def formal(self, start: int, value: int) -> str:
        """Return the name of the port or generic in an association."""
        return self.code[start:value].partition(_ARROW)[0].strip().lower()

    def _defaults(self) -> Iterator[tuple[int, int, int]]:
        """Yield the same positions for the default value of each vector among ports and generics."""
        for _, start, end in self._formals:
            initial = self.code.find(":=", start, end)
            if initial >= 0 and not SCALAR.match(self.code, start):
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
        return _split(names for names, start, _ in self._formals if bool(SCALAR.match(self.code, start)) == are_scalar)

    def _trimmed(self, begin: int, start: int, end: int) -> tuple[int, int, int]:
        """Return the positions without the blanks and comments around the value."""
        value = self.with_literals[start:end]
        first = start + len(value) - len(value.lstrip())
        return (begin if begin < start else first), first, start + len(value.rstrip())

    def functions(self) -> Iterator[str]:
        """Yield the names of the functions that return no scalar."""
        for found in _FUNCTION.finditer(self.code):
            end = closed(self.code, found.end()) if found[2] else found.end()
            result = _RETURN.match(self.code, end)
            if result and not SCALAR.match(self.code, result.end()):
                yield found[1].lower()


def is_within(position: int, spans: Sequence[tuple[int, int]]) -> bool:
    """Return whether one of the sorted spans, none of which overlap, contains a position."""
    index = bisect_right(spans, (position, float("inf"))) - 1
    return index >= 0 and position < spans[index][1]


def closed(code: str, start: int) -> int:
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
