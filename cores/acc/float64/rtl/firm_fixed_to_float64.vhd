-- SPDX-License-Identifier: Apache-2.0
-- Converts a 64-bit two's complement fixed-point number to float64, rounded to nearest, ties to even.
--
-- Five pipeline registers, one number per cycle, no stalls: magnitude, count of zero bytes, coarse and fine
-- normalisation, direction of rounding. The rounding adder drives the output, so the user's own register must end its
-- path. Zero is always +0.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_fixed_to_float64 is
  generic (
    -- Fraction bits of the number: 0 to 512, so that every result is a normal number or 0.
    FRACTION : natural := 60
  );
  port (
    clk        : in  std_logic;
    rst_n      : in  std_logic;

    in_valid   : in  std_logic;
    in_number  : in  std_logic_vector(63 downto 0);

    -- High five cycles after in_valid.
    out_valid  : out std_logic;
    out_number : out std_logic_vector(63 downto 0)
  );
end entity firm_fixed_to_float64;

architecture rtl of firm_fixed_to_float64 is

  constant LATENCY : positive := 5;

  -- float64's exponent of a number whose leading one is bit 63.
  constant TOP_EXPONENT : integer := 1023 + 63 - FRACTION;

  subtype magnitude_t is unsigned(63 downto 0);
  subtype eight_t is unsigned(7 downto 0);

  signal valid_r        : std_logic_vector(LATENCY-1 downto 0);
  signal magnitude_r    : magnitude_t;
  signal sign_r         : std_logic;

  signal counted_r      : magnitude_t;
  signal counted_sign_r : std_logic;
  -- Leading zeros, in eights.
  signal eights_r       : unsigned(2 downto 0);

  signal coarse_r       : magnitude_t;
  signal coarse_sign_r  : std_logic;
  signal coarse_zeros_r : unsigned(2 downto 0);

  signal fine_r         : magnitude_t;
  signal fine_sign_r    : std_logic;
  signal zeros_r        : unsigned(5 downto 0);

  -- The result before rounding, and its last unit if it is rounded up.
  signal number_r       : unsigned(62 downto 0);
  signal number_sign_r  : std_logic;
  signal up_r           : unsigned(0 downto 0);

  -- Up to seven leading zeros.
  function leading_zeros(bits : eight_t) return unsigned is
    variable remaining : eight_t;
    variable zeros     : unsigned(2 downto 0);
  begin
    remaining := bits;
    zeros     := (others => '0');
    for k in zeros'range loop
      if remaining(7 downto 8-2**k) = 0 then
        remaining := shift_left(remaining, 2**k);
        zeros(k)  := '1';
      end if;
    end loop;
    return zeros;
  end function leading_zeros;

begin

  assert FRACTION <= 512
    report "firm_fixed_to_float64: FRACTION is " & integer'image(FRACTION) & ", legal: 0 to 512"
    severity failure;

  out_valid  <= valid_r(LATENCY-1);
  -- A mantissa that rounds up to two correctly carries into the exponent.
  out_number <= number_sign_r & std_logic_vector(number_r + up_r);

  valid : process (clk)
  begin
    if rising_edge(clk) then
      valid_r <= valid_r(LATENCY-2 downto 0) & in_valid;
      if rst_n = '0' then
        valid_r <= (others => '0');
      end if;
    end if;
  end process valid;

  normalise : process (clk)
    variable present : eight_t;
    variable ones    : unsigned(2 downto 0);
  begin
    if rising_edge(clk) then
      if in_valid = '1' then
        -- Replaces numeric_std's abs, which ghdl 2.0 leaves unchanged when it translates to Verilog.
        magnitude_r <= unsigned(in_number);
        sign_r      <= in_number(63);
        if in_number(63) = '1' then
          magnitude_r <= unsigned(-signed(in_number));
        end if;
      end if;

      if valid_r(0) = '1' then
        for k in present'range loop
          present(k) := '0';
          if magnitude_r(8*k+7 downto 8*k) /= 0 then
            present(k) := '1';
          end if;
        end loop;
        counted_r      <= magnitude_r;
        counted_sign_r <= sign_r;
        eights_r       <= leading_zeros(present);
      end if;

      if valid_r(1) = '1' then
        coarse_r       <= shift_left(counted_r, to_integer(eights_r & "000"));
        coarse_sign_r  <= counted_sign_r;
        coarse_zeros_r <= eights_r;
      end if;

      if valid_r(2) = '1' then
        ones        := leading_zeros(coarse_r(63 downto 56));
        fine_r      <= shift_left(coarse_r, to_integer(ones));
        fine_sign_r <= coarse_sign_r;
        zeros_r     <= coarse_zeros_r & ones;
      end if;
    end if;
  end process normalise;

  round : process (clk)
    variable exponent : unsigned(10 downto 0);
  begin
    if rising_edge(clk) then
      if valid_r(3) = '1' then
        exponent      := TOP_EXPONENT - resize(zeros_r, 11);
        number_r      <= exponent & fine_r(62 downto 11);
        number_sign_r <= fine_sign_r;
        up_r          <= "0";
        if fine_r(10) = '1' and (fine_r(11) = '1' or fine_r(9 downto 0) /= 0) then
          up_r <= "1";
        end if;
        if fine_r(63) = '0' then
          number_r      <= (others => '0');
          number_sign_r <= '0';
        end if;
      end if;
    end if;
  end process round;

end architecture rtl;
