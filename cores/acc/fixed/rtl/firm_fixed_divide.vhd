-- SPDX-License-Identifier: Apache-2.0
-- Divides two fixed-point numbers: a / b, rounded to nearest, ties to even, and saturated.
--
-- Numbers are in two's complement; each operand and the result have their own sizes. One digit of the quotient takes
-- one cycle: the unit is small, and computes one quotient at a time.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

library firm;

entity firm_fixed_divide is
  generic (
    -- Bits and fraction bits of the operands: 2 to 64 bits, and fractions up to 64.
    A_WIDTH      : positive := 32;
    A_FRACTION   : natural  := 16;
    B_WIDTH      : positive := 32;
    B_FRACTION   : natural  := 16;
    -- Bits and fraction bits of the result: 2 to 64 bits, and a fraction up to 64.
    OUT_WIDTH    : positive := 32;
    OUT_FRACTION : natural  := 16
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;

    in_valid      : in  std_logic;
    in_ready      : out std_logic;
    in_a          : in  std_logic_vector(A_WIDTH-1 downto 0);
    in_b          : in  std_logic_vector(B_WIDTH-1 downto 0);

    out_valid     : out std_logic;
    out_ready     : in  std_logic;
    out_number    : out std_logic_vector(OUT_WIDTH-1 downto 0);
    -- The quotient is out of range, or the divisor is zero: the result is the smallest or largest one.
    out_overflow  : out std_logic;
    -- Both operands are zero: the result is 0.
    out_undefined : out std_logic
  );
end entity firm_fixed_divide;

architecture rtl of firm_fixed_divide is

  function larger(a : integer; b : integer) return integer is
  begin
    if a > b then
      return a;
    end if;
    return b;
  end function larger;

  -- If a has this number of further bits, the integer quotient has one fraction bit more than the result.
  constant PLACES   : integer  := OUT_FRACTION + B_FRACTION - A_FRACTION + 1;
  constant DIGITS   : positive := A_WIDTH + larger(PLACES, 0);
  constant DIVISOR  : positive := B_WIDTH + larger(-PLACES, 0);
  -- Sign, quotient, and whether anything remains; wide enough for a result out of range.
  constant QUOTIENT : positive := larger(DIGITS, OUT_WIDTH+1) + 2;

  type state_t is (IDLE, DIVIDE, APPLY_SIGN, ROUND, FINISH);

  signal state_r      : state_t;
  signal count_r      : natural range 0 to DIGITS-1;
  signal sign_r       : std_logic;
  signal is_by_zero_r : std_logic;
  signal undefined_r  : std_logic;

  -- Remaining digits of a, and below them those of the quotient.
  signal digits_r     : unsigned(DIGITS-1 downto 0);
  signal divisor_r    : unsigned(DIVISOR-1 downto 0);
  signal remainder_r  : unsigned(DIVISOR-1 downto 0);

  signal left         : unsigned(0 downto 0);
  signal quotient_r   : signed(QUOTIENT-1 downto 0);
  signal rounds       : std_logic;
  signal valid        : std_logic;

begin

  assert A_WIDTH >= 2 and A_WIDTH <= 64 and B_WIDTH >= 2 and B_WIDTH <= 64 and OUT_WIDTH >= 2 and OUT_WIDTH <= 64
    report "firm_fixed_divide: A_WIDTH, B_WIDTH and OUT_WIDTH are " & integer'image(A_WIDTH) & ", "
      & integer'image(B_WIDTH) & " and " & integer'image(OUT_WIDTH) & ", legal: 2 to 64"
    severity failure;
  assert A_FRACTION <= 64 and B_FRACTION <= 64 and OUT_FRACTION <= 64
    report "firm_fixed_divide: A_FRACTION, B_FRACTION and OUT_FRACTION are " & integer'image(A_FRACTION) & ", "
      & integer'image(B_FRACTION) & " and " & integer'image(OUT_FRACTION) & ", legal: 0 to 64"
    severity failure;

  in_ready      <= '1' when state_r = IDLE else '0';
  rounds        <= '1' when state_r = ROUND else '0';
  out_valid     <= valid;
  out_undefined <= undefined_r;

  left(0) <= '0' when remainder_r = 0 else '1';

  control : process (clk)
    variable extended  : unsigned(DIVISOR downto 0);
    variable magnitude : signed(QUOTIENT-1 downto 0);
  begin
    if rising_edge(clk) then
      if state_r = IDLE then
        count_r      <= DIGITS-1;
        sign_r       <= in_a(A_WIDTH-1) xor in_b(B_WIDTH-1);
        is_by_zero_r <= '0';
        undefined_r  <= '0';
        remainder_r  <= (others => '0');
        digits_r     <= (others => '0');
        divisor_r    <= (others => '0');

        digits_r(DIGITS-1 downto DIGITS-A_WIDTH) <= unsigned(in_a);
        if in_a(A_WIDTH-1) = '1' then
          digits_r(DIGITS-1 downto DIGITS-A_WIDTH) <= unsigned(-signed(in_a));
        end if;
        divisor_r(DIVISOR-1 downto DIVISOR-B_WIDTH) <= unsigned(in_b);
        if in_b(B_WIDTH-1) = '1' then
          divisor_r(DIVISOR-1 downto DIVISOR-B_WIDTH) <= unsigned(-signed(in_b));
        end if;
        if unsigned(in_b) = 0 then
          is_by_zero_r <= '1';
          if unsigned(in_a) = 0 then
            undefined_r <= '1';
          end if;
        end if;
        if in_valid = '1' then
          state_r <= DIVIDE;
        end if;

      elsif state_r = DIVIDE then
        extended := remainder_r & digits_r(DIGITS-1);
        if extended < divisor_r then
          remainder_r <= extended(DIVISOR-1 downto 0);
          digits_r    <= digits_r(DIGITS-2 downto 0) & '0';
        else
          remainder_r <= resize(extended - divisor_r, DIVISOR);
          digits_r    <= digits_r(DIGITS-2 downto 0) & '1';
        end if;
        if count_r = 0 then
          state_r <= APPLY_SIGN;
        else
          count_r <= count_r - 1;
        end if;

      elsif state_r = APPLY_SIGN then
        magnitude := signed(resize(digits_r & left, QUOTIENT));
        if is_by_zero_r = '1' then
          magnitude             := (others => not undefined_r);
          magnitude(QUOTIENT-1) := '0';
        end if;
        quotient_r <= magnitude;
        if sign_r = '1' then
          quotient_r <= -magnitude;
        end if;
        state_r <= ROUND;

      elsif state_r = ROUND then
        state_r <= FINISH;

      elsif valid = '1' and out_ready = '1' then
        state_r <= IDLE;
      end if;

      if rst_n = '0' then
        state_r <= IDLE;
      end if;
    end if;
  end process control;

  -- Ready at any time, since only one quotient is computed.
  u_resize : entity firm.firm_fixed_resize
    generic map (
      IN_WIDTH     => QUOTIENT,
      IN_FRACTION  => 2,
      OUT_WIDTH    => OUT_WIDTH,
      OUT_FRACTION => 0
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      in_valid     => rounds,
      in_ready     => open,
      in_number    => std_logic_vector(quotient_r),
      out_valid    => valid,
      out_ready    => out_ready,
      out_number   => out_number,
      out_overflow => out_overflow
    );

end architecture rtl;
