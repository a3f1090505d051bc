-- SPDX-License-Identifier: Apache-2.0
-- The angles of a CORDIC rotation, atan(2**-i) in rad, as unsigned numbers with 96 fraction bits.
--
-- ieee.math_real has 53 bits, too few for a fraction of 60, and does not synthesise everywhere: so the
-- angles stand here as literals. Each is round(atan(2**-i) * 2**96), from the series
-- x - x**3/3 + x**5/5 - ... summed in exact fractions; i = 0 by Machin's 4*atan(1/5) - atan(1/239).
-- tests/applications/test_quat2euler.py computes them again. Beside them stands what undoes the gain of all rotations.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package firm_cordic_table is

  constant TABLE_FRACTION : positive := 96;
  constant TABLE_LAST     : positive := 63;

  -- atan(2**-index) in rad, rounded to the nearest multiple of 2**-fraction; index <= fraction <= 64.
  function arctangent(index : natural; fraction : positive) return unsigned;

  -- The product of 1/sqrt(1 + 4**-i) over all i, 0.60725, cut off behind `fraction` bits; fraction <= 80. Of n
  -- rotations it is 4**-n too small at most, which is nothing beside the angle that they leave over.
  function inverse_gain(fraction : positive) return unsigned;

end package firm_cordic_table;

package body firm_cordic_table is

  subtype angle_t is unsigned(TABLE_FRACTION-1 downto 0);
  type table_t is array (0 to TABLE_LAST) of angle_t;

  constant ARCTANGENTS : table_t := (
    X"C90FDAA22168C234C4C6628C",
    X"76B19C1586ED3DA2B7F222F6",
    X"3EB6EBF25901BAC55B71E7BD",
    X"1FD5BA9AAC2F6DC65912F314",
    X"0FFAADDB967EF4E36CB2792E",
    X"07FF556EEA5D892A13BCEBBB",
    X"03FFEAAB776E5356EF9E3159",
    X"01FFFD555BBBA972D00C46A4",
    X"00FFFFAAAADDDDB94BB12AFB",
    X"007FFFF55556EEEEA5CA6ADF",
    X"003FFFFEAAAAB77776E52E5A",
    X"001FFFFFD55555BBBBBA9729",
    X"000FFFFFFAAAAAADDDDDDB95",
    X"0007FFFFFF5555556EEEEEEA",
    X"0003FFFFFFEAAAAAAB777777",
    X"0001FFFFFFFD5555555BBBBC",
    X"0000FFFFFFFFAAAAAAAADDDE",
    X"00007FFFFFFFF555555556EF",
    X"00003FFFFFFFFEAAAAAAAAB7",
    X"00001FFFFFFFFFD555555556",
    X"00000FFFFFFFFFFAAAAAAAAB",
    X"000007FFFFFFFFFF55555555",
    X"000003FFFFFFFFFFEAAAAAAB",
    X"000001FFFFFFFFFFFD555555",
    X"000000FFFFFFFFFFFFAAAAAB",
    X"0000007FFFFFFFFFFFF55555",
    X"0000003FFFFFFFFFFFFEAAAB",
    X"0000001FFFFFFFFFFFFFD555",
    X"0000000FFFFFFFFFFFFFFAAB",
    X"00000007FFFFFFFFFFFFFF55",
    X"00000003FFFFFFFFFFFFFFEB",
    X"00000001FFFFFFFFFFFFFFFD",
    X"000000010000000000000000",
    X"000000008000000000000000",
    X"000000004000000000000000",
    X"000000002000000000000000",
    X"000000001000000000000000",
    X"000000000800000000000000",
    X"000000000400000000000000",
    X"000000000200000000000000",
    X"000000000100000000000000",
    X"000000000080000000000000",
    X"000000000040000000000000",
    X"000000000020000000000000",
    X"000000000010000000000000",
    X"000000000008000000000000",
    X"000000000004000000000000",
    X"000000000002000000000000",
    X"000000000001000000000000",
    X"000000000000800000000000",
    X"000000000000400000000000",
    X"000000000000200000000000",
    X"000000000000100000000000",
    X"000000000000080000000000",
    X"000000000000040000000000",
    X"000000000000020000000000",
    X"000000000000010000000000",
    X"000000000000008000000000",
    X"000000000000004000000000",
    X"000000000000002000000000",
    X"000000000000001000000000",
    X"000000000000000800000000",
    X"000000000000000400000000",
    X"000000000000000200000000"
  );

  constant EXACT_INVERSE_GAIN : unsigned(79 downto 0) := X"9B74EDA8435E5A67F5F9";

  function arctangent(index : natural; fraction : positive) return unsigned is
    constant EXACT : angle_t := ARCTANGENTS(index);
    variable result : unsigned(fraction-1 downto 0);
  begin
    result := EXACT(TABLE_FRACTION-1 downto TABLE_FRACTION-fraction);
    if EXACT(TABLE_FRACTION-fraction-1) = '1' then
      result := result + 1;
    end if;
    return result;
  end function arctangent;

  function inverse_gain(fraction : positive) return unsigned is
  begin
    return EXACT_INVERSE_GAIN(79 downto 80-fraction);
  end function inverse_gain;

end package body firm_cordic_table;
