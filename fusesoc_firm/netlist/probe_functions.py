"""The VHDL functions of the probes for constants that GHDL 2.0 replaces with zero (`lost_constants.py`).

A function returns its argument, and reports its highest bits if GHDL would lose it.
"""

from __future__ import annotations

from collections.abc import Iterable

LIBRARY = "firm_probes"
WORD = 32
VECTORS = ("std_logic_vector", "unsigned", "signed")
_DOWN = "({} downto 0)"
_SEEN = """
function firm_seen{1} (v : {0}{2}; n : natural) return {0} is
  constant is_seen : boolean := firm_is_seen(firm_bits(v), n);
begin
  return v;
end function firm_seen{1};
"""
_PER_VECTOR = (
    """
  function firm_bits (v : {0}) return std_logic_vector is
  begin
    return std_logic_vector(v);
  end function firm_bits;
"""
    + _SEEN
)
_PACKAGE = f"""library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package probes is
  function firm_is_seen (v : std_logic_vector; n : natural) return boolean;
  function firm_bits (v : std_ulogic) return std_logic_vector;
{
    "".join(
        f'''  function firm_bits (v : {name}) return std_logic_vector;
  function firm_seen (v : {name}; n : natural) return {name};
'''
        for name in VECTORS
    )
}end package probes;

package body probes is
  function level (v : std_ulogic) return character is
  begin
    case v is
      when '0' | 'L' => return '0';
      when '1' | 'H' => return '1';
      when 'Z' => return 'Z';
      when others => return 'X';
    end case;
  end function level;

  -- Report the levels of the highest bits and of all others if these are equal and not '1'.
  function firm_is_seen (v : std_logic_vector; n : natural) return boolean is
    constant bits : std_logic_vector(0 to v'length - 1) := v;
    variable levels : string(1 to {WORD + 1});
  begin
    if v'length <= {WORD} or v'length mod {WORD} /= 0 then
      return false;
    end if;
    for i in levels'range loop
      levels(i) := level(bits(i - 1));
    end loop;
    if levels(levels'right) = '1' then
      return false;
    end if;
    for i in {WORD} to bits'right loop
      if level(bits(i)) /= levels(levels'right) then
        return false;
      end if;
    end loop;
    report "firm seen " & integer'image(n) & " " & integer'image(v'length) & " " & levels severity warning;
    return true;
  end function firm_is_seen;

  function firm_bits (v : std_ulogic) return std_logic_vector is
    constant bits : std_logic_vector(0 to 0) := (others => v);
  begin
    return bits;
  end function firm_bits;
{"".join(_PER_VECTOR.format(name, "", "") for name in VECTORS)}end package body probes;
"""
ARRAY = (
    """
function firm_bits (v : {0}) return std_logic_vector is
  constant first : std_logic_vector := firm_bits(v(v'left));
  variable found : std_logic_vector(0 to v'length * first'length - 1);
  variable place : natural := 0;
begin
  for i in v'range loop
    found(place to place + first'length - 1) := firm_bits(v(i));
    place := place + first'length;
  end loop;
  return found;
end function firm_bits;
"""
    + _SEEN
)
RECORD = (
    """
function firm_bits (v : {0}) return std_logic_vector is
begin
  return {3};
end function firm_bits;
"""
    + _SEEN
)
# Functions for aggregates, whose width and direction only a constrained parameter determines.
_OF_WIDTHS = """library ieee, {0};
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use {0}.probes.all;

package of_widths is
{1}end package of_widths;

package body of_widths is
{2}end package body of_widths;
"""
USE = (
    f" library ieee, {LIBRARY}; use ieee.std_logic_1164.std_logic_vector; "
    f"use {LIBRARY}.probes.all; use {LIBRARY}.of_widths.all; "
)


def package(widths: Iterable[int]) -> str:
    """Return the packages with the functions of the probes, for constants of these widths."""
    functions = [
        _SEEN.format(name, f"_{width}", _DOWN.format(width - 1)) for width in sorted(widths) for name in VECTORS
    ]
    heads = (text.partition(" is\n")[0] + ";" for text in functions)
    return _PACKAGE + _OF_WIDTHS.format(LIBRARY, "".join(heads), "".join(functions))
