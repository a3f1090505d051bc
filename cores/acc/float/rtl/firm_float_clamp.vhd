-- SPDX-License-Identifier: Apache-2.0
-- Limits a floating-point number: at least `low`, then at most `high`.
--
-- With one limit infinite, it is the minimum or the maximum of two numbers. NaN in any operand gives NaN. -0 is below
-- +0. A pipeline: one result in every cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_clamp is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52
  );
  port (
    clk        : in  std_logic;
    rst_n      : in  std_logic;

    in_valid   : in  std_logic;
    in_ready   : out std_logic;
    in_number  : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_low     : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_high    : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_clamp;

architecture rtl of firm_float_clamp is

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

  signal advance        : std_logic;

  -- After the comparisons.
  signal order_valid_r  : std_logic;
  signal is_below_r     : std_logic;
  signal is_above_r     : std_logic;
  signal is_crossed_r   : std_logic;
  signal is_undefined_r : std_logic;
  signal given_r        : number_t;
  signal low_r          : number_t;
  signal high_r         : number_t;

  signal valid_r        : std_logic;
  signal number_r       : number_t;

begin

  advance    <= out_ready or not valid_r;
  in_ready   <= advance;
  out_valid  <= valid_r;
  out_number <= number_r;

  compare : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        order_valid_r  <= in_valid;
        given_r        <= in_number;
        low_r          <= in_low;
        high_r         <= in_high;
        is_below_r     <= '0';
        is_above_r     <= '0';
        is_crossed_r   <= '0';
        is_undefined_r <= '0';
        if order_of(in_number) < order_of(in_low) then
          is_below_r <= '1';
        end if;
        if order_of(in_number) > order_of(in_high) then
          is_above_r <= '1';
        end if;
        if order_of(in_low) > order_of(in_high) then
          is_crossed_r <= '1';
        end if;
        if kind_of(in_number, EXPONENT_BITS) = UNDEFINED or kind_of(in_low, EXPONENT_BITS) = UNDEFINED or
           kind_of(in_high, EXPONENT_BITS) = UNDEFINED then
          is_undefined_r <= '1';
        end if;
      end if;
      if rst_n = '0' then
        order_valid_r <= '0';
      end if;
    end if;
  end process compare;

  choose : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        valid_r  <= order_valid_r;
        number_r <= given_r;
        if is_undefined_r = '1' then
          number_r                           <= (others => '1');
          number_r(number_t'left)            <= '0';
          number_r(MANTISSA_BITS-2 downto 0) <= (others => '0');
        elsif is_above_r = '1' or is_crossed_r = '1' then
          number_r <= high_r;
        elsif is_below_r = '1' then
          number_r <= low_r;
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process choose;

end architecture rtl;
