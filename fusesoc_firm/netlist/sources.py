"""Which `-` in VHDL is `integer - signed`; GHDL 2.0 makes the gate of `signed - integer` of it.

Only the operands' types tell, which GHDL knows when it analyses. So it analyses a copy of a file in which a second such
function is visible: each use of the first one is then ambiguous, and reported. They are replaced by `+`, which has the
same types and precedence, until none is left, as an ambiguous operand hides the operator around it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from itertools import pairwise
from pathlib import Path

from fusesoc_firm.netlist.model import NetlistError

_PACKAGE = "firm_second_minus"
_SECOND_MINUS = f"""library ieee;
use ieee.numeric_std.all;
package {_PACKAGE} is
  function "-" (l : integer; r : signed) return signed;
end package {_PACKAGE};
"""
_USE = f" use work.{_PACKAGE}.all;"
_BODY = re.compile(r"\b(?:architecture\s+\w+\s+of\s+\w+|package\s+body\s+\w+)\s+is\b", re.IGNORECASE)
# In GHDL's index of a library: a file's units, and where one begins.
_UNITS = '^file .* "{}" ".*" ".*:\n((?:  .*\n)*)'
_UNIT = re.compile(r"^  (architecture|package body|\w+) .* at \d+\( *(\d+)\)", re.MULTILINE)
_BODIES = {"architecture", "package body"}
_SIGNED = re.compile(r"\bsigned\b", re.IGNORECASE)
_IS_PACKAGE = re.compile(r"^\s*package\b", re.IGNORECASE | re.MULTILINE)
# A message, with all that belongs to it.
_AMBIGUOUS = re.compile(r":(\d+):(\d+): possible interpretations are:\n\S*" + _PACKAGE)
_CALL = '"-"'
_TAB = 8  # as GHDL counts columns

# Analyses files without an effect on the library, and gives GHDL's messages, or nothing if it has none.
Analyse = Callable[..., str]


def of_signed(files: Collection[str]) -> list[str]:
    """The files that can use signed numbers."""
    texts = {name: _text(name) for name in files}
    found = [name for name, text in texts.items() if _SIGNED.search(text)]
    # A package gives the type to files that do not name it.
    return list(texts) if any(_IS_PACKAGE.search(texts[name]) for name in found) else found


def subtractions_from_integers(file: str, index: str, analyse: Analyse, folder: Path) -> Iterator[str]:
    """The places, `file:line:column`, of each `integer - signed` in a file.

    `index` is the text of its library's `.cf`. Copies are made in a folder. Raises `NetlistError` if GHDL's messages
    leave it open.
    """
    package, copy = folder / f"{_PACKAGE}.vhd", folder / "copy.vhd"
    package.write_text(_SECOND_MINUS, encoding="latin-1")
    lines = [line.expandtabs(_TAB) for line in _bodies(file, index).split("\n")]
    while True:
        copy.write_text("\n".join(lines), encoding="latin-1")
        messages = analyse(package, copy)
        places = {(int(line) - 1, int(column) - 1) for line, column in _AMBIGUOUS.findall(messages)}
        if not places:
            break
        for line, column in places:
            before = lines[line][:column]
            start = column - len(_CALL) if before.endswith(_CALL) else column
            yield f"{file}:{line + 1}:{start + 1 - before.count(_USE) * len(_USE)}"
            lines[line] = lines[line][:start] + lines[line][start:].replace("-", "+", 1)
    if messages:
        raise NetlistError(f"{messages}\n{file}: error: GHDL does not report where it subtracts a signed number")


def _bodies(file: str, index: str) -> str:
    """A file's text with the second function in all bodies, and blanks for the units that other files depend on."""
    text = _text(file)
    units = re.search(_UNITS.format(re.escape(file)), index, re.MULTILINE)
    if not units:
        raise NetlistError(f"{file}: error: it is not in GHDL's index of the library")
    starts = [(int(place), kind) for kind, place in _UNIT.findall(units[1])]
    found = ""
    for (start, kind), (end, _) in pairwise([(0, ""), *starts, (len(text), "")]):
        unit = text[start:end]
        found += _BODY.sub(lambda is_: is_[0] + _USE, unit, count=1) if kind in _BODIES else re.sub(r"[^\n]", " ", unit)
    return found


def is_resize(place: str) -> bool:
    """Whether a function of the name `resize` is called at `file:line:column`."""
    name, line, column = place.rsplit(":", 2)
    text = _text(name).split("\n")[int(line) - 1].expandtabs(_TAB)
    return bool(re.match(r"resize\b", text[int(column) - 1 :], re.IGNORECASE))


def _text(name: str) -> str:
    return Path(name).read_bytes().decode("latin-1")
