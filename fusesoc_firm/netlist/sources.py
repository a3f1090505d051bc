"""Copy VHDL with corrected functions, for errors in GHDL 2.0's synthesis that are not visible in the netlist.

* `integer - signed` becomes `signed - integer`.
* `resize` of a signed number to fewer bits drops the sign; numeric_std keeps it.
* A product with an integer uses the whole integer; numeric_std truncates the integer to the vector's length.
* A quotient, remainder or comparison with an integer truncates the integer; numeric_std uses the whole integer.

Our functions are declared as aliases in each architecture and package body, because these declarations hide the names
that a use clause makes visible. A copy of the top unit may also contain a `Padding`.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.netlist.padding import Padding

LIBRARY = "firm_numeric"
_RESIZE = """
  function resize (arg : signed; new_size : natural) return signed is
    alias bits : signed(arg'length - 1 downto 0) is arg;
  begin
    if new_size = 0 or new_size >= arg'length then
      return ieee.numeric_std.resize(arg, new_size);
    elsif new_size = 1 then
      return bits(bits'left downto bits'left);
    end if;
    return bits(bits'left) & bits(new_size - 2 downto 0);
  end function resize;

  function resize (arg, size_res : signed) return signed is
  begin
    return resize(arg, size_res'length);
  end function resize;

  function fits (number : integer; length : natural) return boolean is
  begin
    return length > 31 or (number >= -(2 ** (length - 1)) and number <= 2 ** (length - 1) - 1);
  end function fits;

  function fits_unsigned (number : natural; length : natural) return boolean is
  begin
    return length > 30 or number < 2 ** length;
  end function fits_unsigned;
"""
_SUBTRACTION = """
  function "-" (l : integer; r : signed) return signed is
  begin
    return to_signed(l, r'length) - r;
  end function "-";
"""
# Indexed by the vector's type, the integer's type and the operator; the vector may be either operand.
_PRODUCT = """
  function "{0}" (l : {1}; r : {2}) return {1} is
  begin
    return l {0} to_{1}(r, l'length);
  end function "{0}";

  function "{0}" (l : {2}; r : {1}) return {1} is
  begin
    return to_{1}(l, r'length) {0} r;
  end function "{0}";
"""
_QUOTIENT = """
  function "{0}" (l : {1}; r : {2}) return {1} is
  begin
    if {3}(r, l'length) then
      return l {0} to_{1}(r, l'length);
    end if;
    return {4};
  end function "{0}";

  function "{0}" (l : {2}; r : {1}) return {1} is
  begin
    if {3}(l, r'length) then
      return to_{1}(l, r'length) {0} r;
    end if;
    return resize(to_{1}(l, 32) {0} resize(r, 32), r'length);
  end function "{0}";
"""
_WIDE = "resize(resize(l, 32) {0} to_{1}(r, 32), l'length)"
_COMPARISON = """
  function "{0}" (l : {1}; r : {2}) return boolean is
  begin
    if l'length < 32 then
      return resize(l, 32) {0} to_{1}(r, 32);
    end if;
    return ieee.numeric_std."{0}"(l, r);
  end function "{0}";

  function "{0}" (l : {2}; r : {1}) return boolean is
  begin
    if r'length < 32 then
      return to_{1}(l, 32) {0} resize(r, 32);
    end if;
    return ieee.numeric_std."{0}"(l, r);
  end function "{0}";
"""
# In numeric_std, a quotient by an integer that does not fit is zero. A gate computes this zero, since GHDL folds few
# constants.
_BY_LARGE = {"/": "l and to_{1}(0, l'length)", "mod": _WIDE, "rem": _WIDE}
_OPERATORS = {_PRODUCT: ["*"], _QUOTIENT: ["/", "mod", "rem"], _COMPARISON: ["=", "/=", "<", "<=", ">", ">="]}
_NUMBERS = {"signed": ("integer", "fits"), "unsigned": ("natural", "fits_unsigned")}
_FUNCTIONS = (
    _RESIZE
    + _SUBTRACTION
    + "".join(
        text.format(operator, vector, *number, _BY_LARGE.get(operator, "").format(operator, vector))
        for text, operators in _OPERATORS.items()
        for operator in operators
        for vector, number in _NUMBERS.items()
    )
)
_SIGNATURE = re.compile(r'^  (function ("\S+"|resize) \((.*?)\) return (\w+)) is$', re.MULTILINE)
_PACKAGE = f"""library ieee;
use ieee.numeric_std.all;

package numeric is
{"".join(f"  {found[1]};{chr(10)}" for found in _SIGNATURE.finditer(_FUNCTIONS))}end package numeric;

package body numeric is{_FUNCTIONS}end package body numeric;
"""
_COMMENT = re.compile(r"--[^\n]*")
_BODY = re.compile(r"\b(?:architecture\s+\w+\s+of\s+\w+|package\s+body\s+\w+)\s+is\b", re.IGNORECASE)
# An alias does not hide a function that is called by its full name.
_FULL_NAME = re.compile(r'\b(?:ieee\s*\.\s*)?numeric_std\s*\.\s*(?=(?:resize|"[^"]+")\s*\()', re.IGNORECASE)
_TYPES = re.compile(r"\b(?:un)?signed\b", re.IGNORECASE)
TAB = 8  # as GHDL counts columns


def _aliases() -> Iterator[str]:
    for _, name, parameters, result in _SIGNATURE.findall(_FUNCTIONS):
        types = []
        for names, _, type_ in (item.partition(" : ") for item in parameters.split("; ")):
            types += [_full(type_)] * len(names.split(","))
        yield f" alias {name} is {LIBRARY}.numeric.{name} [{', '.join(types)} return {_full(result)}];"


def _full(type_: str) -> str:
    return f"ieee.numeric_std.{type_}" if type_ in _NUMBERS else type_


def _padded(text: str) -> str:
    """Return a text padded to a multiple of the tab width, so that tabs after the text keep their widths."""
    return text + " " * (-len(text) % TAB)


_CONTEXT = _padded(f"library ieee, {LIBRARY};")
_ALIASES = _padded("".join(_aliases()))


@dataclass
class Copies:
    """Copies of files in a folder, and the positions of added text."""

    folder: Path
    padding: Padding
    has_numbers: bool
    files: list[str] = field(default_factory=list)
    _added: list[Mapping[int, Sequence[tuple[int, int]]]] = field(default_factory=list)

    def write_package(self) -> Path:
        """Write the package with our functions, for the library `LIBRARY`; return the file's path."""
        self.folder.mkdir(exist_ok=True)
        package = self.folder / "numeric.vhd"
        package.write_text(_PACKAGE, encoding="latin-1")
        return package

    def copy(self, files: Iterable[str]) -> list[str]:
        """Copy files; return the path of each copy, or the file's own path if no change is needed."""
        return [self._copy(file) for file in files]

    def _copy(self, file: str) -> str:
        text = Path(file).read_bytes().decode("latin-1")
        changed, added = self._changed(text)
        if changed == text:
            return file
        self.folder.mkdir(exist_ok=True)
        copy = self.folder / f"{len(self.files)}.vhd"
        self.files.append(file)
        self._added.append(added)
        copy.write_bytes(changed.encode("latin-1"))
        return str(copy)

    def original(self, text: str) -> str:
        """Return GHDL's output with the names and columns in copies replaced by those in the original files."""
        place = re.compile(rf"{re.escape(str(self.folder))}/(\d+)\.vhd(?::(\d+):(\d+))?")
        text = place.sub(self._place, text)
        for added in filter(None, (_ALIASES, self._padding)):
            with_mark = re.compile(rf"^(.*{re.escape(added)}.*)\n( *\^)$", re.MULTILINE)
            text = with_mark.sub(lambda line: self._without_added(*line.groups()), text)
        return text.replace(f"{self.folder}/", "")

    def _place(self, found: re.Match[str]) -> str:
        file = self.files[int(found[1])]
        if not found[2]:
            return file
        line, column = int(found[2]), int(found[3])
        # A place within added text is reported as the start of that text.
        before = [(start, length) for start, length in self._added[int(found[1])].get(line, ()) if start < column]
        for start, length in reversed(before):
            column = max(start, column - length)
        return f"{file}:{line}:{column}"

    @property
    def _padding(self) -> str:
        return _padded(self.padding.text)

    def _without_added(self, line: str, mark: str) -> str:
        """Return a line that GHDL shows without our additions, and with the caret in the line below shifted."""
        shorter = line
        for added in filter(None, (_CONTEXT, _ALIASES, self._padding)):
            shorter = shorter.replace(added, "")
        return f"{shorter}\n{mark[len(line) - len(shorter) :]}"

    def _changed(self, text: str) -> tuple[str, Mapping[int, Sequence[tuple[int, int]]]]:
        """Return a text with our additions, and the column and length of each addition by line."""
        code = _COMMENT.sub(lambda comment: " " * len(comment[0]), text)
        added: dict[int, list[tuple[int, int]]] = defaultdict(list)
        parts: list[str] = []
        last = 0
        for start, end, new in sorted(self._changes(code)):
            parts += [text[last:start], new]
            last = end
            if start == end:
                line = "".join(parts[:-1]).rpartition("\n")[2].expandtabs(TAB)
                added[text.count("\n", 0, start) + 1].append((len(line) + 1, len(new)))
        return "".join([*parts, text[last:]]), added

    def _changes(self, code: str) -> Iterator[tuple[int, int, str]]:
        """Yield the start and the end of each part of the code to replace, and the new text."""
        if self.has_numbers:
            for place in _FULL_NAME.finditer(code):
                yield place.start(), place.end(), " " * len(place[0])
            for body in _BODY.finditer(code):
                yield body.start(), body.start(), _CONTEXT
                yield body.end(), body.end(), _ALIASES
        if begin := self.padding.place(code):
            yield begin, begin, self._padding


def use_numbers(files: Iterable[str]) -> bool:
    """Return whether any of these files names a type with wrong functions."""
    return any(_TYPES.search(Path(file).read_bytes().decode("latin-1")) for file in files)
