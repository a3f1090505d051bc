-- SPDX-License-Identifier: Apache-2.0
-- Compares two floating-point numbers: a < b, a = b, a > b, or unordered if one of them is NaN.
--
-- Exactly one of the four results is high. -0 equals +0, and an infinity equals itself. A pipeline: one result in every
-- cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_compare is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;

    in_valid      : in  std_logic;
    in_ready      : out std_logic;
    in_a          : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_b          : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid     : out std_logic;
    out_ready     : in  std_logic;
    out_less      : out std_logic;
    out_equal     : out std_logic;
    out_greater   : out std_logic;
    out_unordered : out std_logic
  );
end entity firm_float_compare;

architecture rtl of firm_float_compare is

  signal advance     : std_logic;

  signal valid_r     : std_logic;
  signal less_r      : std_logic;
  signal equal_r     : std_logic;
  signal greater_r   : std_logic;
  signal unordered_r : std_logic;

begin

  advance       <= out_ready or not valid_r;
  in_ready      <= advance;
  out_valid     <= valid_r;
  out_less      <= less_r;
  out_equal     <= equal_r;
  out_greater   <= greater_r;
  out_unordered <= unordered_r;

  compare : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        valid_r     <= in_valid;
        less_r      <= '0';
        equal_r     <= '0';
        greater_r   <= '0';
        unordered_r <= '0';
        if kind_of(in_a, EXPONENT_BITS) = UNDEFINED or kind_of(in_b, EXPONENT_BITS) = UNDEFINED then
          unordered_r <= '1';
        elsif in_a = in_b or (is_zero(in_a) and is_zero(in_b)) then
          equal_r <= '1';
        elsif order_of(in_a) < order_of(in_b) then
          less_r <= '1';
        else
          greater_r <= '1';
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process compare;

end architecture rtl;
