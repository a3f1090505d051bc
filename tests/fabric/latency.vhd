-- SPDX-License-Identifier: Apache-2.0
-- The generated node of a system between a PHY's GMII and a system. Each row of the frames is the number of bytes on
-- the line, and the bytes; there is much time before each. The last one has a sample, whose first beat is awaited. Then
-- the system sends a frame of as many bytes as FRAME_BYTES. The results are the cycles from the last byte of the sample
-- to its first beat, `in`, and from the last beat of the system's frame to the first byte of the PHY, `out`.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;

entity latency is
  generic (
    FRAME_FILE  : string  := "frames.txt";
    RESULT_FILE : string  := "latency.txt";
    FRAME_BYTES : integer := 41; -- with id and length
    PHASE       : integer := 1   -- nanoseconds from a clock's edge to one of the PHY's, 1 to 7
  );
end entity latency;

architecture simulation of latency is

  constant PERIOD      : time     := 8 ns;
  constant HEAD_BYTES  : positive := 5;
  constant IDLE_CYCLES : positive := 6000;  -- in which the node does all that a frame causes

  signal clk   : std_logic := '0';
  signal rst_n : std_logic := '0';
  signal over  : boolean   := false;

  signal gmii_rx_clk : std_logic;
  signal gmii_rx_dv  : std_logic := '0';
  signal gmii_rxd    : std_logic_vector(7 downto 0) := x"00";
  signal gmii_tx_en  : std_logic;
  signal rx_step     : std_logic;
  signal rx_dv       : std_logic;
  signal rx_er       : std_logic;
  signal rxd         : std_logic_vector(7 downto 0);
  signal tx_step     : std_logic;
  signal tx_en       : std_logic;
  signal tx_er       : std_logic;
  signal txd         : std_logic_vector(7 downto 0);

  signal m_tvalid : std_logic;
  signal s_tdata  : std_logic_vector(7 downto 0) := x"00";
  signal s_tvalid : std_logic := '0';
  signal s_tlast  : std_logic := '0';
  signal s_tready : std_logic;

begin

  clk         <= not clk after PERIOD/2 when not over else '0';
  gmii_rx_clk <= transport clk after PHASE * 1 ns;

  u_gmii : entity firm.firm_gmii
    port map (
      clk         => clk,
      rst_n       => rst_n,
      gmii_rx_clk => gmii_rx_clk,
      gmii_rx_dv  => gmii_rx_dv,
      gmii_rx_er  => '0',
      gmii_rxd    => gmii_rxd,
      gmii_tx_en  => gmii_tx_en,
      gmii_tx_er  => open,
      gmii_txd    => open,
      rx_step     => rx_step,
      rx_dv       => rx_dv,
      rx_er       => rx_er,
      rxd         => rxd,
      tx_step     => tx_step,
      tx_en       => tx_en,
      tx_er       => tx_er,
      txd         => txd
    );

  u_node : entity firm.turtle_system_node
    port map (
      clk           => clk,
      rst_n         => rst_n,
      rx_step       => rx_step,
      rx_dv         => rx_dv,
      rx_er         => rx_er,
      rxd           => rxd,
      tx_step       => tx_step,
      tx_en         => tx_en,
      tx_er         => tx_er,
      txd           => txd,
      m_axis_tdata  => open,
      m_axis_tkeep  => open,
      m_axis_tuser  => open,
      m_axis_tvalid => m_tvalid,
      m_axis_tlast  => open,
      m_axis_tready => '1',
      s_axis_tdata  => s_tdata,
      s_axis_tkeep  => "1",
      s_axis_tuser  => "0",
      s_axis_tvalid => s_tvalid,
      s_axis_tlast  => s_tlast,
      s_axis_tready => s_tready,
      network_error => open
    );

  run : process
    file     frames  : text open read_mode is FRAME_FILE;
    file     results : text open write_mode is RESULT_FILE;
    variable row     : line;
    variable size    : integer;
    variable byte    : integer;
    variable began   : time;

    procedure tell(name : in string) is
      variable result : line;
    begin
      -- A cycle that has begun counts.
      write(result, name & ' ' & integer'image((now - began + PERIOD - 1 ps) / PERIOD));
      writeline(results, result);
    end procedure tell;

  begin
    for cycle in 1 to 8 loop
      wait until rising_edge(clk);
    end loop;
    rst_n <= '1';
    while not endfile(frames) loop
      for cycle in 1 to IDLE_CYCLES loop
        wait until rising_edge(clk);
        assert m_tvalid = '0' report "a beat comes early" severity failure;
      end loop;
      readline(frames, row);
      read(row, size);
      wait until rising_edge(gmii_rx_clk);
      for place in 1 to size loop
        read(row, byte);
        gmii_rx_dv <= '1';
        gmii_rxd   <= std_logic_vector(to_unsigned(byte, 8));
        wait until rising_edge(gmii_rx_clk);
      end loop;
      gmii_rx_dv <= '0';
      began      := now;
    end loop;
    wait until rising_edge(clk) and m_tvalid = '1' for IDLE_CYCLES*PERIOD;
    assert m_tvalid = '1' report "no beat comes" severity failure;
    tell("in");
    for cycle in 1 to IDLE_CYCLES loop
      wait until rising_edge(clk);
    end loop;
    assert gmii_tx_en = '0' report "the node is sending" severity failure;
    for place in 1 to FRAME_BYTES loop
      s_tvalid <= '1';
      s_tdata  <= x"00";
      s_tlast  <= '0';
      if place = 2 then
        s_tdata <= std_logic_vector(to_unsigned(FRAME_BYTES-HEAD_BYTES, 8));
      elsif place = FRAME_BYTES then
        s_tlast <= '1';
      end if;
      wait until rising_edge(clk) and s_tready = '1';
    end loop;
    s_tvalid <= '0';
    began    := now;
    wait until rising_edge(clk) and gmii_tx_en = '1' for IDLE_CYCLES*PERIOD;
    assert gmii_tx_en = '1' report "nothing is sent" severity failure;
    tell("out");
    over <= true;
    wait;
  end process run;

end architecture simulation;
