-- SPDX-License-Identifier: Apache-2.0
-- Offers a field, or the elements of an array of fixed size, to an HLS kernel as the output of a FIFO (`ap_fifo`): each
-- of the COUNT values once, element 0 first. `values` must be stable while `valid` is high.
library ieee;
use ieee.std_logic_1164.all;

entity firm_hls_values is
  generic (
    BITS  : integer := 8;
    COUNT : integer := 1
  );
  port (
    clk : in std_logic;

    -- While it is low, no message is in progress.
    is_open : in std_logic;

    values : in std_logic_vector(BITS*COUNT-1 downto 0);
    valid  : in std_logic;

    dout    : out std_logic_vector(BITS-1 downto 0);
    empty_n : out std_logic;
    read    : in  std_logic
  );
end entity firm_hls_values;

architecture rtl of firm_hls_values is

  signal index_r : natural range 0 to COUNT-1;
  signal done_r  : std_logic;

begin

  assert BITS >= 1 and COUNT >= 1
    report "firm_hls_values: BITS is " & integer'image(BITS) & " and COUNT is " & integer'image(COUNT)
           & "; legal: 1 or more"
    severity failure;

  empty_n <= valid and is_open and not done_r;

  select_value : process (values, index_r)
  begin
    dout <= values(BITS-1 downto 0);
    for place in 1 to COUNT-1 loop
      if index_r = place then
        dout <= values(BITS*place+BITS-1 downto BITS*place);
      end if;
    end loop;
  end process select_value;

  count_values : process (clk)
  begin
    if rising_edge(clk) then
      if is_open = '0' then
        index_r <= 0;
        done_r  <= '0';
      elsif read = '1' and valid = '1' and done_r = '0' then
        if index_r = COUNT-1 then
          done_r <= '1';
        else
          index_r <= index_r + 1;
        end if;
      end if;
    end if;
  end process count_values;

end architecture rtl;
