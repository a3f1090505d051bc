-- SPDX-License-Identifier: Apache-2.0
-- Adds or subtracts two floating-point numbers: a + b, or a - b if `in_subtract` is high.
--
-- The result is that of IEEE 754, rounded to nearest, ties to even. A pipeline: one result in every cycle.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_add is
  generic (
    -- 11 and 52 for float64, 8 and 23 for float32.
    EXPONENT_BITS : positive := 11;
    MANTISSA_BITS : positive := 52;
    -- Fewer cycles and registers, for lower clock frequencies.
    IS_SHORT      : boolean  := false
  );
  port (
    clk         : in  std_logic;
    rst_n       : in  std_logic;

    in_valid    : in  std_logic;
    in_ready    : out std_logic;
    in_a        : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_b        : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
    in_subtract : in  std_logic := '0';

    out_valid   : out std_logic;
    out_ready   : in  std_logic;
    out_number  : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_add;

architecture rtl of firm_float_add is

  constant RANGE_BITS : positive := EXPONENT_BITS + 2;
  constant WIDTH      : positive := MANTISSA_BITS + 4;

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

  signal advance       : std_logic;
  signal valid         : std_logic;
  -- With the sign of a summand.
  signal b             : number_t;

  signal sum_valid     : std_logic;
  signal sum_sign      : std_logic;
  signal sum_kind      : kind_t;
  signal sum_magnitude : unsigned(WIDTH downto 0);

begin

  advance   <= out_ready or not valid;
  in_ready  <= advance;
  out_valid <= valid;

  b <= (in_b(in_b'left) xor in_subtract) & in_b(in_b'left-1 downto 0);

  in_many_stages : if not IS_SHORT generate
    signal a_kind       : kind_t;
    signal a_exponent   : signed(RANGE_BITS-1 downto 0);
    signal a_magnitude  : unsigned(WIDTH-1 downto 0);
    signal b_kind       : kind_t;
    signal b_exponent   : signed(RANGE_BITS-1 downto 0);
    signal b_magnitude  : unsigned(WIDTH-1 downto 0);
    signal sum_exponent : signed(RANGE_BITS-1 downto 0);
  begin

    a_kind      <= kind_of(in_a, EXPONENT_BITS);
    a_exponent  <= exponent_of(in_a, EXPONENT_BITS, RANGE_BITS);
    a_magnitude <= fitted(mantissa_of(in_a, EXPONENT_BITS), WIDTH);
    b_kind      <= kind_of(b, EXPONENT_BITS);
    b_exponent  <= exponent_of(b, EXPONENT_BITS, RANGE_BITS);
    b_magnitude <= fitted(mantissa_of(b, EXPONENT_BITS), WIDTH);

    u_sum : entity firm.firm_float_sum
      generic map (
        RANGE_BITS => RANGE_BITS,
        WIDTH      => WIDTH
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        advance       => advance,
        in_valid      => in_valid,
        a_sign        => in_a(in_a'left),
        a_kind        => a_kind,
        a_exponent    => a_exponent,
        a_magnitude   => a_magnitude,
        b_sign        => b(b'left),
        b_kind        => b_kind,
        b_exponent    => b_exponent,
        b_magnitude   => b_magnitude,
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

  end generate in_many_stages;

  in_few_stages : if IS_SHORT generate
    signal sum_exponent : unsigned(EXPONENT_BITS-1 downto 0);
    signal limit        : signed(RANGE_BITS-1 downto 0);
  begin

    u_sum : entity firm.firm_float_sum_short
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS
      )
      port map (
        clk           => clk,
        rst_n         => rst_n,
        advance       => advance,
        in_valid      => in_valid,
        in_a          => in_a,
        in_b          => b,
        out_valid     => sum_valid,
        out_sign      => sum_sign,
        out_kind      => sum_kind,
        out_exponent  => sum_exponent,
        out_magnitude => sum_magnitude
      );

    -- The magnitude has one bit before the leading one of the larger number.
    limit <= signed(resize(sum_exponent, RANGE_BITS));

    u_round : entity firm.firm_float_round_short
      generic map (
        EXPONENT_BITS => EXPONENT_BITS,
        MANTISSA_BITS => MANTISSA_BITS,
        RANGE_BITS    => RANGE_BITS,
        WIDTH         => WIDTH+1,
        HAS_UNDERFLOW => false
      )
      port map (
        clk          => clk,
        rst_n        => rst_n,
        advance      => advance,
        in_valid     => sum_valid,
        in_sign      => sum_sign,
        in_kind      => sum_kind,
        in_limit     => limit,
        in_magnitude => sum_magnitude,
        out_valid    => valid,
        out_number   => out_number
      );

  end generate in_few_stages;

end architecture rtl;
