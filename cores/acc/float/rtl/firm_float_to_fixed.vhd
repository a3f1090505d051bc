-- SPDX-License-Identifier: Apache-2.0
-- Converts a floating-point number to a fixed-point number or an integer: saturated, and rounded to nearest, ties to
-- even, or towards zero.
--
-- A pipeline: one result in every cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_to_fixed is
  generic (
    -- Bits of the result: 2 to 128.
    WIDTH         : positive := 32;
    -- Fraction bits of the result: 0, for an integer, to 1000.
    FRACTION      : natural  := 0;
    -- Two's complement.
    IS_SIGNED     : boolean  := true;
    -- Rounded towards zero, as a conversion in C.
    TRUNCATES     : boolean  := false;
    -- 11 and 52 for float64, 8 and 23 for float32.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;

    in_valid      : in  std_logic;
    in_ready      : out std_logic;
    in_number     : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid     : out std_logic;
    out_ready     : in  std_logic;
    out_number    : out std_logic_vector(WIDTH-1 downto 0);
    -- The number is out of range: the result is the smallest or largest one.
    out_overflow  : out std_logic;
    -- The number is NaN: the result is 0.
    out_undefined : out std_logic
  );
end entity firm_float_to_fixed;

architecture rtl of firm_float_to_fixed is

  -- The exponent of a number whose leading one is the highest bit of the result.
  constant TOP         : integer  := bias_of(EXPONENT_BITS) + WIDTH-1 - FRACTION;
  constant RANGE_BITS  : positive := EXPONENT_BITS + levels_for(WIDTH+FRACTION);
  -- The result, the bit that rounds it, and whether anything is below.
  constant MOVED_WIDTH : positive := WIDTH + 2;
  constant LEVELS      : positive := levels_for(MOVED_WIDTH);
  -- Sign, too large, undefined.
  constant REST        : positive := 3;

  subtype moved_t is unsigned(MOVED_WIDTH-1 downto 0);
  subtype rest_t is std_logic_vector(REST-1 downto 0);

  signal advance         : std_logic;

  signal read_valid_r    : std_logic;
  signal read_r          : moved_t;
  signal distance_r      : unsigned(LEVELS-1 downto 0);
  signal rest_r          : rest_t;

  signal moved_valid     : std_logic;
  signal moved           : moved_t;
  signal moved_rest      : rest_t;

  signal rounded_valid_r : std_logic;
  signal rounded_r       : unsigned(WIDTH downto 0);
  signal rounded_rest_r  : rest_t;

  signal number_valid_r  : std_logic;
  signal number_r        : signed(WIDTH-1 downto 0);
  signal overflow_r      : std_logic;
  signal undefined_r     : std_logic;

begin

  assert WIDTH >= 2 and WIDTH <= 128
    report "firm_float_to_fixed: WIDTH is " & integer'image(WIDTH) & ", legal: 2 to 128"
    severity failure;
  assert FRACTION <= 1000
    report "firm_float_to_fixed: FRACTION is " & integer'image(FRACTION) & ", legal: 0 to 1000"
    severity failure;

  advance       <= out_ready or not number_valid_r;
  in_ready      <= advance;
  out_valid     <= number_valid_r;
  out_number    <= std_logic_vector(number_r);
  out_overflow  <= overflow_r;
  out_undefined <= undefined_r;

  read : process (clk)
    variable distance : signed(RANGE_BITS-1 downto 0);
    variable kind     : kind_t;
  begin
    if rising_edge(clk) then
      if advance = '1' then
        kind         := kind_of(in_number, EXPONENT_BITS);
        distance     := to_signed(TOP, RANGE_BITS) - exponent_of(in_number, EXPONENT_BITS, RANGE_BITS);
        read_valid_r <= in_valid;
        read_r       <= fitted(mantissa_of(in_number, EXPONENT_BITS), MOVED_WIDTH);
        distance_r   <= limited(distance, LEVELS);
        rest_r       <= in_number(in_number'left) & '0' & '0';
        if kind = UNDEFINED then
          rest_r(0) <= '1';
        elsif kind = INFINITE or distance < 0 then
          rest_r(1) <= '1';
        end if;
      end if;
      if rst_n = '0' then
        read_valid_r <= '0';
      end if;
    end if;
  end process read;

  u_right : entity firm.firm_float_shift_right
    generic map (
      WIDTH  => MOVED_WIDTH,
      LEVELS => LEVELS,
      REST   => REST
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      advance       => advance,
      in_valid      => read_valid_r,
      in_magnitude  => read_r,
      in_distance   => distance_r,
      in_rest       => rest_r,
      out_valid     => moved_valid,
      out_magnitude => moved,
      out_rest      => moved_rest
    );

  round : process (clk)
    variable up : unsigned(0 downto 0);
  begin
    if rising_edge(clk) then
      if advance = '1' then
        up(0) := moved(1) and (moved(0) or moved(2));
        if TRUNCATES then
          up(0) := '0';
        end if;
        rounded_valid_r <= moved_valid;
        rounded_r       <= ('0' & moved(MOVED_WIDTH-1 downto 2)) + up;
        rounded_rest_r  <= moved_rest;
      end if;
      if rst_n = '0' then
        rounded_valid_r <= '0';
      end if;
    end if;
  end process round;

  saturate : process (clk)
    variable is_negative : std_logic;
    variable is_beyond   : std_logic;
  begin
    if rising_edge(clk) then
      if advance = '1' then
        is_negative    := rounded_rest_r(2);
        is_beyond      := rounded_rest_r(1) or rounded_r(WIDTH);
        number_valid_r <= rounded_valid_r;
        undefined_r    <= rounded_rest_r(0);
        number_r       <= signed(rounded_r(WIDTH-1 downto 0));
        if is_negative = '1' then
          number_r <= -signed(rounded_r(WIDTH-1 downto 0));
        end if;

        if IS_SIGNED then
          -- The smallest number has one unit more than the largest one.
          if rounded_r(WIDTH-1) = '1' and (is_negative = '0' or rounded_r(WIDTH-2 downto 0) /= 0) then
            is_beyond := '1';
          end if;
          if is_beyond = '1' then
            number_r          <= (others => not is_negative);
            number_r(WIDTH-1) <= is_negative;
          end if;
        else
          if is_negative = '1' and rounded_r /= 0 then
            is_beyond := '1';
          end if;
          if is_beyond = '1' then
            number_r <= (others => not is_negative);
          end if;
        end if;

        overflow_r <= is_beyond;
        if rounded_rest_r(0) = '1' then
          overflow_r <= '0';
          number_r   <= (others => '0');
        end if;
      end if;
      if rst_n = '0' then
        number_valid_r <= '0';
      end if;
    end if;
  end process saturate;

end architecture rtl;
