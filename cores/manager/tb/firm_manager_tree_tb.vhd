-- SPDX-License-Identifier: Apache-2.0
-- Tests the Manager of Managers with the simulation host and one echo per channel. Groups have GROUP_SIZE publishers,
-- the last one the rest. If REVERSED, publisher k is at the place PUBLISHERS-1-k.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
use firm.firm_sched_pkg.all;
use firm.firm_sim_check_pkg.all;

entity firm_manager_tree_tb is
  generic (
    WIDTH         : integer := 8;
    SUBSCRIBERS   : integer := 2;
    PUBLISHERS    : integer := 2;
    GROUP_SIZE    : integer := 2;
    POLICY        : integer := 0;  -- of the groups; 0: round robin, 1: fixed priority, 2: least recently used
    TOP           : integer := 0;  -- among the groups
    REVERSED      : boolean := false;
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
end entity firm_manager_tree_tb;

architecture simulation of firm_manager_tree_tb is

  constant GROUPS : positive := (PUBLISHERS + GROUP_SIZE - 1) / GROUP_SIZE;

  function group_sizes return times_t is
    variable result : times_t(0 to GROUPS-1) := (others => GROUP_SIZE);
  begin
    result(GROUPS-1) := PUBLISHERS - (GROUPS - 1) * GROUP_SIZE;
    return result;
  end function group_sizes;

  function policy_of(number : integer) return policy_t is
  begin
    if number = 1 then
      return FIXED_PRIORITY;
    elsif number = 2 then
      return LRU;
    end if;
    return ROUND_ROBIN;
  end function policy_of;

  function group_policies return policies_t is
    variable result : policies_t(0 to GROUPS-1) := (others => policy_of(POLICY));
  begin
    return result;
  end function group_policies;

  -- The publisher at a place.
  function publisher_at(place : natural) return natural is
  begin
    if REVERSED then
      return PUBLISHERS - 1 - place;
    end if;
    return place;
  end function publisher_at;

  function highs_of_places return times_t is
    variable result : times_t(0 to PUBLISHERS-1);
  begin
    for place in result'range loop
      result(place) := publisher_at(place) / 256;
    end loop;
    return result;
  end function highs_of_places;

  signal clk   : std_logic;
  signal rst_n : std_logic;

  signal in_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal in_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal in_tuser  : std_logic_vector(0 downto 0);
  signal in_tvalid : std_logic;
  signal in_tlast  : std_logic;
  signal in_tready : std_logic;

  signal out_tdata  : std_logic_vector(WIDTH-1 downto 0);
  signal out_tkeep  : std_logic_vector(WIDTH/8-1 downto 0);
  signal out_tuser  : std_logic_vector(0 downto 0);
  signal out_tid    : std_logic_vector(15 downto 0);
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

  signal id_error : std_logic;

begin

  u_host : entity firm.firm_sim_host
    generic map (
      WIDTH         => WIDTH,
      ID_BYTES      => 2,
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
      m_axis_tuser  => in_tuser,
      m_axis_tvalid => in_tvalid,
      m_axis_tlast  => in_tlast,
      m_axis_tready => in_tready,
      s_axis_tdata  => out_tdata,
      s_axis_tkeep  => out_tkeep,
      s_axis_tuser  => out_tuser,
      s_axis_tid    => out_tid,
      s_axis_tvalid => out_tvalid,
      s_axis_tlast  => out_tlast,
      s_axis_tready => out_tready,
      id_error      => id_error
    );

  u_manager : entity firm.firm_manager_tree
    generic map (
      WIDTH       => WIDTH,
      SUBSCRIBERS => SUBSCRIBERS,
      PUBLISHERS  => PUBLISHERS,
      SIZES       => group_sizes,
      POLICIES    => group_policies,
      TOP_POLICY  => policy_of(TOP),
      HIGHS       => highs_of_places
    )
    port map (
      clk             => clk,
      rst_n           => rst_n,
      s_axis_tdata    => in_tdata,
      s_axis_tkeep    => in_tkeep,
      s_axis_tuser    => in_tuser,
      s_axis_tvalid   => in_tvalid,
      s_axis_tlast    => in_tlast,
      s_axis_tready   => in_tready,
      m_axis_tdata    => out_tdata,
      m_axis_tkeep    => out_tkeep,
      m_axis_tuser    => out_tuser,
      m_axis_tid      => out_tid,
      m_axis_tvalid   => out_tvalid,
      m_axis_tlast    => out_tlast,
      m_axis_tready   => out_tready,
      sub_axis_tdata  => sub_tdata,
      sub_axis_tkeep  => sub_tkeep,
      sub_axis_tuser  => open,
      sub_axis_tlast  => sub_tlast,
      sub_axis_tvalid => sub_tvalid,
      sub_axis_tready => sub_tready,
      pub_axis_tdata  => pub_tdata,
      pub_axis_tkeep  => pub_tkeep,
      pub_axis_tvalid => pub_tvalid,
      pub_axis_tlast  => pub_tlast,
      pub_axis_tready => pub_tready,
      id_error        => id_error
    );

  u_echoes : entity firm.firm_sim_echoes
    generic map (
      WIDTH         => WIDTH,
      SUBSCRIBERS   => SUBSCRIBERS,
      PUBLISHERS    => PUBLISHERS,
      REVERSED      => REVERSED,
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
