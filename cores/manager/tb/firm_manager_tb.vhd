-- SPDX-License-Identifier: Apache-2.0
-- Tests the Manager and a scheduler with the simulation host and one echo per channel. Subscriber k and publisher k
-- are an echo.
library ieee;
use ieee.std_logic_1164.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sim_check_pkg.all;

entity firm_manager_tb is
  generic (
    WIDTH         : integer := 8;
    SUBSCRIBERS   : integer := 2;
    PUBLISHERS    : integer := 2;
    STIMULUS_FILE : string  := "stimulus.txt";
    EXPECTED_FILE : string  := "expected.txt";
    SEED          : integer := 1;
    -- The host's stalls.
    STALL_PERCENT : integer := 0;
    -- The echoes' stalls, on each side.
    ECHO_STALL_PERCENT : integer := 0;
    SHOWN              : integer := 0;
    WATCHDOG           : integer := 10000;
    QUIET              : integer := 300
  );
end entity firm_manager_tb;

architecture simulation of firm_manager_tb is

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tvalid : std_logic;
  signal in_tlast  : std_logic;
  signal in_tready : std_logic;

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal out_tid    : std_logic_vector(7 downto 0);
  signal out_tvalid : std_logic;
  signal out_tlast  : std_logic;
  signal out_tready : std_logic;

  signal sub_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal sub_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal sub_tlast  : std_logic;
  signal sub_tvalid : std_logic_vector(SUBSCRIBERS-1 downto 0);
  signal sub_tready : std_logic_vector(SUBSCRIBERS-1 downto 0);

  signal pub_tdata  : std_logic_vector(PUBLISHERS*WIDTH-1 downto 0);
  signal pub_tkeep  : std_logic_vector(PUBLISHERS*WIDTH/8-1 downto 0);
  signal pub_tvalid : std_logic_vector(PUBLISHERS-1 downto 0);
  signal pub_tlast  : std_logic_vector(PUBLISHERS-1 downto 0);
  signal pub_tready : std_logic_vector(PUBLISHERS-1 downto 0);

  signal request      : std_logic_vector(PUBLISHERS-1 downto 0);
  signal beat         : std_logic;
  signal last         : std_logic;
  signal grant_valid  : std_logic;
  signal grant_select : std_logic_vector(index_bits(PUBLISHERS)-1 downto 0);

  signal id_error : std_logic;

begin

  u_host : entity firm.firm_sim_host
    generic map (
      WIDTH         => WIDTH,
      STIMULUS_FILE => STIMULUS_FILE,
      EXPECTED_FILE => EXPECTED_FILE,
      SEED          => SEED,
      STALL_PERCENT => STALL_PERCENT,
      SHOWN         => SHOWN,
      WATCHDOG      => WATCHDOG,
      QUIET         => QUIET
    )
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
      s_axis_tready => out_tready,
      id_error      => id_error
    );

  u_manager : entity firm.firm_manager
    generic map (
      WIDTH       => WIDTH,
      SUBSCRIBERS => SUBSCRIBERS,
      PUBLISHERS  => PUBLISHERS
    )
    port map (
      clk                => clk,
      rst_n              => rst_n,
      s_axis_tdata       => in_tdata,
      s_axis_tkeep       => in_tkeep,
      s_axis_tvalid      => in_tvalid,
      s_axis_tlast       => in_tlast,
      s_axis_tready      => in_tready,
      m_axis_tdata       => out_tdata,
      m_axis_tkeep       => out_tkeep,
      m_axis_tid         => out_tid,
      m_axis_tvalid      => out_tvalid,
      m_axis_tlast       => out_tlast,
      m_axis_tready      => out_tready,
      sub_axis_tdata     => sub_tdata,
      sub_axis_tkeep     => sub_tkeep,
      sub_axis_tlast     => sub_tlast,
      sub_axis_tvalid    => sub_tvalid,
      sub_axis_tready    => sub_tready,
      pub_axis_tdata     => pub_tdata,
      pub_axis_tkeep     => pub_tkeep,
      pub_axis_tvalid    => pub_tvalid,
      pub_axis_tlast     => pub_tlast,
      pub_axis_tready    => pub_tready,
      sched_request      => request,
      sched_beat         => beat,
      sched_last         => last,
      sched_grant_valid  => grant_valid,
      sched_grant_select => grant_select,
      id_error           => id_error
    );

  u_scheduler : entity firm.firm_sched_fixed_priority
    generic map (
      REQUESTERS => PUBLISHERS
    )
    port map (
      clk          => clk,
      rst_n        => rst_n,
      request      => request,
      beat         => beat,
      last         => last,
      grant_valid  => grant_valid,
      grant_select => grant_select
    );

  u_echoes : entity firm.firm_sim_echoes
    generic map (
      WIDTH         => WIDTH,
      SUBSCRIBERS   => SUBSCRIBERS,
      PUBLISHERS    => PUBLISHERS,
      SEED          => SEED,
      STALL_PERCENT => ECHO_STALL_PERCENT
    )
    port map (
      clk        => clk,
      rst_n      => rst_n,
      sub_tdata  => sub_tdata,
      sub_tkeep  => sub_tkeep,
      sub_tlast  => sub_tlast,
      sub_tvalid => sub_tvalid,
      sub_tready => sub_tready,
      pub_tdata  => pub_tdata,
      pub_tkeep  => pub_tkeep,
      pub_tvalid => pub_tvalid,
      pub_tlast  => pub_tlast,
      pub_tready => pub_tready
    );

  check_stream(clk, rst_n, in_tdata, in_tkeep, in_tvalid, in_tlast, in_tready, "in");

  check_stream(clk, rst_n, out_tdata, out_tkeep, out_tvalid, out_tlast, out_tready, "out");

end architecture simulation;
