-- SPDX-License-Identifier: Apache-2.0
-- Divides two integers as Python does: the quotient is the largest integer not above a / b, and the remainder has the
-- sign of the divisor, a = quotient * b + remainder.
--
-- Numbers are in two's complement. By zero, both results are 0, as in NumPy; the smallest number by -1 is itself. One
-- digit of the quotient takes one cycle: the unit is small, and computes one quotient at a time.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_integer_divide is
  generic (
    WIDTH : positive := 32
  );
  port (
    clk           : in  std_logic;
    rst_n         : in  std_logic;

    in_valid      : in  std_logic;
    in_ready      : out std_logic;
    in_a          : in  std_logic_vector(WIDTH-1 downto 0);
    in_b          : in  std_logic_vector(WIDTH-1 downto 0);

    out_valid     : out std_logic;
    out_ready     : in  std_logic;
    out_quotient  : out std_logic_vector(WIDTH-1 downto 0);
    out_remainder : out std_logic_vector(WIDTH-1 downto 0)
  );
end entity firm_integer_divide;

architecture rtl of firm_integer_divide is

  type state_t is (IDLE, DIVIDE, CHECK, CORRECT, SIGN, FINISH);

  signal state_r     : state_t;
  signal count_r     : natural range 0 to WIDTH-1;
  -- The signs of a and b differ, b is negative, and b is zero.
  signal differ_r    : std_logic;
  signal negative_r  : std_logic;
  signal is_zero_r   : std_logic;
  -- Nothing remains.
  signal is_exact_r  : std_logic;

  -- Remaining digits of |a|, and below them those of the quotient; in the end, the quotient.
  signal digits_r    : unsigned(WIDTH-1 downto 0);
  signal divisor_r   : unsigned(WIDTH-1 downto 0);
  signal remainder_r : unsigned(WIDTH-1 downto 0);

  function magnitude(number : std_logic_vector) return unsigned is
  begin
    if number(number'left) = '1' then
      return unsigned(-signed(number));
    end if;
    return unsigned(number);
  end function magnitude;

begin

  in_ready      <= '1' when state_r = IDLE else '0';
  out_valid     <= '1' when state_r = FINISH else '0';
  out_quotient  <= std_logic_vector(digits_r);
  out_remainder <= std_logic_vector(remainder_r);

  control : process (clk)
    variable extended   : unsigned(WIDTH downto 0);
    variable difference : unsigned(WIDTH downto 0);
  begin
    if rising_edge(clk) then
      if state_r = IDLE then
        count_r     <= WIDTH-1;
        differ_r    <= in_a(WIDTH-1) xor in_b(WIDTH-1);
        negative_r  <= in_b(WIDTH-1);
        is_zero_r   <= '0';
        digits_r    <= magnitude(in_a);
        divisor_r   <= magnitude(in_b);
        remainder_r <= (others => '0');
        if unsigned(in_b) = 0 then
          is_zero_r <= '1';
        end if;
        if in_valid = '1' then
          state_r <= DIVIDE;
        end if;

      elsif state_r = DIVIDE then
        extended    := remainder_r & digits_r(WIDTH-1);
        difference  := extended - divisor_r;
        digits_r    <= digits_r(WIDTH-2 downto 0) & not difference(WIDTH);
        remainder_r <= difference(WIDTH-1 downto 0);
        if difference(WIDTH) = '1' then
          remainder_r <= extended(WIDTH-1 downto 0);
        end if;
        if count_r = 0 then
          state_r <= CHECK;
        else
          count_r <= count_r - 1;
        end if;

      elsif state_r = CHECK then
        is_exact_r <= '0';
        if remainder_r = 0 then
          is_exact_r <= '1';
        end if;
        state_r <= CORRECT;

      elsif state_r = CORRECT then
        -- The quotient of different signs is rounded down, away from zero.
        if differ_r = '1' and is_exact_r = '1' then
          digits_r <= unsigned(-signed(digits_r));
        elsif differ_r = '1' then
          digits_r    <= not digits_r;
          remainder_r <= divisor_r - remainder_r;
        end if;
        state_r <= SIGN;

      elsif state_r = SIGN then
        if negative_r = '1' then
          remainder_r <= unsigned(-signed(remainder_r));
        end if;
        if is_zero_r = '1' then
          digits_r    <= (others => '0');
          remainder_r <= (others => '0');
        end if;
        state_r <= FINISH;

      elsif out_ready = '1' then
        state_r <= IDLE;
      end if;

      if rst_n = '0' then
        state_r <= IDLE;
      end if;
    end if;
  end process control;

end architecture rtl;
