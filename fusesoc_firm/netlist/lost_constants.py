"""Constants of which GHDL 2.0 makes zero: those of 64, 96, ... bits of which only the highest 32 have a bit set.

The netlist has a zero for them, as for any other. So it is refused where the VHDL's statement has such a constant, or
the name of one: as a literal, or as an aggregate of one range of bits. One that is computed is not seen.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

from fusesoc_firm.netlist.model import Instance, Modules, NetlistError

_WORD = 32
_COMMENT = re.compile(r"--[^\n]*")
_LITERAL = re.compile(r'x"([0-9a-f_]+)"|"([01_]+)"', re.IGNORECASE)
_AGGREGATE = re.compile(r"\(\s*(\d+)(?:\s+downto\s+(\d+))?\s*=>\s*'1'\s*,\s*others\s*=>\s*'0'\s*\)", re.IGNORECASE)
_DECLARATION = re.compile(r"\bconstant\s+(\w+)\s*:([^;]*)", re.IGNORECASE)
_NAME = re.compile(r"[a-z]\w*", re.IGNORECASE)
# Where a gate is at one of these words, it belongs to all that they enclose.
_COMPOUND = re.compile(r"(?:if|elsif|case|when)\b", re.IGNORECASE)
_SEMICOLON = re.compile(";")
_END = re.compile(r"\bend\b", re.IGNORECASE)


def check(modules: Modules, files: Iterable[str]) -> None:
    """Raise `NetlistError` for a statement with such a constant that is zero in the netlist."""
    zeros = list(_zeros(modules))
    if not zeros:
        return
    texts = {name: _COMMENT.sub("", Path(name).read_text(encoding="latin-1")) for name in files}
    named: dict[int, set[str]] = defaultdict(set)
    for name, value in (found for text in texts.values() for found in _DECLARATION.findall(text)):
        for width in _widths(value):
            named[width].add(name.lower())
    for place, width in zeros:
        file, line, column = place.rsplit(":", 2)
        if file in texts:
            statement = _statement(texts[file], int(line), int(column))
            if width in set(_widths(statement)) or named[width] & set(map(str.lower, _NAME.findall(statement))):
                raise NetlistError(
                    f"{place}: error: GHDL turns a constant of {width} bits into zero if only its highest {_WORD} bits "
                    "are not zero; assign it in two slices"
                )


def _zeros(modules: Modules) -> Iterator[tuple[str, int]]:
    """The places of gates that read a zero of as many bits, and these."""
    for module in modules.values():
        zeros = {gate.outputs[0].number for gate in module.instances if _is_zero(gate)}
        for gate in module.instances:
            for net in gate.inputs:
                if net and net.number in zeros and gate.location:
                    yield gate.location, net.width


def _is_zero(gate: Instance) -> bool:
    if gate.kind != "$const_UB32" or any(gate.numbers):
        return False
    return gate.outputs[0].width > _WORD and gate.outputs[0].width % _WORD == 0


def _statement(text: str, line: int, column: int) -> str:
    """The statement at a place, with what is before it in its line."""
    rest = text.split("\n", line - 1)[-1]
    start = column - 1
    end = (_END if _COMPOUND.match(rest, start) else _SEMICOLON).search(rest, start)
    return rest[:start].rpartition(";")[2] + rest[start : end.start() if end else None]


def _widths(text: str) -> Iterator[int]:
    """The widths of constants in a text that GHDL loses."""
    for digits, bits in _LITERAL.findall(text):
        value = "".join(f"{int(digit, 16):04b}" for digit in digits.replace("_", "")) or bits.replace("_", "")
        if _is_lost(len(value), int(value, 2)):
            yield len(value)
    for high, low in _AGGREGATE.findall(text):
        width = int(high) + 1
        if _is_lost(width, 1 << int(low or high)):
            yield width


def _is_lost(width: int, value: int) -> bool:
    return width > _WORD and width % _WORD == 0 and value > 0 and value % (1 << width - _WORD) == 0
