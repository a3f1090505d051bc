-- SPDX-License-Identifier: Apache-2.0
-- A part that a stream goes through unchanged, between the simulation host's two streams.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_axis_pipe_tb is
  generic (
    -- register_slice or fifo
    PART          : string  := "register_slice";
    WIDTH         : integer := 8;
    DEPTH         : integer := 16;  -- of the FIFO
    STIMULUS_FILE : string  := "stimulus.txt";
    EXPECTED_FILE : string  := "expected.txt";
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0;
    WATCHDOG      : integer := 1000;
    QUIET         : integer := 100);
end entity firm_axis_pipe_tb;

architecture simulation of firm_axis_pipe_tb is

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tid    : std_logic_vector(7 downto 0);
  signal in_tvalid : std_logic;
  signal in_tlast  : std_logic;
  signal in_tready : std_logic;

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal out_tid    : std_logic_vector(7 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic;

begin

  u_host : entity firm.firm_sim_host
    generic map (
      WIDTH         => WIDTH,
      STIMULUS_FILE => STIMULUS_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT,
      SHOWN         => 0,
      WATCHDOG      => WATCHDOG,
      QUIET         => QUIET)
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => in_tdata,
      m_axis_tkeep  => in_tkeep,
      m_axis_tvalid => in_tvalid,
      m_axis_tlast  => in_tlast,
      m_axis_tready => in_tready,
      s_axis_tdata  => out_tdata,
      s_axis_tkeep  => out_tkeep,
      s_axis_tid    => out_tid,
      s_axis_tvalid => out_tvalid,
      s_axis_tlast  => out_tlast,
      s_axis_tready => out_tready);

  slice : if PART = "register_slice" generate

    -- The part carries `tid`: it is made where the frames go in.
    u_tid : entity firm.firm_sim_tid
      generic map (
        WIDTH => WIDTH)
      port map (
        clk         => clk,
        rst_n       => rst_n,
        axis_tdata  => in_tdata,
        axis_tvalid => in_tvalid,
        axis_tlast  => in_tlast,
        axis_tready => in_tready,
        axis_tid    => in_tid);

    u_part : entity firm.firm_axis_register_slice
      generic map (
        WIDTH => WIDTH)
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => in_tdata,
        s_axis_tkeep  => in_tkeep,
        s_axis_tid    => in_tid,
        s_axis_tvalid => in_tvalid,
        s_axis_tlast  => in_tlast,
        s_axis_tready => in_tready,
        m_axis_tdata  => out_tdata,
        m_axis_tkeep  => out_tkeep,
        m_axis_tid    => out_tid,
        m_axis_tvalid => out_tvalid,
        m_axis_tlast  => out_tlast,
        m_axis_tready => out_tready);

  end generate slice;

  fifo : if PART = "fifo" generate

    u_tid : entity firm.firm_sim_tid
      generic map (
        WIDTH => WIDTH)
      port map (
        clk         => clk,
        rst_n       => rst_n,
        axis_tdata  => out_tdata,
        axis_tvalid => out_tvalid,
        axis_tlast  => out_tlast,
        axis_tready => out_tready,
        axis_tid    => out_tid);

    u_part : entity firm.firm_axis_fifo
      generic map (
        WIDTH => WIDTH,
        DEPTH => DEPTH)
      port map (
        clk           => clk,
        rst_n         => rst_n,
        s_axis_tdata  => in_tdata,
        s_axis_tkeep  => in_tkeep,
        s_axis_tvalid => in_tvalid,
        s_axis_tlast  => in_tlast,
        s_axis_tready => in_tready,
        m_axis_tdata  => out_tdata,
        m_axis_tkeep  => out_tkeep,
        m_axis_tvalid => out_tvalid,
        m_axis_tlast  => out_tlast,
        m_axis_tready => out_tready);

  end generate fifo;

end architecture simulation;
