"""The place of additional assignments in the code of an architecture."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from fusesoc_firm.netlist.model import NetlistError
from fusesoc_firm.netlist.padding import Padding
from fusesoc_firm.netlist.translation import Translation, translate

# Each of its declarations contains a word that could be taken for the start of the statements.
AWKWARD = """\
entity top is port (x : in bit; y : out bit); end;
architecture first of other is begin end;
architecture rtl of TOP is
  -- begin
  constant TEXT : string := "begin";
  constant MARK : character := '(';
  function neither (a, b : bit) return bit;
  attribute kept : boolean;
  attribute kept of neither : function is true;
  function neither (a, b : bit) return bit is begin return a nor b; end;
  function both (a : bit := bit'('0'); b : bit) return bit is
    procedure set (z : out bit) is begin z := a; end procedure set;
    variable c : bit;
  begin
    set(c);
    return c and b;
  end function both;
  type pair_t is record a, b : bit; end record;
begin
  y <= both(x, '1');
end architecture rtl;
"""


def test_the_statement_follows_the_architectures_begin() -> None:
    place = Padding("top", 2).place(AWKWARD)
    assert place is not None
    assert AWKWARD[:place].endswith("end record;\nbegin") and AWKWARD[place:].startswith("\n  y <=")
    assert Padding("other", 1).place(AWKWARD) == AWKWARD.index("begin end;") + len("begin")


@pytest.mark.parametrize("padding", [Padding("top", 0), Padding("to", 1), Padding("tops", 1)])
def test_other_units_get_none(padding: Padding) -> None:
    assert padding.place(AWKWARD) is None


@pytest.mark.parametrize("assignments", [1, 13])
def test_the_statement_is_legal(tmp_path: Path, assignments: int) -> None:
    padding = Padding("top", assignments)
    place = padding.place(AWKWARD)
    file = tmp_path / "top.vhd"
    file.write_text(AWKWARD.replace("architecture first of other is begin end;\n", ""))
    code = file.read_text()
    place = padding.place(code)
    file.write_text(code[:place] + padding.text + code[place:])
    subprocess.run(["ghdl", "-a", f"--workdir={tmp_path}", str(file)], check=True)
    assert padding.text.count("<=") == assignments


@pytest.mark.parametrize("numbers", ["", "  signal s : ieee.numeric_std.signed(3 downto 0);\n"])
def test_errors_are_where_the_author_sees_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, numbers: str) -> None:
    """The code after the statement, on its line, has the columns of the original."""
    monkeypatch.setattr("fusesoc_firm.netlist.translation._PADDINGS", (3,))
    file = tmp_path / "top.vhd"
    file.write_text(
        "library ieee;\nentity top is port (x : in bit; y : out bit); end;\n"
        f"architecture rtl of top is\n{numbers}\tbegin y <= unknown; end;\n"
    )
    with pytest.raises(NetlistError) as raised:
        translate(Translation("top", str(tmp_path / "top.v"), {"work": [str(file)]}, {}), tmp_path / "ghdl")
    line, mark = str(raised.value).splitlines()[-2:]
    assert re.match(rf"{re.escape(str(file))}:{5 if numbers else 4}:20:", str(raised.value).splitlines()[-3])
    assert "padding" not in str(raised.value)
    assert line[mark.index("^") :].startswith("unknown")
