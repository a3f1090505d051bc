-- SPDX-License-Identifier: Apache-2.0
-- Converts a 64-bit two's complement fixed-point number to float64, rounded to nearest, ties to even.
--
-- Three pipeline registers, one number per cycle, no stalls: magnitude, coarse and fine normalisation. The
-- rounding adder drives the output, so the user's own register must end its path. Zero is always +0.

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

    -- High three cycles after in_valid.
    out_valid  : out std_logic;
    out_number : out std_logic_vector(63 downto 0)
  );
end entity firm_fixed_to_float64;

architecture rtl of firm_fixed_to_float64 is

  -- float64's exponent of a number whose leading one is bit 63.
  constant TOP_EXPONENT : integer := 1023 + 63 - FRACTION;

  subtype magnitude_t is unsigned(63 downto 0);

  signal valid_r       : std_logic_vector(2 downto 0);
  signal magnitude_r   : magnitude_t;
  signal sign_r        : std_logic;

  signal coarse_r      : magnitude_t;
  signal coarse_sign_r : std_logic;
  -- Leading zeros, in eights.
  signal eights_r      : unsigned(2 downto 0);

  signal fine_r        : magnitude_t;
  signal fine_sign_r   : std_logic;
  signal zeros_r       : unsigned(5 downto 0);

begin

  assert FRACTION <= 512
    report "firm_fixed_to_float64: FRACTION is " & integer'image(FRACTION) & ", legal: 0 to 512"
    severity failure;

  out_valid <= valid_r(2);

  valid : process (clk)
  begin
    if rising_edge(clk) then
      valid_r <= valid_r(1 downto 0) & in_valid;
      if rst_n = '0' then
        valid_r <= (others => '0');
      end if;
    end if;
  end process valid;

  normalise : process (clk)
    variable number : magnitude_t;
    variable eights : unsigned(2 downto 0);
    variable ones   : unsigned(2 downto 0);
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
        number := magnitude_r;
        eights := (others => '0');
        for k in eights'range loop
          if number(63 downto 64-8*2**k) = 0 then
            number    := shift_left(number, 8*2**k);
            eights(k) := '1';
          end if;
        end loop;
        coarse_r      <= number;
        coarse_sign_r <= sign_r;
        eights_r      <= eights;
      end if;

      if valid_r(1) = '1' then
        number := coarse_r;
        ones   := (others => '0');
        for k in ones'range loop
          if number(63 downto 64-2**k) = 0 then
            number  := shift_left(number, 2**k);
            ones(k) := '1';
          end if;
        end loop;
        fine_r      <= number;
        fine_sign_r <= coarse_sign_r;
        zeros_r     <= eights_r & ones;
      end if;
    end if;
  end process normalise;

  round : process (fine_r, fine_sign_r, zeros_r)
    variable exponent : unsigned(10 downto 0);
    variable up       : unsigned(0 downto 0);
    variable rounded  : unsigned(62 downto 0);
  begin
    up := "0";
    if fine_r(10) = '1' and (fine_r(11) = '1' or fine_r(9 downto 0) /= 0) then
      up := "1";
    end if;
    exponent := TOP_EXPONENT - resize(zeros_r, 11);
    -- A mantissa that rounds up to two correctly carries into the exponent.
    rounded    := (exponent & fine_r(62 downto 11)) + up;
    out_number <= fine_sign_r & std_logic_vector(rounded);
    if fine_r(63) = '0' then
      out_number <= (others => '0');
    end if;
  end process round;

end architecture rtl;
