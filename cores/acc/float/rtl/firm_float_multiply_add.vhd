-- SPDX-License-Identifier: Apache-2.0
-- Multiplies and adds floating-point numbers with a single rounding: a * b + c.
--
-- The result is that of IEEE 754's fusedMultiplyAdd, rounded to nearest, ties to even. A pipeline: one result in every
-- cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_multiply_add is
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
    in_a       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_b       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_c       : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_multiply_add;

architecture rtl of firm_float_multiply_add is

  constant RANGE_BITS : positive := EXPONENT_BITS + 2;
  constant EXACT      : positive := 2*MANTISSA_BITS + 2;
  constant WIDTH      : positive := EXACT + 3;

  signal advance           : std_logic;
  signal valid             : std_logic;

  signal product_valid     : std_logic;
  signal product_sign      : std_logic;
  signal product_kind      : kind_t;
  signal product_exponent  : signed(RANGE_BITS-1 downto 0);
  signal product_magnitude : unsigned(EXACT-1 downto 0);
  signal product_fitted    : unsigned(WIDTH-1 downto 0);
  signal c                 : std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
  signal c_kind            : kind_t;
  signal c_exponent        : signed(RANGE_BITS-1 downto 0);
  signal c_magnitude       : unsigned(WIDTH-1 downto 0);

  signal sum_valid         : std_logic;
  signal sum_sign          : std_logic;
  signal sum_kind          : kind_t;
  signal sum_exponent      : signed(RANGE_BITS-1 downto 0);
  signal sum_magnitude     : unsigned(WIDTH downto 0);

begin

  advance   <= out_ready or not valid;
  in_ready  <= advance;
  out_valid <= valid;

  u_product : entity firm.firm_float_product
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      REST          => EXPONENT_BITS+MANTISSA_BITS+1
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      advance       => advance,
      in_valid      => in_valid,
      in_a          => in_a,
      in_b          => in_b,
      in_rest       => in_c,
      out_valid     => product_valid,
      out_sign      => product_sign,
      out_kind      => product_kind,
      out_exponent  => product_exponent,
      out_magnitude => product_magnitude,
      out_rest      => c
    );

  product_fitted <= fitted(product_magnitude, WIDTH);
  c_kind         <= kind_of(c, EXPONENT_BITS);
  c_exponent     <= exponent_of(c, EXPONENT_BITS, RANGE_BITS);
  c_magnitude    <= fitted(mantissa_of(c, EXPONENT_BITS), WIDTH);

  -- The exponent of `c` is 1 or more, so the larger exponent is.
  u_sum : entity firm.firm_float_sum
    generic map (
      RANGE_BITS => RANGE_BITS,
      WIDTH      => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      advance       => advance,
      in_valid      => product_valid,
      a_sign        => product_sign,
      a_kind        => product_kind,
      a_exponent    => product_exponent,
      a_magnitude   => product_fitted,
      b_sign        => c(c'left),
      b_kind        => c_kind,
      b_exponent    => c_exponent,
      b_magnitude   => c_magnitude,
      out_valid     => sum_valid,
      out_sign      => sum_sign,
      out_kind      => sum_kind,
      out_exponent  => sum_exponent,
      out_magnitude => sum_magnitude
    );

  u_round : entity firm.firm_float_round
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      RANGE_BITS    => RANGE_BITS,
      WIDTH         => WIDTH+1,
      MAX_LEFT      => WIDTH,
      HAS_UNDERFLOW => false
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => sum_valid,
      in_sign      => sum_sign,
      in_kind      => sum_kind,
      in_exponent  => sum_exponent,
      in_magnitude => sum_magnitude,
      out_valid    => valid,
      out_number   => out_number
    );

end architecture rtl;
