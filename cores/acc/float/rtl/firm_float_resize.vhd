-- SPDX-License-Identifier: Apache-2.0
-- Converts a floating-point number to one of another size: by default, float32 to float64.
--
-- The result is rounded to nearest, ties to even. A larger size has all numbers of a smaller one.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_resize is
  generic (
    IN_EXPONENT_BITS  : positive := 8;
    IN_MANTISSA_BITS  : positive := 23;
    OUT_EXPONENT_BITS : positive := 11;
    OUT_MANTISSA_BITS : positive := 52
  );
  port (
    clk        : in  std_logic;
    rst_n      : in  std_logic;

    in_valid   : in  std_logic;
    in_ready   : out std_logic;
    in_number  : in  std_logic_vector(IN_EXPONENT_BITS+IN_MANTISSA_BITS downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(OUT_EXPONENT_BITS+OUT_MANTISSA_BITS downto 0)
  );
end entity firm_float_resize;

architecture rtl of firm_float_resize is

  -- With a larger exponent, a subnormal number becomes normal.
  function max_left return natural is
  begin
    if OUT_EXPONENT_BITS > IN_EXPONENT_BITS then
      return IN_MANTISSA_BITS;
    end if;
    return 0;
  end function max_left;

  function range_bits return positive is
  begin
    if OUT_EXPONENT_BITS > IN_EXPONENT_BITS then
      return OUT_EXPONENT_BITS + 2;
    end if;
    return IN_EXPONENT_BITS + 2;
  end function range_bits;

  constant LEFT     : natural  := max_left;
  constant EXPONENT : positive := range_bits;
  constant REBIAS   : integer  := bias_of(OUT_EXPONENT_BITS) - bias_of(IN_EXPONENT_BITS);

  signal advance     : std_logic;
  signal valid       : std_logic;

  signal valid_r     : std_logic;
  signal sign_r      : std_logic;
  signal kind_r      : kind_t;
  signal exponent_r  : signed(EXPONENT-1 downto 0);
  signal magnitude_r : unsigned(IN_MANTISSA_BITS downto 0);

begin

  advance   <= out_ready or not valid;
  in_ready  <= advance;
  out_valid <= valid;

  read : process (clk)
  begin
    if rising_edge(clk) then
      if advance = '1' then
        valid_r     <= in_valid;
        sign_r      <= in_number(in_number'left);
        kind_r      <= kind_of(in_number, IN_EXPONENT_BITS);
        exponent_r  <= exponent_of(in_number, IN_EXPONENT_BITS, EXPONENT) + REBIAS;
        magnitude_r <= mantissa_of(in_number, IN_EXPONENT_BITS);
      end if;
      if rst_n = '0' then
        valid_r <= '0';
      end if;
    end if;
  end process read;

  u_round : entity firm.firm_float_round
    generic map (
      EXPONENT_BITS => OUT_EXPONENT_BITS,
      MANTISSA_BITS => OUT_MANTISSA_BITS,
      RANGE_BITS    => EXPONENT,
      WIDTH         => IN_MANTISSA_BITS+1,
      MAX_LEFT      => LEFT,
      HAS_UNDERFLOW => REBIAS < 0
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => valid_r,
      in_sign      => sign_r,
      in_kind      => kind_r,
      in_exponent  => exponent_r,
      in_magnitude => magnitude_r,
      out_valid    => valid,
      out_number   => out_number
    );

end architecture rtl;
