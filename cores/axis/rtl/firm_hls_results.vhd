-- SPDX-License-Identifier: Apache-2.0
-- Stores a field, or the elements of an array of fixed size, that an HLS kernel writes as into a FIFO (`ap_fifo`):
-- COUNT values, element 0 first. `values` are stable while `valid` is high. The FIFO is full after the last one.
library ieee;
use ieee.std_logic_1164.all;

entity firm_hls_results is
  generic (
    BITS  : integer := 8;
    COUNT : integer := 1
  );
  port (
    clk : in std_logic;

    -- While it is low, no message is in progress.
    is_open : in std_logic;

    din    : in  std_logic_vector(BITS-1 downto 0);
    full_n : out std_logic;
    write  : in  std_logic;

    values : out std_logic_vector(BITS*COUNT-1 downto 0);
    valid  : out std_logic
  );
end entity firm_hls_results;

architecture rtl of firm_hls_results is

  signal index_r : natural range 0 to COUNT-1;
  signal done_r  : std_logic;

begin

  assert BITS >= 1 and COUNT >= 1
    report "firm_hls_results: BITS is " & integer'image(BITS) & " and COUNT is " & integer'image(COUNT)
           & "; legal: 1 or more"
    severity failure;

  full_n <= is_open and not done_r;
  valid  <= done_r;

  store : process (clk)
  begin
    if rising_edge(clk) then
      if is_open = '0' then
        index_r <= 0;
        done_r  <= '0';
      elsif write = '1' and done_r = '0' then
        for place in 0 to COUNT-1 loop
          if index_r = place then
            values(BITS*place+BITS-1 downto BITS*place) <= din;
          end if;
        end loop;
        if index_r = COUNT-1 then
          done_r <= '1';
        else
          index_r <= index_r + 1;
        end if;
      end if;
    end if;
  end process store;

end architecture rtl;
