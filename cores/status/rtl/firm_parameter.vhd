-- SPDX-License-Identifier: Apache-2.0
-- Holds a parameter of an accelerator: a word that software writes to a register, and that changes at the accelerator
-- only between two messages. A word outside of the range is ignored; the last legal one stays in effect.
--
-- The value is `BITS` bits of the word. It is an unsigned number, or with IS_SIGNED one in two's complement, or with
-- IS_FLOAT a float of 32 bits.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity firm_parameter is
  generic (
    -- Bits of the accelerator's port.
    BITS : integer := 32;
    -- The number's form; at most one is true.
    IS_SIGNED : boolean := false;
    IS_FLOAT  : boolean := false;
    -- The range, and the value after reset.
    LEAST   : std_logic_vector(31 downto 0);
    MOST    : std_logic_vector(31 downto 0);
    INITIAL : std_logic_vector(31 downto 0)
  );
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    wanted    : in  std_logic_vector(31 downto 0);
    -- The next rising edge is between two messages.
    between   : in  std_logic;
    in_effect : out std_logic_vector(31 downto 0);
    value     : out std_logic_vector(BITS-1 downto 0)
  );
end entity firm_parameter;

architecture rtl of firm_parameter is

  -- Words as unsigned numbers in the order of their values.
  function ordered(word : std_logic_vector(31 downto 0)) return unsigned is
    variable key : std_logic_vector(31 downto 0);
  begin
    key := word;
    if IS_FLOAT and word(31) = '1' then
      key := not word;
    elsif IS_FLOAT or IS_SIGNED then
      key(31) := not word(31);
    end if;
    return unsigned(key);
  end function ordered;

  signal wanted_r   : std_logic_vector(31 downto 0);
  signal is_legal_r : std_logic;
  signal value_r    : std_logic_vector(31 downto 0);

begin

  assert BITS >= 1 and BITS <= 32
    report "firm_parameter: BITS is " & integer'image(BITS) & "; legal: 1 to 32"
    severity failure;
  assert ordered(LEAST) <= ordered(INITIAL) and ordered(INITIAL) <= ordered(MOST)
    report "firm_parameter: INITIAL is outside of the range from LEAST to MOST"
    severity failure;

  change : process (clk)
  begin
    if rising_edge(clk) then
      wanted_r   <= wanted;
      is_legal_r <= '0';
      if ordered(wanted) >= ordered(LEAST) and ordered(wanted) <= ordered(MOST) then
        is_legal_r <= '1';
      end if;
      if is_legal_r = '1' and between = '1' then
        value_r <= wanted_r;
      end if;
      if rst_n = '0' then
        is_legal_r <= '0';
        value_r    <= INITIAL;
      end if;
    end if;
  end process change;

  in_effect <= value_r;
  value     <= value_r(BITS-1 downto 0);

end architecture rtl;
