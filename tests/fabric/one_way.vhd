-- SPDX-License-Identifier: Apache-2.0
-- Two generated nodes with a GMII each, connected to each other. The system of the one sends a frame of FRAME_BYTES
-- again and again; the system of the other one takes what comes. When both know each other, the results are, for each
-- of COUNT frames, the cycles from its last beat at the one system to the first beat at the other.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
library firm;

entity one_way is
  generic (
    RESULT_FILE : string  := "one_way.txt";
    FRAME_BYTES : integer := 33; -- with id and length
    COUNT       : integer := 20;
    PHASE       : integer := 3   -- nanoseconds by which the second board is late, 1 to 7
  );
end entity one_way;

architecture simulation of one_way is

  constant PERIOD        : time     := 8 ns;
  constant HEAD_BYTES    : positive := 5;
  constant PAUSE_CYCLES  : positive := 5001;     -- between two frames; no multiple of a millisecond's
  constant LONGEST_START : positive := 2000000;  -- cycles until both know each other

  subtype beat_t is std_logic_vector(7 downto 0);
  type beats_t is array (0 to 1) of beat_t;
  subtype pair_t is std_logic_vector(0 to 1);

  signal clks  : pair_t    := "00";
  signal rst_n : std_logic := '0';
  signal over  : boolean   := false;

  signal rx_step : pair_t;
  signal rx_dv   : pair_t;
  signal rx_er   : pair_t;
  signal rxd     : beats_t;
  signal tx_step : pair_t;
  signal tx_en   : pair_t;
  signal tx_er   : pair_t;
  signal txd     : beats_t;
  -- The lines, by the board that sends.
  signal line_en : pair_t;
  signal line_d  : beats_t;

  signal s_tdata  : beat_t    := x"00";
  signal s_tvalid : std_logic := '0';
  signal s_tlast  : std_logic := '0';
  signal s_tready : std_logic;
  signal m_tvalid : std_logic;

begin

  clks(0) <= not clks(0) after PERIOD/2 when not over else '0';
  clks(1) <= transport clks(0) after PHASE * 1 ns;

  boards : for board in 0 to 1 generate

    u_gmii : entity firm.firm_gmii
      port map (
        clk         => clks(board),
        rst_n       => rst_n,
        gmii_rx_clk => clks(1-board),
        gmii_rx_dv  => line_en(1-board),
        gmii_rx_er  => '0',
        gmii_rxd    => line_d(1-board),
        gmii_tx_en  => line_en(board),
        gmii_tx_er  => open,
        gmii_txd    => line_d(board),
        rx_step     => rx_step(board),
        rx_dv       => rx_dv(board),
        rx_er       => rx_er(board),
        rxd         => rxd(board),
        tx_step     => tx_step(board),
        tx_en       => tx_en(board),
        tx_er       => tx_er(board),
        txd         => txd(board)
      );

  end generate boards;

  u_talker : entity firm.talker_system_node
    port map (
      clk           => clks(0),
      rst_n         => rst_n,
      rx_step       => rx_step(0),
      rx_dv         => rx_dv(0),
      rx_er         => rx_er(0),
      rxd           => rxd(0),
      tx_step       => tx_step(0),
      tx_en         => tx_en(0),
      tx_er         => tx_er(0),
      txd           => txd(0),
      m_axis_tdata  => open,
      m_axis_tkeep  => open,
      m_axis_tuser  => open,
      m_axis_tvalid => open,
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

  u_listener : entity firm.listener_system_node
    port map (
      clk           => clks(1),
      rst_n         => rst_n,
      rx_step       => rx_step(1),
      rx_dv         => rx_dv(1),
      rx_er         => rx_er(1),
      rxd           => rxd(1),
      tx_step       => tx_step(1),
      tx_en         => tx_en(1),
      tx_er         => tx_er(1),
      txd           => txd(1),
      m_axis_tdata  => open,
      m_axis_tkeep  => open,
      m_axis_tuser  => open,
      m_axis_tvalid => m_tvalid,
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
    file     results  : text open write_mode is RESULT_FILE;
    variable result   : line;
    variable began    : time;
    variable is_known : boolean := false;
    variable left     : integer := COUNT;

    procedure send is
    begin
      for place in 1 to FRAME_BYTES loop
        s_tvalid <= '1';
        s_tdata  <= x"00";
        s_tlast  <= '0';
        if place = 2 then
          s_tdata <= std_logic_vector(to_unsigned(FRAME_BYTES-HEAD_BYTES, 8));
        elsif place = FRAME_BYTES then
          s_tlast <= '1';
        end if;
        wait until rising_edge(clks(0)) and s_tready = '1';
      end loop;
      s_tvalid <= '0';
    end procedure send;

  begin
    for cycle in 1 to 8 loop
      wait until rising_edge(clks(0));
    end loop;
    rst_n <= '1';
    while left > 0 loop
      send;
      began := now;
      wait until rising_edge(clks(1)) and m_tvalid = '1' for PAUSE_CYCLES*PERIOD;
      if m_tvalid = '1' then
        -- A cycle that has begun counts. The first frame tells that both know each other.
        if is_known then
          write(result, (now - began + PERIOD - 1 ps) / PERIOD);
          writeline(results, result);
          left := left - 1;
        end if;
        is_known := true;
        wait for PAUSE_CYCLES*PERIOD;
      else
        assert not is_known report "a frame is lost" severity failure;
        assert now < LONGEST_START*PERIOD report "the boards do not find each other" severity failure;
      end if;
      wait until rising_edge(clks(0));
    end loop;
    over <= true;
    wait;
  end process run;

end architecture simulation;
