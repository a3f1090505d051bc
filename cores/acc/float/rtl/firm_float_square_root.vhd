-- SPDX-License-Identifier: Apache-2.0
-- The square root of a floating-point number.
--
-- The result is that of IEEE 754, rounded to nearest, ties to even. One digit of the root takes one cycle, and so does
-- one leading zero of a subnormal number: the unit is small, and computes one root at a time.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;
use firm.firm_float_pkg.all;

entity firm_float_square_root is
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
    in_number  : in  std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0);

    out_valid  : out std_logic;
    out_ready  : in  std_logic;
    out_number : out std_logic_vector(EXPONENT_BITS+MANTISSA_BITS downto 0)
  );
end entity firm_float_square_root;

architecture rtl of firm_float_square_root is

  -- The root of a number from 1 to 4 is from 1 to 2: the mantissa, and the bit that rounds it.
  constant DIGITS     : positive := MANTISSA_BITS + 2;
  constant BIAS       : natural  := bias_of(EXPONENT_BITS);
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
  -- Without the bias.
  signal exponent_r  : signed(RANGE_BITS-1 downto 0);
  -- Digits of the number, two for each digit of the root; first, the mantissa, or twice the mantissa if the exponent is
  -- odd. The first two digits of a number from 1 to 2 are 01; those of twice this number, 10 or 11.
  signal number_r    : unsigned(MANTISSA_BITS+1 downto 0);
  -- The number so far, less the square of the root so far: at most twice the root.
  signal remainder_r : unsigned(DIGITS downto 0);
  signal root_r      : unsigned(DIGITS-1 downto 0);

  signal is_even     : boolean;
  signal is_normal   : boolean;
  signal exponent    : signed(RANGE_BITS-1 downto 0);
  signal left        : unsigned(0 downto 0);
  signal magnitude   : unsigned(DIGITS downto 0);

begin

  advance   <= out_ready or not valid;
  in_ready  <= not is_busy_r;
  out_valid <= valid;

  is_even   <= exponent_r(0) = '0';
  is_normal <= number_r(MANTISSA_BITS+1) = '1' or (is_even and number_r(MANTISSA_BITS) = '1');
  exponent  <= (exponent_r(RANGE_BITS-1) & exponent_r(RANGE_BITS-1 downto 1)) + BIAS;
  left(0)   <= '0' when remainder_r = 0 else '1';
  magnitude <= root_r & left;

  extract : process (clk)
    variable mantissa   : unsigned(MANTISSA_BITS downto 0);
    variable unbiased   : signed(RANGE_BITS-1 downto 0);
    variable extended   : unsigned(DIGITS+2 downto 0);
    variable difference : unsigned(DIGITS+2 downto 0);
  begin
    if rising_edge(clk) then
      if is_busy_r = '0' then
        mantissa    := mantissa_of(in_number, EXPONENT_BITS);
        is_busy_r   <= in_valid;
        count_r     <= DIGITS-1;
        sign_r      <= in_number(in_number'left);
        kind_r      <= kind_of(in_number, EXPONENT_BITS);
        is_known_r  <= '0';
        unbiased    := exponent_of(in_number, EXPONENT_BITS, RANGE_BITS) - BIAS;
        exponent_r  <= unbiased;
        number_r    <= '0' & mantissa;
        if unbiased(0) = '1' then
          number_r <= mantissa & '0';
        end if;
        remainder_r <= (others => '0');
        root_r      <= (others => '0');
        if mantissa = 0 then
          -- The root of -0 is -0.
          is_known_r <= '1';
        elsif kind_of(in_number, EXPONENT_BITS) /= FINITE or in_number(in_number'left) = '1' then
          is_known_r <= '1';
          if in_number(in_number'left) = '1' then
            kind_r <= UNDEFINED;
          end if;
        end if;

      elsif is_done_r = '1' then
        if advance = '1' then
          is_done_r <= '0';
          is_busy_r <= '0';
        end if;

      elsif is_known_r = '0' and not is_normal and count_r = DIGITS-1 then
        if is_even then
          number_r <= shift_left(number_r, 2);
        end if;
        exponent_r <= exponent_r - 1;

      else
        extended    := remainder_r & number_r(MANTISSA_BITS+1 downto MANTISSA_BITS);
        difference  := extended - (root_r & "01");
        number_r    <= shift_left(number_r, 2);
        root_r      <= root_r(DIGITS-2 downto 0) & not difference(DIGITS+2);
        remainder_r <= difference(DIGITS downto 0);
        if difference(DIGITS+2) = '1' then
          remainder_r <= extended(DIGITS downto 0);
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
  end process extract;

  -- A root is below the normal numbers only in sizes with few exponents.
  u_round : entity firm.firm_float_round
    generic map (
      EXPONENT_BITS => EXPONENT_BITS,
      MANTISSA_BITS => MANTISSA_BITS,
      RANGE_BITS    => RANGE_BITS,
      WIDTH         => DIGITS+1,
      MAX_LEFT      => 0,
      HAS_UNDERFLOW => MANTISSA_BITS >= BIAS
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      advance      => advance,
      in_valid     => is_done_r,
      in_sign      => sign_r,
      in_kind      => kind_r,
      in_exponent  => exponent,
      in_magnitude => magnitude,
      out_valid    => valid,
      out_number   => out_number
    );

end architecture rtl;
