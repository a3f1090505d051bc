-- SPDX-License-Identifier: Apache-2.0
-- Rounds a magnitude whose highest bit has the place of the leading one, to nearest, ties to even, and packs
-- the number.
--
-- Without a leading one, the number is zero or subnormal. Beyond the largest number, it is infinite. NaN is always the
-- positive quiet one with no other bit.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_pack is
  generic (
    EXPONENT_BITS : positive;
    MANTISSA_BITS : positive;
    -- Bits of the exponent, which is signed.
    RANGE_BITS    : positive;
    -- One pipeline register instead of two.
    IS_SHORT      : boolean
  );
  port (
    clk          : in  std_logic;
    rst_n        : in  std_logic;
    -- All registers keep their values unless it is high.
    advance      : in  std_logic;

    in_valid     : in  std_logic;
    in_sign      : in  std_logic;
    in_kind      : in  std_logic_vector(1 downto 0);
    in_exponent  : in  signed(RANGE_BITS-1 downto 0);
    -- The mantissa with its leading bit, the bit that rounds it, and whether anything is below.
    in_magnitude : in  unsigned(MANTISSA_BITS+2 downto 0);

    out_valid    : out std_logic;
    out_number   : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_pack;

architecture rtl of firm_float_pack is

  subtype number_t is std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);
  subtype sum_t is unsigned(EXPONENT_BITS+MANTISSA_BITS-1 downto 0);

  function packed(sign : std_logic; kind : kind_t; sum : sum_t) return number_t is
    variable number : number_t;
  begin
    number := sign & std_logic_vector(sum);
    if kind /= FINITE then
      number(EXPONENT_BITS+MANTISSA_BITS-1 downto MANTISSA_BITS) := (others => '1');
      number(MANTISSA_BITS-1 downto 0)                           := (others => '0');
    end if;
    if kind = UNDEFINED then
      number(EXPONENT_BITS+MANTISSA_BITS) := '0';
      number(MANTISSA_BITS-1)             := '1';
    end if;
    return number;
  end function packed;

  signal sum_valid_r    : std_logic;
  signal sum_sign_r     : std_logic;
  signal sum_kind_r     : kind_t;
  signal sum_r          : sum_t;

  signal number_valid_r : std_logic;
  signal number_r       : number_t;

begin

  out_valid  <= number_valid_r;
  out_number <= number_r;

  round : process (clk)
    variable field : unsigned(EXPONENT_BITS-1 downto 0);
    variable up    : unsigned(0 downto 0);
    variable kind  : kind_t;
    variable sum   : sum_t;
  begin
    if rising_edge(clk) then
      if advance = '1' then
        kind  := in_kind;
        field := resize(unsigned(in_exponent), EXPONENT_BITS);
        if in_magnitude(MANTISSA_BITS+2) = '0' then
          field := (others => '0');
        elsif in_exponent >= 2**EXPONENT_BITS-1 and in_kind = FINITE then
          kind := INFINITE;
        end if;
        up(0) := in_magnitude(1) and (in_magnitude(0) or in_magnitude(2));
        -- A carry out of the mantissa increments the exponent, also that of a subnormal or of the largest number.
        sum         := (field & in_magnitude(MANTISSA_BITS+1 downto 2)) + up;
        sum_valid_r <= in_valid;
        sum_sign_r  <= in_sign;
        sum_kind_r  <= kind;
        sum_r       <= sum;
        if IS_SHORT then
          number_valid_r <= in_valid;
          number_r       <= packed(in_sign, kind, sum);
        else
          number_valid_r <= sum_valid_r;
          number_r       <= packed(sum_sign_r, sum_kind_r, sum_r);
        end if;
      end if;
      if rst_n = '0' then
        sum_valid_r    <= '0';
        number_valid_r <= '0';
      end if;
    end if;
  end process round;

end architecture rtl;
