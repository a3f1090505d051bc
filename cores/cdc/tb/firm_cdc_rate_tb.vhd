-- SPDX-License-Identifier: Apache-2.0
-- Measures the interval of messages through the crossing with a source and a sink that never wait.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_cdc_rate_tb is
  generic (
    S_PERIOD_PS : integer := 10000;
    M_PERIOD_PS : integer := 10000;
    SEED        : integer := 1;
    MESSAGES    : integer := 1000;
    -- The limit of the mean interval in picoseconds.
    MOST_PS : integer := 200000
  );
end entity firm_cdc_rate_tb;

architecture simulation of firm_cdc_rate_tb is

  signal s_clk    : std_logic := '0';
  signal m_clk    : std_logic;
  signal rst_n    : std_logic := '0';
  signal seen     : std_logic;
  signal released : std_logic;
  signal m_rst_n  : std_logic;
  signal s_ready  : std_logic;
  signal finished : boolean   := false;

begin

  s_clk <= not s_clk after S_PERIOD_PS * 500 fs when not finished else '0';
  rst_n <= '1' after S_PERIOD_PS * 3 ps;

  u_clock : entity firm.firm_sim_clock
    generic map (
      PERIOD_PS => M_PERIOD_PS,
      SEED      => SEED
    )
    port map (
      reference => s_clk,
      clk       => m_clk
    );

  u_seen : entity firm.firm_cdc_reset
    port map (
      clk          => m_clk,
      rst_n        => rst_n,
      synced_rst_n => seen
    );

  u_released : entity firm.firm_cdc_reset
    port map (
      clk          => s_clk,
      rst_n        => rst_n,
      may_end      => seen,
      synced_rst_n => released
    );

  u_reset : entity firm.firm_cdc_reset
    port map (
      clk          => m_clk,
      rst_n        => rst_n,
      may_end      => released,
      synced_rst_n => m_rst_n
    );

  u_message : entity firm.firm_cdc_message
    port map (
      s_clk           => s_clk,
      s_rst_n         => released,
      s_segment_valid => "1",
      s_valid         => '1',
      s_ready         => s_ready,
      s_settled       => open,
      s_idle          => open,
      m_clk           => m_clk,
      m_rst_n         => m_rst_n,
      m_fields        => open,
      m_segment_valid => open,
      m_valid         => open,
      m_ready         => '1'
    );

  count : process
    variable begun : time;
    variable mean  : time;
  begin
    wait until rising_edge(s_clk) and s_ready = '1' for 1 ms;
    begun := now;
    for message in 1 to MESSAGES loop
      wait until rising_edge(s_clk) and s_ready = '1' for 1 ms;
    end loop;
    mean := (now - begun) / MESSAGES;
    assert mean <= MOST_PS * 1 ps
      report "a message takes " & time'image(mean) severity failure;
    report "PASS a message takes " & time'image(mean);
    finished <= true;
    wait;
  end process count;

end architecture simulation;
