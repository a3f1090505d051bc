-- SPDX-License-Identifier: Apache-2.0
-- Multiplies two floating-point numbers: a * b.
--
-- The result is that of IEEE 754, rounded to nearest, ties to even. A pipeline: one result in every cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_multiply is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52;
    -- Fewer cycles and registers, for lower clock frequencies.
    IS_SHORT      : boolean  := false
  );
  port (
    clk        : in  std_logic;
    rst_n      : in  std_logic;

    in_valid   : in  std_logic;
    in_ready   : out std_logic;
    in_a       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_b       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_multiply;

architecture rtl of firm_float_multiply is

  constant RANGE_BITS : positive := EXPONENT_BITS + 2;
  constant WIDTH      : positive := 2*MANTISSA_BITS + 2;

  signal advance   : std_logic;
  signal valid     : std_logic;

  signal exact     : std_logic;
  signal sign      : std_logic;
  signal kind      : kind_t;
  -- Less one in the short form.
  signal exponent  : signed(RANGE_BITS-1 downto 0);
  signal magnitude : unsigned(WIDTH-1 downto 0);

begin

  advance   <= out_ready or not valid;
  in_ready  <= advance;
  out_valid <= valid;

  u_product : entity firm.firm_float_product
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      REST          => 1,
      LESS          => boolean'pos(IS_SHORT),
      IS_SHORT      => IS_SHORT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      advance       => advance,
      in_valid      => in_valid,
      in_a          => in_a,
      in_b          => in_b,
      in_rest       => "0",
      out_valid     => exact,
      out_sign      => sign,
      out_kind      => kind,
      out_exponent  => exponent,
      out_magnitude => magnitude,
      out_rest      => open
    );

  -- One factor may be subnormal; the product of two such numbers is below the smallest number.
  in_many_stages : if not IS_SHORT generate
    u_round : entity firm.firm_float_round
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS,
        RANGE_BITS    => RANGE_BITS,
        WIDTH         => WIDTH,
        MAX_LEFT      => MANTISSA_BITS+1,
        HAS_UNDERFLOW => true
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        advance      => advance,
        in_valid     => exact,
        in_sign      => sign,
        in_kind      => kind,
        in_exponent  => exponent,
        in_magnitude => magnitude,
        out_valid    => valid,
        out_number   => out_number
      );
  end generate in_many_stages;

  in_few_stages : if IS_SHORT generate
    u_round : entity firm.firm_float_round_short
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS,
        RANGE_BITS    => RANGE_BITS,
        WIDTH         => WIDTH,
        HAS_UNDERFLOW => true
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        advance      => advance,
        in_valid     => exact,
        in_sign      => sign,
        in_kind      => kind,
        in_limit     => exponent,
        in_magnitude => magnitude,
        out_valid    => valid,
        out_number   => out_number
      );
  end generate in_few_stages;

end architecture rtl;
