-- SPDX-License-Identifier: Apache-2.0
-- Tests the joiner of bursts with the simulation host: the frames of the stimulus file are bursts.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_sim_join_tb is
  generic (
    WIDTH         : integer := 8;
    STIMULUS_FILE : string  := "stimulus.txt";
    EXPECTED_FILE : string  := "expected.txt";
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0
  );
end entity firm_sim_join_tb;

architecture simulation of firm_sim_join_tb is

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal burst_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal burst_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal burst_tuser  : std_logic_vector(0 downto 0);
  signal burst_tid    : std_logic_vector(7 downto 0);
  signal burst_tvalid : std_logic;
  signal burst_tlast  : std_logic;
  signal burst_tready : std_logic;

  signal frame_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal frame_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal frame_tuser  : std_logic_vector(0 downto 0);
  signal frame_tid    : std_logic_vector(7 downto 0);
  signal frame_tvalid : std_logic;
  signal frame_tlast  : std_logic;
  signal frame_tready : std_logic;

begin

  u_host : entity firm.firm_sim_host
    generic map (
      WIDTH         => WIDTH,
      STIMULUS_FILE => STIMULUS_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      RECEIVED_FILE => "received.txt",
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT,
      WATCHDOG      => 200,
      QUIET         => 50
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => burst_tdata,
      m_axis_tkeep  => burst_tkeep,
      m_axis_tuser  => burst_tuser,
      m_axis_tvalid => burst_tvalid,
      m_axis_tlast  => burst_tlast,
      m_axis_tready => burst_tready,
      s_axis_tdata  => frame_tdata,
      s_axis_tkeep  => frame_tkeep,
      s_axis_tuser  => frame_tuser,
      s_axis_tid    => frame_tid,
      s_axis_tvalid => frame_tvalid,
      s_axis_tlast  => frame_tlast,
      s_axis_tready => frame_tready
    );

  u_tid : entity firm.firm_sim_tid
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk         => clk,
      rst_n       => rst_n,
      axis_tdata  => burst_tdata,
      axis_tvalid => burst_tvalid,
      axis_tlast  => burst_tlast,
      axis_tready => burst_tready,
      axis_tid    => burst_tid
    );

  u_join : entity firm.firm_sim_join
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      s_axis_tdata  => burst_tdata,
      s_axis_tkeep  => burst_tkeep,
      s_axis_tuser  => burst_tuser,
      s_axis_tid    => burst_tid,
      s_axis_tvalid => burst_tvalid,
      s_axis_tlast  => burst_tlast,
      s_axis_tready => burst_tready,
      m_axis_tdata  => frame_tdata,
      m_axis_tkeep  => frame_tkeep,
      m_axis_tuser  => frame_tuser,
      m_axis_tid    => frame_tid,
      m_axis_tvalid => frame_tvalid,
      m_axis_tlast  => frame_tlast,
      m_axis_tready => frame_tready
    );

end architecture simulation;
