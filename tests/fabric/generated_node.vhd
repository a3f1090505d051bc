-- SPDX-License-Identifier: Apache-2.0
-- The generated node of a system at a line from which nothing comes. Each byte that it sends is a row of the results.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;

entity generated_node is
  generic (
    CYCLES      : integer := 3500;
    RESULT_FILE : string  := "sent.txt"
  );
end entity generated_node;

architecture simulation of generated_node is

  signal clk    : std_logic := '0';
  signal rst_n  : std_logic := '0';
  signal over   : boolean   := false;
  signal tx_en  : std_logic;
  signal txd    : std_logic_vector(7 downto 0);

begin

  clk <= not clk after 2 us when not over else '0';

  u_node : entity firm.turtle_system_node
    port map (
      clk           => clk,
      rst_n         => rst_n,
      rx_step       => '1',
      rx_dv         => '0',
      rx_er         => '0',
      rxd           => x"00",
      tx_step       => '1',
      tx_en         => tx_en,
      tx_er         => open,
      txd           => txd,
      m_axis_tdata  => open,
      m_axis_tkeep  => open,
      m_axis_tuser  => open,
      m_axis_tvalid => open,
      m_axis_tlast  => open,
      m_axis_tready => '1',
      s_axis_tdata  => x"00",
      s_axis_tkeep  => "1",
      s_axis_tuser  => "0",
      s_axis_tvalid => '0',
      s_axis_tlast  => '0',
      s_axis_tready => open,
      network_error => open
    );

  run : process
    file results : text open write_mode is RESULT_FILE;
    variable row : line;
  begin
    for cycle in 1 to CYCLES loop
      wait until rising_edge(clk);
      if tx_en = '1' then
        write(row, to_integer(unsigned(txd)));
        writeline(results, row);
      end if;
      if cycle = 4 then
        rst_n <= '1';
      end if;
    end loop;
    over <= true;
    wait;
  end process run;

end architecture simulation;
