-- SPDX-License-Identifier: Apache-2.0
-- The logarithms ln(1 + 2**-i), as unsigned numbers with 96 fraction bits.
--
-- ieee.math_real has 53 bits, too few for float64 with guard bits, and does not synthesise everywhere. The logarithms
-- are therefore literals. Each is round(ln(1 + 2**-i) * 2**96); tests/cores/test_functions.py recomputes them.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package firm_float_log_table is

  constant LOG_TABLE_FRACTION : positive := 96;
  constant LOG_TABLE_LAST     : positive := 32;

  -- ln(1 + 2**-index), rounded to the nearest multiple of 2**-fraction; fraction < 96.
  function logarithm(index : natural; fraction : positive) return unsigned;

end package firm_float_log_table;

package body firm_float_log_table is

  subtype logarithm_t is unsigned(LOG_TABLE_FRACTION-1 downto 0);
  type table_t is array (0 to LOG_TABLE_LAST) of logarithm_t;

  constant LOGARITHMS : table_t := (
    x"b17217f7d1cf79abc9e3b398",
    x"67cc8fb2fe612fcada35d9bd",
    x"391fef8f353443584bb03de6",
    x"1e27076e2af2e5e9ea87ffe2",
    x"0f85186008b15330be64b8b7",
    x"07e0a6c39e0cc0133e3f04f2",
    x"03f815161f807c79f3db4e9a",
    x"01fe02a6b106788fc3769039",
    x"00ff805515885e0250435ab5",
    x"007fe00aa6ac4399e29e3a15",
    x"003ff8015515621f7809a0a3",
    x"001ffe002aa6ab1106678ad9",
    x"000fff8005551558885de027",
    x"0007ffe000aaa6aac443999e",
    x"0003fff80015551556221f78",
    x"0001fffe0002aaa6aab11106",
    x"0000ffff8000555515558888",
    x"00007fffe0000aaaa6aaac44",
    x"00003ffff800015555155562",
    x"00001ffffe00002aaaa6aaab",
    x"00000fffff80000555551555",
    x"000007ffffe00000aaaaa6ab",
    x"000003fffff8000015555515",
    x"000001fffffe000002aaaaa7",
    x"000000ffffff800000555555",
    x"0000007fffffe000000aaaab",
    x"0000003ffffff80000015555",
    x"0000001ffffffe0000002aab",
    x"0000000fffffff8000000555",
    x"00000007ffffffe0000000ab",
    x"00000003fffffff800000015",
    x"00000001fffffffe00000003",
    x"00000000ffffffff80000000"
  );

  function logarithm(index : natural; fraction : positive) return unsigned is
    variable result : unsigned(fraction-1 downto 0);
  begin
    result := LOGARITHMS(index)(LOG_TABLE_FRACTION-1 downto LOG_TABLE_FRACTION-fraction);
    if LOGARITHMS(index)(LOG_TABLE_FRACTION-fraction-1) = '1' then
      result := result + 1;
    end if;
    return result;
  end function logarithm;

end package body firm_float_log_table;
