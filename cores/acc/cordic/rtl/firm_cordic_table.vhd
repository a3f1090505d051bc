-- SPDX-License-Identifier: Apache-2.0
-- The angles of a CORDIC rotation, atan(2**-i) in rad, as unsigned numbers with 96 fraction bits.
--
-- ieee.math_real has 53 bits, too few for a fraction of 60, and does not synthesise everywhere. The angles are
-- therefore literals. Each is round(atan(2**-i) * 2**96), from the series
-- x - x**3/3 + x**5/5 - ... summed in exact fractions; i = 0 by Machin's 4*atan(1/5) - atan(1/239).
-- tests/applications/test_quat2euler.py recomputes them. This file also contains the inverse of the gain of all
-- rotations.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package firm_cordic_table is

  constant TABLE_FRACTION : positive := 96;
  constant TABLE_LAST     : positive := 63;

  -- atan(2**-index) in rad, rounded to the nearest multiple of 2**-fraction; index <= fraction <= 64.
  function arctangent(index : natural; fraction : positive) return unsigned;

  -- The product of 1/sqrt(1 + 4**-i) over all i, 0.60725, truncated after `fraction` bits; fraction <= 80. For n
  -- rotations it is too small by at most 4**-n, which is negligible against the remaining angle.
  function inverse_gain(fraction : positive) return unsigned;

end package firm_cordic_table;

package body firm_cordic_table is

  subtype angle_t is unsigned(TABLE_FRACTION-1 downto 0);
  type table_t is array (0 to TABLE_LAST) of angle_t;

  constant ARCTANGENTS : table_t := (
    x"c90fdaa22168c234c4c6628c",
    x"76b19c1586ed3da2b7f222f6",
    x"3eb6ebf25901bac55b71e7bd",
    x"1fd5ba9aac2f6dc65912f314",
    x"0ffaaddb967ef4e36cb2792e",
    x"07ff556eea5d892a13bcebbb",
    x"03ffeaab776e5356ef9e3159",
    x"01fffd555bbba972d00c46a4",
    x"00ffffaaaaddddb94bb12afb",
    x"007ffff55556eeeea5ca6adf",
    x"003ffffeaaaab77776e52e5a",
    x"001fffffd55555bbbbba9729",
    x"000ffffffaaaaaaddddddb95",
    x"0007ffffff5555556eeeeeea",
    x"0003ffffffeaaaaaab777777",
    x"0001fffffffd5555555bbbbc",
    x"0000ffffffffaaaaaaaaddde",
    x"00007ffffffff555555556ef",
    x"00003ffffffffeaaaaaaaab7",
    x"00001fffffffffd555555556",
    x"00000ffffffffffaaaaaaaab",
    x"000007ffffffffff55555555",
    x"000003ffffffffffeaaaaaab",
    x"000001fffffffffffd555555",
    x"000000ffffffffffffaaaaab",
    x"0000007ffffffffffff55555",
    x"0000003ffffffffffffeaaab",
    x"0000001fffffffffffffd555",
    x"0000000ffffffffffffffaab",
    x"00000007ffffffffffffff55",
    x"00000003ffffffffffffffeb",
    x"00000001fffffffffffffffd",
    x"000000010000000000000000",
    x"000000008000000000000000",
    x"000000004000000000000000",
    x"000000002000000000000000",
    x"000000001000000000000000",
    x"000000000800000000000000",
    x"000000000400000000000000",
    x"000000000200000000000000",
    x"000000000100000000000000",
    x"000000000080000000000000",
    x"000000000040000000000000",
    x"000000000020000000000000",
    x"000000000010000000000000",
    x"000000000008000000000000",
    x"000000000004000000000000",
    x"000000000002000000000000",
    x"000000000001000000000000",
    x"000000000000800000000000",
    x"000000000000400000000000",
    x"000000000000200000000000",
    x"000000000000100000000000",
    x"000000000000080000000000",
    x"000000000000040000000000",
    x"000000000000020000000000",
    x"000000000000010000000000",
    x"000000000000008000000000",
    x"000000000000004000000000",
    x"000000000000002000000000",
    x"000000000000001000000000",
    x"000000000000000800000000",
    x"000000000000000400000000",
    x"000000000000000200000000"
  );

  constant EXACT_INVERSE_GAIN : unsigned(79 downto 0) := x"9b74eda8435e5a67f5f9";

  function arctangent(index : natural; fraction : positive) return unsigned is
    variable result : unsigned(fraction-1 downto 0);
  begin
    result := ARCTANGENTS(index)(TABLE_FRACTION-1 downto TABLE_FRACTION-fraction);
    if ARCTANGENTS(index)(TABLE_FRACTION-fraction-1) = '1' then
      result := result + 1;
    end if;
    return result;
  end function arctangent;

  function inverse_gain(fraction : positive) return unsigned is
  begin
    return EXACT_INVERSE_GAIN(79 downto 80-fraction);
  end function inverse_gain;

end package body firm_cordic_table;
