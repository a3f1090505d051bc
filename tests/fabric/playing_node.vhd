-- SPDX-License-Identifier: Apache-2.0
-- The generated node of a system at a line that a file plays. A row is a burst: the cycles before it, the number of
-- bytes, and the bytes. Each frame to the system is a row of the results: the number of bytes, and the bytes. Each byte
-- that the node sends is a row of another file.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;

entity playing_node is
  generic (
    LAST_CYCLES : integer := 20000;
    LINE_FILE   : string  := "line.txt";
    RESULT_FILE : string  := "taken.txt";
    SENT_FILE   : string  := "sent.txt"
  );
end entity playing_node;

architecture simulation of playing_node is

  signal clk    : std_logic := '0';
  signal rst_n  : std_logic := '0';
  signal over   : boolean   := false;
  signal rx_dv  : std_logic := '0';
  signal rxd    : std_logic_vector(7 downto 0) := x"00";
  signal tx_en  : std_logic;
  signal txd    : std_logic_vector(7 downto 0);
  signal tdata  : std_logic_vector(7 downto 0);
  signal tvalid : std_logic;
  signal tlast  : std_logic;

begin

  clk <= not clk after 2 us when not over else '0';

  u_node : entity firm.turtle_system_node
    port map (
      clk           => clk,
      rst_n         => rst_n,
      rx_step       => '1',
      rx_dv         => rx_dv,
      rx_er         => '0',
      rxd           => rxd,
      tx_step       => '1',
      tx_en         => tx_en,
      tx_er         => open,
      txd           => txd,
      m_axis_tdata  => tdata,
      m_axis_tkeep  => open,
      m_axis_tuser  => open,
      m_axis_tvalid => tvalid,
      m_axis_tlast  => tlast,
      m_axis_tready => '1',
      s_axis_tdata  => x"00",
      s_axis_tkeep  => "1",
      s_axis_tuser  => "0",
      s_axis_tvalid => '0',
      s_axis_tlast  => '0',
      s_axis_tready => open,
      network_error => open
    );

  play : process
    file bursts    : text open read_mode is LINE_FILE;
    variable row   : line;
    variable count : natural;
    variable byte  : natural;
  begin
    for cycle in 1 to 10 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    while not endfile(bursts) loop
      readline(bursts, row);
      read(row, count);
      for cycle in 1 to count loop
        wait until rising_edge(clk);
      end loop;
      read(row, count);
      for place in 1 to count loop
        read(row, byte);
        rx_dv <= '1';
        rxd   <= std_logic_vector(to_unsigned(byte, 8));
        wait until rising_edge(clk);
      end loop;
      rx_dv <= '0';
    end loop;
    for cycle in 1 to LAST_CYCLES loop
      wait until rising_edge(clk);
    end loop;
    over <= true;
    wait;
  end process play;

  record_frames : process
    file results     : text open write_mode is RESULT_FILE;
    variable row     : line;
    variable content : line;
    variable size    : natural := 0;
  begin
    while not over loop
      wait until rising_edge(clk) or over;
      next when over or tvalid /= '1';
      size := size + 1;
      write(content, ' ' & integer'image(to_integer(unsigned(tdata))));
      if tlast = '1' then
        write(row, integer'image(size) & content.all);
        writeline(results, row);
        deallocate(content);
        size := 0;
      end if;
    end loop;
    wait;
  end process record_frames;

  record_bytes : process (clk)
    file sent    : text open write_mode is SENT_FILE;
    variable row : line;
  begin
    if rising_edge(clk) and tx_en = '1' then
      write(row, to_integer(unsigned(txd)));
      writeline(sent, row);
    end if;
  end process record_bytes;

end architecture simulation;
