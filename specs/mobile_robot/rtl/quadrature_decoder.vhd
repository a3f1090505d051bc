-- SPDX-License-Identifier: Apache-2.0
-- Counts the edges of A and B of a quadrature encoder between two samples.
--
-- Both lines are synchronised, and a change counts only when FILTER samples in a row agree: shorter glitches are
-- ignored. A leads B when the wheel turns forward. If both change at once, the direction is unknown, and an error is
-- counted instead of a step. A step in the cycle of a sample belongs to the next sample, so no step is lost.

library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity quadrature_decoder is
  generic (
    -- Samples that must agree, at least 2. A change counts only if the line is stable for that many cycles.
    FILTER     : positive := 4;
    COUNT_BITS : positive := 8
  );
  port (
    clk    : in  std_logic;
    rst_n  : in  std_logic;

    -- From outside, not synchronous to clk.
    enc_a  : in  std_logic;
    enc_b  : in  std_logic;

    -- One cycle: restart the count.
    sample : in  std_logic;
    -- Counts since then, positive forward; saturates.
    count  : out std_logic_vector(COUNT_BITS-1 downto 0);
    -- Changes of both lines at once, since the reset; saturates at 255.
    errors : out std_logic_vector(7 downto 0)
  );
end entity quadrature_decoder;

architecture rtl of quadrature_decoder is

  -- The lowest bit may be metastable, so it is not used.
  signal a_r        : std_logic_vector(FILTER downto 0);
  signal b_r        : std_logic_vector(FILTER downto 0);
  signal a_stable_r : std_logic;
  signal b_stable_r : std_logic;
  signal a_before_r : std_logic;
  signal b_before_r : std_logic;
  -- Counts until the filters hold the initial state of the lines.
  signal settling_r : natural range 0 to FILTER + 2;
  signal settled_r  : std_logic;
  signal count_r    : signed(COUNT_BITS-1 downto 0);
  signal errors_r   : unsigned(7 downto 0);

  -- The value on which all samples but the first agree, else the previous value.
  function stable(samples : std_logic_vector; before : std_logic) return std_logic is
    variable ones  : std_logic := '1';
    variable zeros : std_logic := '1';
  begin
    for k in 1 to FILTER loop
      ones  := ones and samples(k);
      zeros := zeros and not samples(k);
    end loop;
    return ones or (before and not zeros);
  end function stable;

begin

  assert FILTER >= 2 and FILTER <= 250
    report "quadrature_decoder: FILTER is " & integer'image(FILTER) & ", legal: 2 to 250"
    severity failure;

  count  <= std_logic_vector(count_r);
  errors <= std_logic_vector(errors_r);

  filters : process (clk)
  begin
    if rising_edge(clk) then
      a_r        <= a_r(FILTER-1 downto 0) & enc_a;
      b_r        <= b_r(FILTER-1 downto 0) & enc_b;
      a_stable_r <= stable(a_r, a_stable_r);
      b_stable_r <= stable(b_r, b_stable_r);
      a_before_r <= a_stable_r;
      b_before_r <= b_stable_r;
      -- The position of a wheel after the reset is not a step.
      if settling_r = FILTER + 2 then
        settled_r <= '1';
      else
        settling_r <= settling_r + 1;
      end if;
      if rst_n = '0' then
        a_r        <= (others => '0');
        b_r        <= (others => '0');
        a_stable_r <= '0';
        b_stable_r <= '0';
        settling_r <= 0;
        settled_r  <= '0';
      end if;
    end if;
  end process filters;

  counter : process (clk)
    variable from  : signed(COUNT_BITS-1 downto 0);
    variable moves : boolean;
  begin
    if rising_edge(clk) then
      from := count_r;
      if sample = '1' then
        from := (others => '0');
      end if;
      count_r <= from;
      -- One line has changed, not both.
      moves   := settled_r = '1' and (a_stable_r xor a_before_r xor b_stable_r xor b_before_r) = '1';
      if moves then
        -- A leads: what A becomes differs from what B was.
        if (a_stable_r xor b_before_r) = '1' then
          if from /= 2**(COUNT_BITS-1) - 1 then
            count_r <= from + 1;
          end if;
        elsif from /= -(2**(COUNT_BITS-1) - 1) then
          count_r <= from - 1;
        end if;
      elsif settled_r = '1' and a_stable_r /= a_before_r and errors_r /= 255 then
        errors_r <= errors_r + 1;
      end if;
      if rst_n = '0' then
        count_r  <= (others => '0');
        errors_r <= (others => '0');
      end if;
    end if;
  end process counter;

end architecture rtl;
