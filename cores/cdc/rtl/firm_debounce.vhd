-- SPDX-License-Identifier: Apache-2.0
-- Debounces a button or a switch: the output follows the pin after the pin has kept its level for CYCLES cycles. The
-- pin is synchronised first, so it needs no other synchroniser.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_debounce is
  generic (
    -- Cycles of clk for which the level must stay. Contacts bounce for up to some 10 ms.
    CYCLES : integer := 1000000;
    -- The output after configuration of the FPGA.
    INITIAL : std_logic := '0'
  );
  port (
    clk       : in  std_logic;
    pin       : in  std_logic;
    debounced : out std_logic
  );
end entity firm_debounce;

architecture rtl of firm_debounce is

  signal synced      : std_logic_vector(0 downto 0);
  signal debounced_r : std_logic := INITIAL;
  -- Further cycles for which the pin must differ from the output.
  signal left_r : natural range 0 to CYCLES-1 := CYCLES-1;

begin

  assert CYCLES >= 4
    report "firm_debounce: CYCLES is " & integer'image(CYCLES) & "; legal: 4 and more"
    severity failure;

  u_sync : entity firm.firm_cdc_sync
    port map (
      clk      => clk,
      level(0) => pin,
      synced   => synced
    );

  -- It has no reset, since it may generate one.
  follow : process (clk)
  begin
    if rising_edge(clk) then
      if synced(0) = debounced_r then
        left_r <= CYCLES-1;
      elsif left_r /= 0 then
        left_r <= left_r - 1;
      else
        left_r      <= CYCLES-1;
        debounced_r <= synced(0);
      end if;
    end if;
  end process follow;

  debounced <= debounced_r;

end architecture rtl;
