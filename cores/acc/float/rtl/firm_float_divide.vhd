-- SPDX-License-Identifier: Apache-2.0
-- Divides two floating-point numbers: a / b.
--
-- The result is that of IEEE 754, rounded to nearest, ties to even. One digit of the quotient takes one cycle, and so
-- does one leading zero of a subnormal operand: the unit is small, and computes one quotient at a time.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_divide is
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

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_divide;

architecture rtl of firm_float_divide is

  -- The quotient of two normalised mantissas is above 1/2: a leading zero, the mantissa, and the bit that rounds it.
  constant DIGITS     : positive := MANTISSA_BITS + 3;
  constant RANGE_BITS : positive := levels_for(2**EXPONENT_BITS+MANTISSA_BITS) + 2;

  signal advance     : std_logic;
  signal valid       : std_logic;

  signal is_busy_r   : std_logic;
  signal is_done_r   : std_logic;
  signal count_r     : natural range 0 to DIGITS-1;

  signal sign_r      : std_logic;
  signal kind_r      : kind_t;
  -- The result is zero, infinite or undefined.
  signal is_known_r  : std_logic;
  signal exponent_r  : signed(RANGE_BITS-1 downto 0);
  -- The remainder: below twice the divisor.
  signal remainder_r : unsigned(MANTISSA_BITS+1 downto 0);
  signal divisor_r   : unsigned(MANTISSA_BITS downto 0);
  signal quotient_r  : unsigned(DIGITS-1 downto 0);

  signal left        : unsigned(0 downto 0);
  signal magnitude   : unsigned(DIGITS downto 0);

begin

  advance   <= out_ready or not valid;
  in_ready  <= not is_busy_r;
  out_valid <= valid;

  left(0)   <= '0' when remainder_r = 0 else '1';
  magnitude <= quotient_r & left;

  divide : process (clk)
    variable a_kind     : kind_t;
    variable b_kind     : kind_t;
    variable a_mantissa : unsigned(MANTISSA_BITS downto 0);
    variable b_mantissa : unsigned(MANTISSA_BITS downto 0);
    variable difference : unsigned(MANTISSA_BITS+2 downto 0);
  begin
    if rising_edge(clk) then
      if is_busy_r = '0' then
        a_kind      := kind_of(in_a, EXPONENT_BITS);
        b_kind      := kind_of(in_b, EXPONENT_BITS);
        a_mantissa  := mantissa_of(in_a, EXPONENT_BITS);
        b_mantissa  := mantissa_of(in_b, EXPONENT_BITS);
        is_busy_r   <= in_valid;
        count_r     <= DIGITS-1;
        sign_r      <= in_a(in_a'left) xor in_b(in_b'left);
        kind_r      <= FINITE;
        is_known_r  <= '0';
        exponent_r  <= exponent_of(in_a, EXPONENT_BITS, RANGE_BITS) - exponent_of(in_b, EXPONENT_BITS, RANGE_BITS)
                       + bias_of(EXPONENT_BITS);
        remainder_r <= '0' & a_mantissa;
        divisor_r   <= b_mantissa;
        if a_kind /= FINITE or b_kind /= FINITE or a_mantissa = 0 or b_mantissa = 0 then
          is_known_r  <= '1';
          remainder_r <= (others => '0');
          if a_kind = UNDEFINED or b_kind = UNDEFINED or (a_kind = INFINITE and b_kind = INFINITE) or
             (a_mantissa = 0 and b_mantissa = 0) then
            kind_r <= UNDEFINED;
          elsif a_kind = INFINITE or b_mantissa = 0 then
            kind_r <= INFINITE;
          end if;
        end if;

      elsif is_done_r = '1' then
        if advance = '1' then
          is_done_r <= '0';
          is_busy_r <= '0';
        end if;

      elsif is_known_r = '0' and remainder_r(MANTISSA_BITS) = '0' and count_r = DIGITS-1 then
        remainder_r <= shift_left(remainder_r, 1);
        exponent_r  <= exponent_r - 1;

      elsif is_known_r = '0' and divisor_r(MANTISSA_BITS) = '0' then
        divisor_r  <= shift_left(divisor_r, 1);
        exponent_r <= exponent_r + 1;

      else
        difference  := ('0' & remainder_r) - divisor_r;
        quotient_r  <= quotient_r(DIGITS-2 downto 0) & not difference(MANTISSA_BITS+2);
        remainder_r <= shift_left(difference(MANTISSA_BITS+1 downto 0), 1);
        if difference(MANTISSA_BITS+2) = '1' then
          remainder_r <= shift_left(remainder_r, 1);
        end if;
        if count_r = 0 then
          is_done_r <= '1';
        else
          count_r <= count_r - 1;
        end if;
      end if;

      if rst_n = '0' then
        is_busy_r <= '0';
        is_done_r <= '0';
      end if;
    end if;
  end process divide;

  u_round : entity firm.firm_float_round
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      RANGE_BITS    => RANGE_BITS,
      WIDTH         => DIGITS+1,
      MAX_LEFT      => 1,
      HAS_UNDERFLOW => true
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => is_done_r,
      in_sign      => sign_r,
      in_kind      => kind_r,
      in_exponent  => exponent_r,
      in_magnitude => magnitude,
      out_valid    => valid,
      out_number   => out_number
    );

end architecture rtl;
