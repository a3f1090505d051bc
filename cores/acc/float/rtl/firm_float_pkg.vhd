-- SPDX-License-Identifier: Apache-2.0
-- The parts of a floating-point number of any size, and the form in which the stages of an operation exchange numbers.
--
-- A number has one sign bit, EXPONENT_BITS and MANTISSA_BITS: 11 and 52 for float64, 8 and 23 for float32. Between two
-- stages, it is a sign, a kind, an exponent and a magnitude of any width. The highest bit of the magnitude then has the
-- weight 2**(exponent - bias), and the lowest bit is also one if any bit below it is one.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package firm_float_pkg is

  subtype kind_t is std_logic_vector(1 downto 0);

  constant FINITE    : kind_t := "00";
  constant INFINITE  : kind_t := "01";
  constant UNDEFINED : kind_t := "10";

  function kind_of(number : std_logic_vector; exponent_bits : positive) return kind_t;

  -- The exponent with its bias, as a signed number of `width` bits; 1 for zero and subnormal numbers.
  function exponent_of(number : std_logic_vector; exponent_bits : positive; width : positive) return signed;

  -- The mantissa with its leading bit, which is 0 for zero and subnormal numbers.
  function mantissa_of(number : std_logic_vector; exponent_bits : positive) return unsigned;

  function negated(number : std_logic_vector) return std_logic_vector;

  -- A number, unless NaN, as an unsigned one of the same order; -0 is the one before +0.
  function order_of(number : std_logic_vector) return unsigned;

  function is_zero(number : std_logic_vector) return boolean;

  -- The bias of an exponent.
  function bias_of(exponent_bits : positive) return natural;

  -- Bits of a distance that is at most `places`.
  function levels_for(places : natural) return positive;

  -- `number` as an unsigned number of `width` bits: 0 if it is negative, all ones if it is too large.
  function limited(number : signed; width : positive) return unsigned;

  -- Pipeline registers of a shifter with this number of distance bits: one for two bits.
  function stages_for(levels : positive) return positive;

  -- Moved to the right; the lowest bit keeps whether a one has moved out.
  function moved_right(magnitude : unsigned; places : positive) return unsigned;

  -- The highest `width` bits, or all of them and zeros below; the lowest bit keeps whether a one is omitted.
  function fitted(magnitude : unsigned; width : positive) return unsigned;

end package firm_float_pkg;

package body firm_float_pkg is

  function kind_of(number : std_logic_vector; exponent_bits : positive) return kind_t is
    alias    bits     : std_logic_vector(number'length-1 downto 0) is number;
    constant MANTISSA : positive := number'length - 1 - exponent_bits;
  begin
    if (not unsigned(bits(number'length-2 downto MANTISSA))) /= 0 then
      return FINITE;
    elsif unsigned(bits(MANTISSA-1 downto 0)) = 0 then
      return INFINITE;
    end if;
    return UNDEFINED;
  end function kind_of;

  function exponent_of(number : std_logic_vector; exponent_bits : positive; width : positive) return signed is
    alias    bits     : std_logic_vector(number'length-1 downto 0) is number;
    constant MANTISSA : positive := number'length - 1 - exponent_bits;
    variable exponent : unsigned(exponent_bits-1 downto 0);
  begin
    exponent := unsigned(bits(number'length-2 downto MANTISSA));
    if exponent = 0 then
      exponent(0) := '1';
    end if;
    return signed(resize(exponent, width));
  end function exponent_of;

  function mantissa_of(number : std_logic_vector; exponent_bits : positive) return unsigned is
    alias    bits     : std_logic_vector(number'length-1 downto 0) is number;
    constant MANTISSA : positive := number'length - 1 - exponent_bits;
  begin
    if unsigned(bits(number'length-2 downto MANTISSA)) = 0 then
      return unsigned('0' & bits(MANTISSA-1 downto 0));
    end if;
    return unsigned('1' & bits(MANTISSA-1 downto 0));
  end function mantissa_of;

  function negated(number : std_logic_vector) return std_logic_vector is
    alias bits : std_logic_vector(number'length-1 downto 0) is number;
  begin
    return not bits(bits'left) & bits(number'length-2 downto 0);
  end function negated;

  function order_of(number : std_logic_vector) return unsigned is
    alias    bits   : std_logic_vector(number'length-1 downto 0) is number;
    variable result : unsigned(number'length-1 downto 0);
  begin
    result := unsigned(bits);
    if bits(bits'left) = '1' then
      result := not result;
    end if;
    result(bits'left) := not bits(bits'left);
    return result;
  end function order_of;

  function is_zero(number : std_logic_vector) return boolean is
    alias bits : std_logic_vector(number'length-1 downto 0) is number;
  begin
    return unsigned(bits(number'length-2 downto 0)) = 0;
  end function is_zero;

  function bias_of(exponent_bits : positive) return natural is
  begin
    return 2**(exponent_bits-1) - 1;
  end function bias_of;

  function levels_for(places : natural) return positive is
    variable levels : positive := 1;
  begin
    while 2**levels <= places loop
      levels := levels + 1;
    end loop;
    return levels;
  end function levels_for;

  function limited(number : signed; width : positive) return unsigned is
    alias    bits   : signed(number'length-1 downto 0) is number;
    variable result : unsigned(width-1 downto 0);
  begin
    result := resize(unsigned(bits), width);
    if bits(bits'left) = '1' then
      result := (others => '0');
    elsif bits'length > width then
      if shift_right(unsigned(bits), width) /= 0 then
        result := (others => '1');
      end if;
    end if;
    return result;
  end function limited;

  function stages_for(levels : positive) return positive is
  begin
    return (levels + 1) / 2;
  end function stages_for;

  function moved_right(magnitude : unsigned; places : positive) return unsigned is
    alias    bits   : unsigned(magnitude'length-1 downto 0) is magnitude;
    variable result : unsigned(magnitude'length-1 downto 0);
  begin
    result := (others => '0');
    if places < bits'length then
      result(bits'length-1-places downto 0) := bits(bits'length-1 downto places);
      if bits(places-1 downto 0) /= 0 then
        result(0) := '1';
      end if;
    elsif bits /= 0 then
      result(0) := '1';
    end if;
    return result;
  end function moved_right;

  function fitted(magnitude : unsigned; width : positive) return unsigned is
    alias    bits   : unsigned(magnitude'length-1 downto 0) is magnitude;
    variable result : unsigned(width-1 downto 0);
  begin
    result := (others => '0');
    if width < bits'length then
      result := bits(bits'length-1 downto bits'length-width);
      if bits(bits'length-width-1 downto 0) /= 0 then
        result(0) := '1';
      end if;
    else
      result(width-1 downto width-bits'length) := bits;
    end if;
    return result;
  end function fitted;

end package body firm_float_pkg;
