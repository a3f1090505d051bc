-- SPDX-License-Identifier: Apache-2.0
-- Converts a fixed-point number to another size: rounded to nearest, ties to even, and saturated.
--
-- Numbers are in two's complement. A pipeline: one result in every cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_fixed_resize is
  generic (
    -- Bits and fraction bits of the number: 2 to 256.
    IN_WIDTH     : positive := 32;
    IN_FRACTION  : natural  := 16;
    -- Bits and fraction bits of the result: 2 to 128.
    OUT_WIDTH    : positive := 32;
    OUT_FRACTION : natural  := 16
  );
  port (
    clk          : in  std_logic;
    rst_n        : in  std_logic;

    in_valid     : in  std_logic;
    in_ready     : out std_logic;
    in_number    : in  std_logic_vector(IN_WIDTH-1 downto 0);

    out_valid    : out std_logic;
    out_ready    : in  std_logic;
    out_number   : out std_logic_vector(OUT_WIDTH-1 downto 0);
    -- The number is out of range: the result is the smallest or largest one.
    out_overflow : out std_logic
  );
end entity firm_fixed_resize;

architecture rtl of firm_fixed_resize is

  function larger(a : integer; b : integer) return integer is
  begin
    if a > b then
      return a;
    end if;
    return b;
  end function larger;

  -- Fraction bits that the result lacks, and those that the number lacks.
  constant LOST          : natural  := larger(IN_FRACTION - OUT_FRACTION, 0);
  constant ADDED         : natural  := larger(OUT_FRACTION - IN_FRACTION, 0);
  constant EXACT_WIDTH   : positive := larger(IN_WIDTH, LOST + 1) + ADDED;
  -- With a carry, and at least one bit above the result.
  constant ROUNDED_WIDTH : positive := larger(EXACT_WIDTH - LOST, OUT_WIDTH) + 1;

  signal advance         : std_logic;

  signal exact           : signed(EXACT_WIDTH-1 downto 0);
  signal up              : unsigned(0 downto 0);

  signal rounded_valid_r : std_logic;
  signal rounded_r       : signed(ROUNDED_WIDTH-1 downto 0);

  signal valid_r         : std_logic;
  signal number_r        : signed(OUT_WIDTH-1 downto 0);
  signal overflow_r      : std_logic;

begin

  assert IN_WIDTH >= 2 and IN_WIDTH <= 256
    report "firm_fixed_resize: IN_WIDTH is " & integer'image(IN_WIDTH) & ", legal: 2 to 256"
    severity failure;
  assert OUT_WIDTH >= 2 and OUT_WIDTH <= 128
    report "firm_fixed_resize: OUT_WIDTH is " & integer'image(OUT_WIDTH) & ", legal: 2 to 128"
    severity failure;
  assert IN_FRACTION <= 256 and OUT_FRACTION <= 256
    report "firm_fixed_resize: IN_FRACTION and OUT_FRACTION are " & integer'image(IN_FRACTION) & " and "
      & integer'image(OUT_FRACTION) & ", legal: 0 to 256"
    severity failure;

  advance      <= out_ready or not valid_r;
  in_ready     <= advance;
  out_valid    <= valid_r;
  out_number   <= std_logic_vector(number_r);
  out_overflow <= overflow_r;

  extends : if ADDED > 0 generate
    exact(ADDED-1 downto 0) <= (others => '0');
  end generate extends;
  exact(EXACT_WIDTH-1 downto ADDED) <= resize(signed(in_number), EXACT_WIDTH-ADDED);

  keeps : if LOST = 0 generate
    up <= "0";
  end generate keeps;

  halves : if LOST = 1 generate
    up(0) <= exact(0) and exact(1);
  end generate halves;

  shortens : if LOST > 1 generate
    up(0) <= exact(LOST-1) when exact(LOST) = '1' or exact(LOST-2 downto 0) /= 0 else '0';
  end generate shortens;

  round : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        rounded_valid_r <= in_valid;
        rounded_r       <= resize(exact(EXACT_WIDTH-1 downto LOST), ROUNDED_WIDTH) + signed('0' & up);
      end if;
      if rst_n = '0' then
        rounded_valid_r <= '0';
      end if;
    end if;
  end process round;

  saturate : process (clk)
    variable is_negative : std_logic;
    variable beyond      : unsigned(ROUNDED_WIDTH-OUT_WIDTH downto 0);
  begin
    if rising_edge(clk) then
      if advance = '1' then
        is_negative := rounded_r(ROUNDED_WIDTH-1);
        beyond      := unsigned(rounded_r(ROUNDED_WIDTH-1 downto OUT_WIDTH-1));
        valid_r     <= rounded_valid_r;
        number_r    <= rounded_r(OUT_WIDTH-1 downto 0);
        overflow_r  <= '0';
        -- These bits and the sign are equal in a number of OUT_WIDTH bits.
        if beyond /= 0 and (not beyond) /= 0 then
          overflow_r            <= '1';
          number_r              <= (others => not is_negative);
          number_r(OUT_WIDTH-1) <= is_negative;
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process saturate;

end architecture rtl;
