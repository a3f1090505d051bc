-- SPDX-License-Identifier: Apache-2.0
-- Converts a float64 number to two's complement fixed point, rounded to nearest, ties away from zero.
--
-- Three pipeline registers, one number per cycle, no stalls: distance, shifting, rounding. A number out of range
-- becomes the largest of its sign and sets a flag. A command beyond all limits therefore keeps its direction.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_float64_to_fixed is
  generic (
    -- Bits of the result: 2 to 64.
    WIDTH    : positive := 32;
    -- Fraction bits of the result: 0 to 512. A denormal number becomes 0.
    FRACTION : natural  := 29
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;

    in_valid      : in  std_logic;
    in_number     : in  std_logic_vector(63 downto 0);

    -- High three cycles after in_valid.
    out_valid     : out std_logic;
    out_number    : out std_logic_vector(WIDTH-1 downto 0);
    -- The number is out of range: the result is the largest one, 2**(WIDTH-1) - 1 units, with its sign.
    out_overflow  : out std_logic;
    -- The number is NaN: the result is 0.
    out_undefined : out std_logic
  );
end entity firm_float64_to_fixed;

architecture rtl of firm_float64_to_fixed is

  constant MANTISSA_WIDTH : positive := 53;
  constant SHIFT_WIDTH    : positive := 7;
  -- The exponent of a float64 whose leading one is aligned to the highest bit of a magnitude, and the one above.
  constant TOP_EXPONENT   : integer  := 1023 + WIDTH - 2 - FRACTION;

  subtype magnitude_t is unsigned(WIDTH-2 downto 0);
  -- A magnitude and, below it, the bit that rounds it.
  subtype shifted_t is unsigned(WIDTH-1 downto 0);

  -- The highest bits of a mantissa, as many as there are places.
  function aligned(mantissa : unsigned(MANTISSA_WIDTH-1 downto 0)) return shifted_t is
    variable wide : unsigned(MANTISSA_WIDTH+63 downto 0);
  begin
    wide := mantissa & to_unsigned(0, 64);
    return wide(wide'left downto wide'left-WIDTH+1);
  end function aligned;

  signal valid_r             : std_logic_vector(2 downto 0);

  signal mantissa_r          : shifted_t;
  signal distance_r          : unsigned(SHIFT_WIDTH-1 downto 0);
  signal negative_r          : std_logic;
  signal overflow_r          : std_logic;
  signal undefined_r         : std_logic;

  signal shifted_r           : shifted_t;
  signal shifted_negative_r  : std_logic;
  signal shifted_overflow_r  : std_logic;
  signal shifted_undefined_r : std_logic;

  signal number_r            : signed(WIDTH-1 downto 0);
  signal number_overflow_r   : std_logic;
  signal number_undefined_r  : std_logic;

begin

  assert WIDTH >= 2 and WIDTH <= 64
    report "firm_float64_to_fixed: WIDTH is " & integer'image(WIDTH) & ", legal: 2 to 64"
    severity failure;
  assert FRACTION <= 512
    report "firm_float64_to_fixed: FRACTION is " & integer'image(FRACTION) & ", legal: 0 to 512"
    severity failure;

  out_valid     <= valid_r(2);
  out_number    <= std_logic_vector(number_r);
  out_overflow  <= number_overflow_r;
  out_undefined <= number_undefined_r;

  valid : process (clk)
  begin
    if rising_edge(clk) then
      valid_r <= valid_r(1 downto 0) & in_valid;
      if rst_n = '0' then
        valid_r <= (others => '0');
      end if;
    end if;
  end process valid;

  shift : process (clk)
    variable exponent : unsigned(10 downto 0);
    variable distance : signed(12 downto 0);
    -- Masks of a variable bit: ghdl 2.0 translates a constant of more than 32 ones to a Verilog string.
    variable beyond   : shifted_t;
    variable defined  : shifted_t;
  begin
    if rising_edge(clk) then
      if in_valid = '1' then
        exponent    := unsigned(in_number(62 downto 52));
        distance    := to_signed(TOP_EXPONENT, 13) - signed(resize(exponent, 13));
        mantissa_r  <= aligned(unsigned('1' & in_number(51 downto 0)));
        negative_r  <= in_number(63);
        overflow_r  <= distance(12);
        undefined_r <= '0';
        distance_r  <= unsigned(distance(SHIFT_WIDTH-1 downto 0));
        if distance >= 2**SHIFT_WIDTH then
          distance_r <= (others => '1');
        end if;
        if exponent = 2047 and unsigned(in_number(51 downto 0)) /= 0 then
          overflow_r  <= '0';
          undefined_r <= '1';
        end if;
      end if;

      -- NaN and numbers that are too large are replaced here, so that the next stage has a single carry chain.
      if valid_r(0) = '1' then
        beyond              := (others => overflow_r);
        defined             := (others => not undefined_r);
        shifted_r           <= (shift_right(mantissa_r, to_integer(distance_r)) or beyond) and defined;
        shifted_negative_r  <= negative_r;
        shifted_overflow_r  <= overflow_r;
        shifted_undefined_r <= undefined_r;
        if overflow_r = '1' then
          shifted_r(0) <= '0';
        end if;
      end if;
    end if;
  end process shift;

  round : process (clk)
    variable sign    : signed(WIDTH-1 downto 0);
    variable is_full : std_logic;
    variable carry   : unsigned(0 downto 0);
  begin
    if rising_edge(clk) then
      if valid_r(1) = '1' then
        is_full := '0';
        if shifted_r(0) = '1' and (not shifted_r(WIDTH-1 downto 1)) = 0 then
          is_full := '1';
        end if;
        -- (m + r) and -(m + r) = not m + (1 - r): rounding and sign share the carry chain.
        sign               := (others => shifted_negative_r);
        carry(0)           := (shifted_r(0) and not is_full) xor shifted_negative_r;
        number_r           <= (signed('0' & shifted_r(WIDTH-1 downto 1)) xor sign) + signed('0' & carry);
        number_overflow_r  <= shifted_overflow_r or is_full;
        number_undefined_r <= shifted_undefined_r;
      end if;
    end if;
  end process round;

end architecture rtl;
