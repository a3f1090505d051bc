-- SPDX-License-Identifier: Apache-2.0
-- Transfers a reset to another clock domain: it begins with `rst_n` at once, even without a clock. It ends with a
-- rising edge, at least three edges after both `rst_n` and `may_end` are high. A reset is therefore never too short to
-- be seen, and when it ends, synchronisers no longer hold values from before it.
--
-- Constraint: the paths to the registers' clear and into first_r are asynchronous
-- (docs/how-to/use-several-clocks.md).
library ieee;
use ieee.std_logic_1164.all;

entity firm_cdc_reset is
  port (
    clk   : in std_logic;
    -- Must come from a register, because it clears asynchronously.
    rst_n : in std_logic;
    -- From any domain; low while `rst_n` is low, and for as long as the reset must last.
    may_end : in std_logic := '1';

    synced_rst_n : out std_logic
  );
end entity firm_cdc_reset;

architecture rtl of firm_cdc_reset is

  -- The first stage has a separate name, to which constraints refer.
  signal first_r  : std_logic;
  signal stages_r : std_logic_vector(1 downto 0);

  attribute async_reg : string;
  attribute preserve  : boolean;
  attribute async_reg of first_r, stages_r : signal is "true";
  attribute preserve of first_r, stages_r  : signal is true;

begin

  pass_on : process (clk, rst_n)
  begin
    if rst_n = '0' then
      first_r  <= '0';
      stages_r <= (others => '0');
    elsif rising_edge(clk) then
      first_r  <= may_end;
      stages_r <= stages_r(0) & first_r;
    end if;
  end process pass_on;

  synced_rst_n <= stages_r(1);

end architecture rtl;
