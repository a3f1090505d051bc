-- SPDX-License-Identifier: Apache-2.0
-- Functions on numbers as bits, for accelerators that are compiled from Python: comparisons and signs of floating-point
-- numbers of any size, and choices. They are combinational; firm_float has the operations that need several cycles.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

package firm_number_pkg is

  -- '1' if the condition holds.
  function to_bit_of(condition : boolean) return std_logic;

  -- The integer 0 or 1.
  function from_bit(value : std_logic) return std_logic_vector;

  function are_ones(bits : std_logic_vector) return std_logic;

  -- The integer with another number of bits: extended by its sign or by zeros, or its lowest bits. Unlike `resize` of
  -- numeric_std, this also holds for a shorter signed integer.
  function fitted(number : signed; bits : positive) return signed;
  function fitted(number : unsigned; bits : positive) return unsigned;

  -- The nearest integer of a number of bits.
  function saturated(number : signed; bits : positive) return signed;

  -- `one` if the condition is '1', else `other`.
  function chosen(condition : std_logic; one, other : std_logic_vector) return std_logic_vector;
  function chosen(condition, one, other : std_logic) return std_logic;

  -- The number if the condition is '1', else zeros: of numbers of which one at most is selected, the others are zeros.
  function gated(condition : std_logic; number : std_logic_vector) return std_logic_vector;

  -- Floating-point numbers: the sign is the highest bit, and EXPONENT_BITS follow.
  function negated(number : std_logic_vector) return std_logic_vector;
  function magnitude(number : std_logic_vector) return std_logic_vector;
  -- The sign of NaN is positive, whatever its bits.
  function with_sign_of(number, other : std_logic_vector; exponent_bits : positive) return std_logic_vector;
  function is_nan(number : std_logic_vector; exponent_bits : positive) return boolean;

  -- Comparisons of IEEE 754: zeros are equal, and NaN is neither less than any number nor equal to one.
  function is_less(one, other : std_logic_vector; exponent_bits : positive) return std_logic;
  function is_at_most(one, other : std_logic_vector; exponent_bits : positive) return std_logic;
  function is_equal(one, other : std_logic_vector; exponent_bits : positive) return std_logic;

  -- The number; for any NaN, the positive quiet NaN without further bits.
  function quiet(number : std_logic_vector; exponent_bits : positive) return std_logic_vector;

end package firm_number_pkg;

package body firm_number_pkg is

  function to_bit_of(condition : boolean) return std_logic is
  begin
    if condition then
      return '1';
    end if;
    return '0';
  end function to_bit_of;

  function from_bit(value : std_logic) return std_logic_vector is
    variable bits : std_logic_vector(1 downto 0);
  begin
    bits := '0' & value;
    return bits;
  end function from_bit;

  function are_ones(bits : std_logic_vector) return std_logic is
    constant ONES : std_logic_vector(bits'range) := (others => '1');
  begin
    return to_bit_of(bits = ONES);
  end function are_ones;

  function fitted(number : signed; bits : positive) return signed is
    variable wide : signed(number'length+bits-1 downto 0);
  begin
    wide := resize(number, number'length + bits);
    return wide(bits-1 downto 0);
  end function fitted;

  function fitted(number : unsigned; bits : positive) return unsigned is
    variable wide : unsigned(number'length+bits-1 downto 0);
  begin
    wide := resize(number, number'length + bits);
    return wide(bits-1 downto 0);
  end function fitted;

  function saturated(number : signed; bits : positive) return signed is
    variable wide   : signed(number'length+bits-1 downto 0);
    variable result : signed(bits-1 downto 0);
  begin
    wide   := resize(number, number'length + bits);
    result := wide(bits-1 downto 0);
    if resize(result, number'length + bits) /= wide then
      result         := (others => not wide(wide'left));
      result(bits-1) := wide(wide'left);
    end if;
    return result;
  end function saturated;

  function chosen(condition : std_logic; one, other : std_logic_vector) return std_logic_vector is
  begin
    if condition = '1' then
      return one;
    end if;
    return other;
  end function chosen;

  function chosen(condition, one, other : std_logic) return std_logic is
  begin
    if condition = '1' then
      return one;
    end if;
    return other;
  end function chosen;

  function gated(condition : std_logic; number : std_logic_vector) return std_logic_vector is
    variable mask : std_logic_vector(number'length-1 downto 0);
  begin
    mask := (others => condition);
    return number and mask;
  end function gated;

  function negated(number : std_logic_vector) return std_logic_vector is
    variable result : std_logic_vector(number'length-1 downto 0);
  begin
    result              := number;
    result(result'left) := not result(result'left);
    return result;
  end function negated;

  function magnitude(number : std_logic_vector) return std_logic_vector is
    variable result : std_logic_vector(number'length-1 downto 0);
  begin
    result              := number;
    result(result'left) := '0';
    return result;
  end function magnitude;

  function with_sign_of(number, other : std_logic_vector; exponent_bits : positive) return std_logic_vector is
    variable result : std_logic_vector(number'length-1 downto 0);
  begin
    result              := number;
    result(result'left) := other(other'left) and not to_bit_of(is_nan(other, exponent_bits));
    return result;
  end function with_sign_of;

  function is_nan(number : std_logic_vector; exponent_bits : positive) return boolean is
    constant WIDTH : positive := number'length;
    constant ONES  : std_logic_vector(exponent_bits-1 downto 0) := (others => '1');
    constant NONE  : std_logic_vector(WIDTH-exponent_bits-2 downto 0) := (others => '0');
    variable bits  : std_logic_vector(WIDTH-1 downto 0);
  begin
    bits := number;
    return bits(WIDTH-2 downto WIDTH-1-exponent_bits) = ONES and bits(WIDTH-exponent_bits-2 downto 0) /= NONE;
  end function is_nan;

  -- The number with an order of unsigned numbers: negative numbers are inverted, and are below the others.
  function order_of(number : std_logic_vector) return unsigned is
    variable bits : std_logic_vector(number'length-1 downto 0);
  begin
    bits := number;
    if bits(bits'left) = '1' then
      bits := not bits;
    else
      bits(bits'left) := '1';
    end if;
    return unsigned(bits);
  end function order_of;

  function is_zero(number : std_logic_vector) return boolean is
    constant NONE : std_logic_vector(number'length-2 downto 0) := (others => '0');
    variable bits : std_logic_vector(number'length-1 downto 0);
  begin
    bits := number;
    return bits(number'length-2 downto 0) = NONE;
  end function is_zero;

  function is_less(one, other : std_logic_vector; exponent_bits : positive) return std_logic is
  begin
    if is_nan(one, exponent_bits) or is_nan(other, exponent_bits) or (is_zero(one) and is_zero(other)) then
      return '0';
    end if;
    return to_bit_of(order_of(one) < order_of(other));
  end function is_less;

  function is_at_most(one, other : std_logic_vector; exponent_bits : positive) return std_logic is
  begin
    if is_nan(one, exponent_bits) or is_nan(other, exponent_bits) then
      return '0';
    end if;
    return to_bit_of(order_of(one) <= order_of(other) or (is_zero(one) and is_zero(other)));
  end function is_at_most;

  function is_equal(one, other : std_logic_vector; exponent_bits : positive) return std_logic is
  begin
    if is_nan(one, exponent_bits) then
      return '0';
    end if;
    return to_bit_of(one = other or (is_zero(one) and is_zero(other)));
  end function is_equal;

  function quiet(number : std_logic_vector; exponent_bits : positive) return std_logic_vector is
    variable result : std_logic_vector(number'length-1 downto 0);
  begin
    result := number;
    if is_nan(number, exponent_bits) then
      result                                := (others => '0');
      result(number'length-2 downto number'length-2-exponent_bits) := (others => '1');
    end if;
    return result;
  end function quiet;

end package body firm_number_pkg;
