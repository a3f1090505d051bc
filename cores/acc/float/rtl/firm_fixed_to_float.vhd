-- SPDX-License-Identifier: Apache-2.0
-- Converts a fixed-point number or an integer to a floating-point number, rounded to nearest, ties to even.
--
-- Zero is always +0. A pipeline: one result in every cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_fixed_to_float is
  generic (
    -- Bits of the number: 2 to 128.
    WIDTH         : positive := 32;
    -- Fraction bits of the number: 0, for an integer, to 1000.
    FRACTION      : natural  := 0;
    -- Two's complement.
    IS_SIGNED     : boolean  := true;
    -- 11 and 52 for float64, 8 and 23 for float32.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52
  );
  port (
    clk        : in  std_logic;
    rst_n      : in  std_logic;

    in_valid   : in  std_logic;
    in_ready   : out std_logic;
    in_number  : in  std_logic_vector(WIDTH-1 downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_fixed_to_float;

architecture rtl of firm_fixed_to_float is

  -- The exponent of a number whose leading one is its highest bit.
  constant TOP        : integer  := bias_of(EXPONENT_BITS) + WIDTH-1 - FRACTION;
  constant RANGE_BITS : positive := EXPONENT_BITS + levels_for(WIDTH+FRACTION);

  signal advance     : std_logic;
  signal valid       : std_logic;

  signal valid_r     : std_logic;
  signal sign_r      : std_logic;
  signal magnitude_r : unsigned(WIDTH-1 downto 0);
  signal exponent    : signed(RANGE_BITS-1 downto 0);

begin

  assert WIDTH >= 2 and WIDTH <= 128
    report "firm_fixed_to_float: WIDTH is " & integer'image(WIDTH) & ", legal: 2 to 128"
    severity failure;
  assert FRACTION <= 1000
    report "firm_fixed_to_float: FRACTION is " & integer'image(FRACTION) & ", legal: 0 to 1000"
    severity failure;

  advance   <= out_ready or not valid;
  in_ready  <= advance;
  out_valid <= valid;
  exponent  <= to_signed(TOP, RANGE_BITS);

  read : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        valid_r     <= in_valid;
        sign_r      <= '0';
        magnitude_r <= unsigned(in_number);
        if IS_SIGNED and in_number(WIDTH-1) = '1' then
          sign_r      <= '1';
          magnitude_r <= unsigned(-signed(in_number));
        end if;
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process read;

  u_round : entity firm.firm_float_round
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      RANGE_BITS    => RANGE_BITS,
      WIDTH         => WIDTH,
      MAX_LEFT      => WIDTH-1,
      HAS_UNDERFLOW => TOP < 1
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => valid_r,
      in_sign      => sign_r,
      in_kind      => FINITE,
      in_exponent  => exponent,
      in_magnitude => magnitude_r,
      out_valid    => valid,
      out_number   => out_number
    );

end architecture rtl;
