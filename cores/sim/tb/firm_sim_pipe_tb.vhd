-- SPDX-License-Identifier: Apache-2.0
-- Tests the host at the end of a pipe with a system that is a wire and may break the stream.
library ieee;
use ieee.std_logic_1164.all;
library firm;

entity firm_sim_pipe_tb is
  generic (
    WIDTH         : integer := 8;
    SEED          : integer := 1;
    STALL_PERCENT : integer := 0;
    FAULT         : string  := "none"
  );
end entity firm_sim_pipe_tb;

architecture simulation of firm_sim_pipe_tb is

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal out_tuser  : std_logic_vector(0 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tuser  : std_logic_vector(0 downto 0);
  signal in_tid    : std_logic_vector(7 downto 0);
  signal in_tvalid : std_logic;
  signal in_tlast  : std_logic;
  signal in_tready : std_logic;

  signal id_error    : std_logic;
  signal frame_error : std_logic_vector(0 downto 0);

  -- The system itself is the wire, seen from both ends.
  signal waits : std_logic_vector(1 downto 0);

begin

  waits <= (in_tvalid and not in_tready) & (out_tvalid and not out_tready);

  u_host : entity firm.firm_sim_pipe
    generic map (
      WIDTH         => WIDTH,
      ERRORS        => 1,
      WIRES         => 2,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT
    )
    port map (
      clk           => clk,
      rst_n         => rst_n,
      m_axis_tdata  => out_tdata,
      m_axis_tkeep  => out_tkeep,
      m_axis_tuser  => out_tuser,
      m_axis_tvalid => out_tvalid,
      m_axis_tlast  => out_tlast,
      m_axis_tready => out_tready,
      s_axis_tdata  => in_tdata,
      s_axis_tkeep  => in_tkeep,
      s_axis_tuser  => in_tuser,
      s_axis_tid    => in_tid,
      s_axis_tvalid => in_tvalid,
      s_axis_tlast  => in_tlast,
      s_axis_tready => in_tready,
      id_error      => id_error,
      frame_error   => frame_error,
      frame_code    => "0111",
      waits         => waits
    );

  u_system : entity firm.firm_sim_wire
    generic map (
      WIDTH => WIDTH,
      FAULT => FAULT
    )
    port map (
      clk           => clk,
      s_axis_tdata  => out_tdata,
      s_axis_tkeep  => out_tkeep,
      s_axis_tuser  => out_tuser,
      s_axis_tvalid => out_tvalid,
      s_axis_tlast  => out_tlast,
      s_axis_tready => out_tready,
      m_axis_tdata  => in_tdata,
      m_axis_tkeep  => in_tkeep,
      m_axis_tuser  => in_tuser,
      m_axis_tid    => in_tid,
      m_axis_tvalid => in_tvalid,
      m_axis_tlast  => in_tlast,
      m_axis_tready => in_tready,
      id_error      => id_error,
      frame_error   => frame_error
    );

end architecture simulation;
